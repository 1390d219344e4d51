//! The origin of a long computation: config, data, program and the reference that every evaluation starts from.
//!
//! It is written beside the results, and checked when they are resumed: a computation continues only with the same
//! config and data, and the reference is rebuilt to the same bits.

use crate::data::config::{self, ConfigError};
use crate::data::io::provenance::{Measured, Provenance};
use crate::data::io::saved::{self, Saved};
use crate::data::scene::Scene;
use crate::inference::search::Found;
use crate::model::ParameterSpace;
use crate::sampling::optimise::Optimum;
use crate::surface::density::Density;
use crate::surface::expansion::nuisances;
use crate::surface::record::{RebuildError, SurfaceRecord};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The origin of a computation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// SHA-256 (hex) of the part of the config that determines the posterior and the chain.
    pub config_sha256: String,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// The config with all defaults filled in.
    pub config: serde_json::Value,
    /// Quantities measured from the observations.
    #[serde(default, skip_serializing_if = "Measured::is_empty")]
    pub measured: Measured,
    /// Number of profiles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profiles: Option<usize>,
    /// First and last time of the data (d).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_span_d: Option<[f64; 2]>,
    /// Injected values of all parameters, for simulated data.
    pub truth: Option<BTreeMap<String, f64>>,
    /// The image that every evaluation starts from.
    pub reference: SurfaceRecord,
    /// The best parameters that the search found.
    pub optimum: OptimumRecord,
    /// Other maxima of the search, by regularised likelihood, not much lower than the best.
    pub rivals: Vec<OptimumRecord>,
}

/// The optimum and its error bars.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OptimumRecord {
    /// Value of each sampled parameter.
    pub parameters: BTreeMap<String, f64>,
    /// Standard deviation of each from the curvature.
    pub sd: BTreeMap<String, f64>,
    /// Log-probability.
    pub log_prob: f64,
}

/// Files that identify the command of a folder.
const KINDS: [(&str, &str); 11] = [
    ("manifest.json", "sample"),
    ("periodogram.json", "periodogram"),
    ("limits.json", "limits"),
    ("optimum.json", "optimise"),
    ("landscape.json", "grid"),
    ("comparison.json", "compare"),
    ("map.json", "map"),
    ("plan.json", "plan"),
    ("batch.json", "batch"),
    ("survey.json", "survey"),
    ("truth.json", "simulate"),
];

/// The actual content of a folder without the expected file.
fn instead(folder: &Path) -> String {
    if !folder.exists() {
        return "no such folder".to_owned();
    }
    match KINDS.iter().find(|(file, _)| folder.join(file).is_file()) {
        Some((file, command)) => format!("this folder has results of `dimcmc {command}` ({file})"),
        None => "this folder holds no results yet".to_owned(),
    }
}

/// A computation cannot be used or resumed: one line naming file or folder.
#[derive(Debug, thiserror::Error)]
pub enum OriginError {
    /// No computation was begun there.
    #[error("{}: no {file}: {}", folder.display(), instead(folder))]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// The missing file.
        file: &'static str,
    },
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It has another format.
    #[error("{}: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// Its content is inconsistent.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// The config in it does not resolve.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Config or data have changed.
    #[error("{}: {what} since this run began; start a new run", .folder.display())]
    Changed {
        /// The folder.
        folder: PathBuf,
        /// What changed.
        what: String,
    },
    /// The reference differs: another version of the program, or another kind of processor.
    #[error("{}: the reference comes out differently here ({what} {now:e} instead of {then:e}): resume with the \
    version and on the kind of machine it was begun with", folder.display())]
    Irreproducible {
        /// The folder.
        folder: PathBuf,
        /// Name of the differing value.
        what: &'static str,
        /// The recorded value.
        then: f64,
        /// The new value.
        now: f64,
    },
    /// No reference at the recorded parameters.
    #[error(transparent)]
    Reference(RebuildError),
}

/// The provenance of a computation that begins in `scene` with the result `found` of a search: RV offsets of data sets
/// are those with its best orbit.
pub fn provenance(scene: &Scene, found: &Found) -> Provenance {
    let of_scene = scene.provenance();
    let constants = found.detection.as_ref().and_then(|search| {
        let nuisances = nuisances(&scene.settings.free);
        search.constants(&scene.imager, &nuisances)
    });
    let offsets = constants.map_or_else(Vec::new, |constants| constants.offsets);
    Provenance { measured: of_scene.measured.with_zero_points(&offsets), ..of_scene }
}

