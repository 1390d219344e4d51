//! What a run was begun with: `manifest.json`, beside the chain it belongs to.
//!
//! Written before the first step; afterwards only length and goals of the run change (`--extend`, or `steps`, `rhat` and `ess`
//! of the config). Everything that a chain is a function of is in it or checked against it. Left out: the chain itself (`io::journal`).

use crate::chain::{Goals, ParameterKind, Shape};
use crate::config::{self, ConfigError, Settings};
use crate::ensemble::Positions;
use crate::io::atomic::{WriteError, write_json};
use crate::io::provenance::Provenance;
use crate::objective::{Parameter, ParameterValues, Prior, Reference};
use crate::optimise::Optimum;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Name of the file in a run's folder.
pub const FILE: &str = "manifest.json";

/// The content of `manifest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the program.
    pub version: String,
    /// SHA-256 (hex) of the part of the config that decides the chain.
    pub config_sha256: String,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// The config with all defaults filled in.
    pub config: serde_json::Value,
    /// Names of the sampled parameters, in the order of the chain.
    pub names: Vec<String>,
    /// Their priors.
    pub priors: BTreeMap<String, serde_json::Value>,
    /// Number of independent ensembles.
    pub ensembles: usize,
    /// Walkers of each.
    pub walkers: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Step that the chain goes on to in any case, where it was extended.
    pub extend_to: Option<usize>,
    /// Injected values of all parameters, for simulated data.
    pub truth: Option<BTreeMap<String, f64>>,
    /// The image that every evaluation starts from.
    pub reference: ReferenceRecord,
    /// The best parameters before sampling.
    pub optimum: OptimumRecord,
    /// Other maxima that the search found, by regularised likelihood, not much lower than the best.
    pub rivals: Vec<OptimumRecord>,
    /// Positions of all walkers at step 0: `[ensemble][walker][parameter]`.
    pub start: Positions,
}

/// The reference solution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceRecord {
    /// All eight parameters.
    pub parameters: BTreeMap<String, f64>,
    /// Target of chi2.
    pub chi2_target: f64,
    /// chi2 of the image.
    pub chi2: f64,
    /// Lagrange multiplier.
    pub lambda: f64,
    /// Entropy.
    pub entropy: f64,
    /// Spottedness.
    pub spottedness: f64,
    /// chi2 at the end of the trade-off curve, where lambda is three times as large.
    pub chi2_reach: f64,
    /// Number of data.
    pub data: usize,
}

/// The optimum and its error bars.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimumRecord {
    /// Value of each sampled parameter.
    pub parameters: BTreeMap<String, f64>,
    /// Standard deviation of each from the curvature.
    pub sd: BTreeMap<String, f64>,
    /// Log-probability.
    pub log_prob: f64,
}

/// A manifest that cannot be used: one line naming the file.
#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    /// There is none.
    #[error("{}: no {FILE}: not the folder of a run, or of one that ended before its first step", folder.display())]
    Missing {
        /// The folder.
        folder: PathBuf,
    },
    /// It cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no manifest.
    #[error("{}: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// The config in it does not resolve.
    #[error(transparent)]
    Config(#[from] ConfigError),
}

impl ReferenceRecord {
    /// The record of a reference.
    pub fn of(reference: &Reference) -> Self {
        let solution = &reference.solution;
        ReferenceRecord {
            parameters: by_name(&reference.values),
            chi2_target: reference.chi2_target,
            chi2: solution.chi2,
            lambda: solution.image.lambda,
            entropy: solution.entropy,
            spottedness: solution.spottedness,
            chi2_reach: reference.tradeoff.nodes().last().map_or(solution.chi2, |node| node.chi2),
            data: reference.response.data_len(),
        }
    }

    /// A target that a noise realisation, which moves the attainable chi2 by sqrt(2/N), may put out of reach: there
    /// spottedness explodes, and the answer hangs on the target (method section 3).
    pub fn warning(&self) -> Option<String> {
        let noise = (2.0 / self.data as f64).sqrt() * self.chi2_target;
        (self.chi2_target - self.chi2_reach < noise).then(|| {
            let per_datum = |chi2: f64| chi2 / self.data as f64;
            format!(
                "the target chi2 of {:.3} per datum is close to the floor (three times its lambda comes down to {:.3}): see \
                 whether the answer stays when imaging.chi2_target is raised by {:.3}",
                per_datum(self.chi2_target),
                per_datum(self.chi2_reach),
                per_datum(noise)
            )
        })
    }