impl Origin {
    /// The origin of a computation that begins in `scene` with the result `found` of a search.
    pub fn of(scene: &Scene, found: &Found) -> Self {
        let Provenance { version, data_sha256, config_sha256, config, measured } = provenance(scene, found);
        let names = found.posterior.space().names();
        Origin {
            version: version.to_string(),
            config_sha256,
            data_sha256,
            config,
            measured,
            profiles: Some(scene.observations.profiles.len()),
            time_span_d: scene.observations.time_span_d(),
            truth: scene.named_truth(),
            reference: found.posterior.record(),
            optimum: OptimumRecord::of(names, &found.optimum),
            rivals: found.rivals().into_iter().map(|rival| OptimumRecord::of(names, rival)).collect(),
        }
    }

    /// Whether the computation in `folder` can be resumed in `scene`.
    ///
    /// # Errors
    /// [`OriginError::Changed`].
    pub fn check(&self, scene: &Scene, folder: &Path) -> Result<(), OriginError> {
        let now = scene.provenance();
        let what = if self.config_sha256 != now.config_sha256 {
            let key = config::first_difference(&self.config, &now.config);
            format!("{} of the config changed", key.as_deref().unwrap_or("something"))
        } else if self.data_sha256 != now.data_sha256 {
            "the observations changed".to_string()
        } else {
            return Ok(());
        };
        Err(OriginError::Changed { folder: folder.into(), what })
    }

    /// Its posterior of `space`, with the reference rebuilt to the same bits.
    ///
    /// # Errors
    /// [`OriginError::Irreproducible`], [`OriginError::Reference`].
    pub fn posterior(&self, scene: &Scene, space: ParameterSpace, folder: &Path) -> Result<Density, OriginError> {
        let scene = scene.clone().with_found(&self.measured);
        let space = if self.measured.star.is_some() { scene.space_of(space.free()) } else { space };
        let (surface, imager) = (scene.surface().model(), scene.imager.clone());
        surface.rebuilt(imager, space, &self.reference, &scene.settings.values).map_err(|error| match error {
            RebuildError::Differs { what, then, now } => {
                OriginError::Irreproducible { folder: folder.into(), what, then, now }
            }
            other => OriginError::Reference(other),
        })
    }
}

/// Reads the header `file` of a computation in `folder`: unknown keys are refused, and so are parameters with other
/// names than `names` finds in it.
///
/// # Errors
/// As [`read`]; unknown keys, and records of other parameters.
pub fn read_header<T: Saved + Serialize>(
    folder: &Path,
    file: &'static str,
    parts: impl Fn(&T) -> (&Origin, Vec<String>),
) -> Result<T, OriginError> {
    let whole: serde_json::Map<String, serde_json::Value> = read(folder, file)?;
    let header: T = read(folder, file)?;
    let wrong = |problem| OriginError::Content { path: folder.join(file), problem };
    let known =
        serde_json::to_value(&header).map_err(|source| OriginError::Json { path: folder.join(file), source })?;
    let is_known = |key: &str| OPTIONAL.contains(&key) || known.get(key).is_some();
    if let Some(key) = whole.keys().find(|key| !is_known(key)) {
        return Err(wrong(format!("unknown key {key}")));
    }
    let (origin, names) = parts(&header);
    let optima =
        std::iter::once(("optimum", &origin.optimum)).chain(origin.rivals.iter().map(|rival| ("rivals", rival)));
    for (key, optimum) in optima {
        for (part, values) in [("parameters", &optimum.parameters), ("sd", &optimum.sd)] {
            if let Some(name) = values.keys().find(|name| !names.contains(name)) {
                return Err(wrong(format!(
                    "{key}.{part}: unknown key {name}, the parameters are {}",
                    names.join(", ")
                )));
            }
            if let Some(name) = names.iter().find(|name| !values.contains_key(*name)) {
                return Err(wrong(format!("{key}.{part}: missing {name}")));
            }
        }
    }
    Ok(header)
}

/// Optional keys of such files.
const OPTIONAL: [&str; 2] = ["measured", "merged_seeds"];

/// Reads `file` of a computation in `folder`.
///
/// # Errors
/// A folder without it, or a file that cannot be read or has another format.
pub fn read<T: Saved>(folder: &Path, file: &'static str) -> Result<T, OriginError> {
    let path = folder.join(file);
    let text = std::fs::read(&path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => OriginError::Missing { folder: folder.into(), file },
        _ => OriginError::Read { path: path.clone(), source },
    })?;
    let content = |problem| OriginError::Content { path: path.clone(), problem };
    let json = |source| OriginError::Json { path: path.clone(), source };
    saved::check_numbers(&serde_json::from_slice(&text).map_err(json)?).map_err(content)?;
    let value: T = serde_json::from_slice(&text).map_err(json)?;
    value.check().map_err(content)?;
    Ok(value)
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