    /// All eight parameters; those missing in the record are taken from `others`.
    pub fn values(&self, others: &ParameterValues) -> ParameterValues {
        let mut values = *others;
        for p in Parameter::ALL {
            values[p] = self.parameters.get(p.name()).copied().unwrap_or(values[p]);
        }
        values
    }
}

impl OptimumRecord {
    /// The record of an optimum of the named parameters.
    pub fn of(names: &[String], optimum: &Optimum) -> Self {
        let sd = |i: usize| optimum.written_covariance[(i, i)].max(0.0).sqrt();
        OptimumRecord {
            parameters: names.iter().cloned().zip(optimum.theta.iter().copied()).collect(),
            sd: names.iter().cloned().enumerate().map(|(i, name)| (name, sd(i))).collect(),
            log_prob: optimum.evaluation.log_prob,
        }
    }
}

impl Manifest {
    /// What a reader of the chain must know beside it, one line each.
    pub fn warnings(&self) -> Vec<String> {
        let place = |rival: &OptimumRecord| {
            let values: Vec<String> = self.names.iter().map(|n| format!("{n} {:.4}", rival.parameters[n])).collect();
            values.join(", ")
        };
        let line = |rival: &OptimumRecord| {
            format!("another maximum, not much lower, where walkers started too: {}", place(rival))
        };
        self.rivals.iter().map(line).chain(self.reference.warning()).collect()
    }

    /// Reads the manifest in a run's folder.
    ///
    /// # Errors
    /// A folder without one, or one that cannot be read.
    pub fn read(folder: &Path) -> Result<Self, ManifestError> {
        let path = folder.join(FILE);
        let text = std::fs::read(&path).map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => ManifestError::Missing { folder: folder.into() },
            _ => ManifestError::Read { path: path.clone(), source },
        })?;
        serde_json::from_slice(&text).map_err(|source| ManifestError::Json { path, source })
    }

    /// Writes it into a run's folder.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_json(&folder.join(FILE), self)
    }

    /// What decides the chain and is not as it was when the run began; `None` if the run can go on.
    pub fn change(&self, now: &Provenance) -> Option<String> {
        if self.config_sha256 != now.config_sha256 {
            let key = config::first_difference(&self.config, &now.config);
            return Some(format!("{} of the config changed", key.as_deref().unwrap_or("something")));
        }
        (self.data_sha256 != now.data_sha256).then(|| "the observations changed".to_string())
    }

    /// Takes over settings that may change between the parts of a run (its length and goals), and the step that it goes on
    /// to in any case. A new step limit ends an extension. Returns whether anything changed.
    pub fn update(&mut self, settings: &Settings, extend_to: Option<usize>) -> bool {
        let before = (self.extend_to, self.config.clone());
        let steps = |config: &serde_json::Value| config.pointer("/sampler/steps").cloned();
        if extend_to.is_some() || steps(&self.config) != steps(&settings.resolved) {
            self.extend_to = extend_to;
        }
        self.config = settings.resolved.clone();
        before != (self.extend_to, self.config.clone())
    }

    /// Shape of the chain.
    pub fn shape(&self) -> Shape {
        Shape { names: self.names.clone(), ensembles: self.ensembles, walkers: self.walkers }
    }

    /// The settings that the run was begun with.
    ///
    /// # Errors
    /// A config that this version does not understand.
    pub fn settings(&self, folder: &Path) -> Result<Settings, ManifestError> {
        Ok(config::from_json(self.config.to_string().as_bytes(), &folder.join(FILE))?)
    }
}

/// All eight values by name.
pub fn by_name(values: &ParameterValues) -> BTreeMap<String, f64> {
    Parameter::ALL.iter().map(|&p| (p.name().to_string(), values[p])).collect()
}

/// What sort of number each free parameter is, and the goals of the chain.
pub fn kinds_and_goals(settings: &Settings) -> (Vec<ParameterKind>, Goals) {
    let kind = |f: &crate::objective::FreeParameter| match (f.parameter, f.prior) {
        (_, Prior::Periodic) => ParameterKind::Periodic,
        (Parameter::Phi, prior) if prior.bounds().1 - prior.bounds().0 >= 1.0 => ParameterKind::Periodic,
        (Parameter::K, _) => ParameterKind::Amplitude,
        _ => ParameterKind::Linear,
    };
    let goals = Goals { rhat: settings.sampler.rhat, ess: settings.sampler.ess };
    (settings.free.iter().map(kind).collect(), goals)
}
