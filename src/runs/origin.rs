//! What a long computation was begun with: config, data, program and the reference that every evaluation starts from.
//!
//! It is written beside the results, and whoever goes on with them checks it: nothing is continued with another config
//! or other data, and the reference is rebuilt to the same bits.

use crate::data::config::{self, ConfigError};
use crate::data::io::provenance::{Measured, Provenance};
use crate::data::scene::Scene;
use crate::field::FieldError;
use crate::inference::search::Found;
use crate::model::{Parameter, ParameterSpace, ParameterValues};
use crate::sampling::optimise::Optimum;
use crate::surface::density::Density;
use crate::surface::evolving_map::{Held, MarginalPosterior, bounds};
use crate::surface::static_map::{Posterior, Reference, ReferenceError};
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a computation was begun with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// SHA-256 (hex) of the part of the config that decides the posterior and the chain.
    pub config_sha256: String,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// The config with all defaults filled in.
    pub config: serde_json::Value,
    /// What the config leaves to the observations.
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
    pub reference: ReferenceRecord,
    /// The best parameters that the search found.
    pub optimum: OptimumRecord,
    /// Other maxima that it found, by regularised likelihood, not much lower than the best.
    pub rivals: Vec<OptimumRecord>,
}

/// What every evaluation starts from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ReferenceRecord {
    /// A map of maximum entropy.
    Image(ImageRecord),
    /// The most probable maps, where all are integrated over.
    Field(FieldRecord),
}

/// By the key that one of them has, so that an error is about that one.
impl<'de> Deserialize<'de> for ReferenceRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let read = match value.get("ln_evidence") {
            Some(_) => serde_json::from_value(value).map(ReferenceRecord::Field),
            None => serde_json::from_value(value).map(ReferenceRecord::Image),
        };
        read.map_err(D::Error::custom)
    }
}

/// The most probable maps, one a profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldRecord {
    /// All parameters, those of the field among them; without a lifetime spots live for ever.
    pub parameters: BTreeMap<String, f64>,
    /// Degree below which the spectrum of the spots is flat.
    #[serde(default)]
    pub spot_break_degree: f64,
    /// Scatter of the profiles' velocity zero points (km/s).
    pub velocity_jitter_kms: f64,
    /// ln of the evidence.
    pub ln_evidence: f64,
    /// Number of data.
    pub data: usize,
}

/// The reference solution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageRecord {
    /// All parameters.
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
#[serde(deny_unknown_fields)]
pub struct OptimumRecord {
    /// Value of each sampled parameter.
    pub parameters: BTreeMap<String, f64>,
    /// Standard deviation of each from the curvature.
    pub sd: BTreeMap<String, f64>,
    /// Log-probability.
    pub log_prob: f64,
}

/// What was begun cannot be used, or not be gone on with: one line naming file or folder.
#[derive(Debug, thiserror::Error)]
pub enum OriginError {
    /// Nothing was begun there.
    #[error("{}: no {file}: nothing was begun in this folder, or it ended before its first result", folder.display())]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// The file that should be there.
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
    /// It is not what it should be.
    #[error("{}: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// What it says does not belong together.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The config in it does not resolve.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Config or data are not those that it was begun with.
    #[error("{}: {what} since this run began; begin another run for it", .folder.display())]
    Changed {
        /// The folder.
        folder: PathBuf,
        /// What changed.
        what: String,
    },
    /// The reference comes out differently: another version of the program, or another kind of processor.
    #[error("{}: the reference comes out differently here ({what} {now:e} instead of {then:e}): resume with the \
    version and on the kind of machine it was begun with", folder.display())]
    Irreproducible {
        /// The folder.
        folder: PathBuf,
        /// Which of its numbers.
        what: &'static str,
        /// That number then.
        then: f64,
        /// And now.
        now: f64,
    },
    /// No reference at the recorded parameters.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No maps there.
    #[error(transparent)]
    Field(#[from] FieldError),
}

impl Origin {
    /// What begins in `scene` with what the search `found`.
    pub fn of(scene: &Scene, found: &Found) -> Self {
        let Provenance { version, data_sha256, config_sha256, config, measured } = scene.provenance();
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
            reference: ReferenceRecord::of(&found.posterior),
            optimum: OptimumRecord::of(names, &found.optimum),
            rivals: found.rivals().into_iter().map(|rival| OptimumRecord::of(names, rival)).collect(),
        }
    }

    /// Whether what began in `folder` can go on in `scene`.
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

    /// The posterior of `space` that it began with, its reference rebuilt to the same bits.
    ///
    /// # Errors
    /// [`OriginError::Irreproducible`], [`OriginError::Reference`].
    pub fn posterior(&self, scene: &Scene, space: ParameterSpace, folder: &Path) -> Result<Density, OriginError> {
        let values = self.reference.values(&scene.settings.values);
        let imager = scene.imager.clone();
        let (density, what, then, now) = match &self.reference {
            ReferenceRecord::Image(then) => {
                let reference = Reference::build(&imager, values, scene.chi2_target)?;
                let now = reference.solution.image.lambda;
                let posterior = Posterior::new(imager, space, scene.settings.imaging.objective, reference);
                (Density::Mapped(Box::new(posterior)), "lambda", then.lambda, now)
            }
            ReferenceRecord::Field(then) => {
                let posterior = MarginalPosterior::new(imager, &space, values, then.held())?;
                let now = posterior.reference_ln_evidence();
                (Density::Integrated(Box::new(posterior)), "ln of the evidence", then.ln_evidence, now)
            }
        };
        match then.to_bits() == now.to_bits() {
            true => Ok(density),
            false => Err(OriginError::Irreproducible { folder: folder.into(), what, then, now }),
        }
    }
}

/// Reads the `file` that says what a computation in `folder` was begun with: what `T` does not know is refused, and so
/// are parameters with other names than `names` finds in it.
///
/// # Errors
/// As [`read`]; unknown keys, and records of other parameters.
pub fn read_header<T: DeserializeOwned + Serialize>(
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

/// Keys of such files that are left out where there is nothing to say.
const OPTIONAL: [&str; 2] = ["measured", "merged_seeds"];

/// Reads `file`, which a computation that began in `folder` has written there.
///
/// # Errors
/// A folder without it, or a file that cannot be read or is not what it should be.
pub fn read<T: DeserializeOwned>(folder: &Path, file: &'static str) -> Result<T, OriginError> {
    let path = folder.join(file);
    let text = std::fs::read(&path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => OriginError::Missing { folder: folder.into(), file },
        _ => OriginError::Read { path: path.clone(), source },
    })?;
    serde_json::from_slice(&text).map_err(|source| OriginError::Json { path, source })
}

impl ReferenceRecord {
    /// The record of a density's reference.
    pub fn of(density: &Density) -> Self {
        match density {
            Density::Mapped(posterior) => ReferenceRecord::Image(ImageRecord::of(posterior.reference())),
            Density::Integrated(posterior) => ReferenceRecord::Field(FieldRecord::of(posterior)),
        }
    }

    /// The parameters, by name.
    pub fn parameters(&self) -> &BTreeMap<String, f64> {
        match self {
            ReferenceRecord::Image(record) => &record.parameters,
            ReferenceRecord::Field(record) => &record.parameters,
        }
    }

    /// What has to be known of it, and of the parameters that are free.
    pub fn warnings(&self, free: &[String]) -> Vec<String> {
        match self {
            ReferenceRecord::Image(record) => record.warning().into_iter().collect(),
            ReferenceRecord::Field(record) => record.warnings(free),
        }
    }

    /// All parameters; those missing in the record are taken from `others`, but for a lifetime: without one spots live
    /// for ever.
    pub fn values(&self, others: &ParameterValues) -> ParameterValues {
        let mut values = *others;
        values[Parameter::SpotLifetime] = f64::NAN;
        for p in Parameter::ALL {
            values[p] = self.parameters().get(p.name()).copied().unwrap_or(values[p]);
        }
        values
    }
}

impl FieldRecord {
    fn of(posterior: &MarginalPosterior) -> Self {
        let Held { break_degree, jitter_kms } = posterior.reference().assumed.held();
        FieldRecord {
            parameters: by_name(&posterior.reference().values),
            spot_break_degree: break_degree,
            velocity_jitter_kms: jitter_kms,
            ln_evidence: posterior.reference_ln_evidence(),
            data: posterior.imager().data.depth.len(),
        }
    }

    /// What is no parameter.
    fn held(&self) -> Held {
        Held { break_degree: self.spot_break_degree, jitter_kms: self.velocity_jitter_kms }
    }

    /// Parameters of the field that lie on a bound of its search, and free ones whose errors are too small.
    fn warnings(&self, free: &[String]) -> Vec<String> {
        /// Nearer than this part a bound is reached.
        const REACHED: f64 = 0.01;
        let on_bound = |p: &Parameter| {
            let (value, (low, high)) = (*self.parameters.get(p.name())?, bounds(*p));
            let near = |bound: f64| (value / bound - 1.0).abs() < REACHED;
            let bound = [low, high].into_iter().find(|bound| near(*bound))?;
            Some(match (p, bound == high) {
                (Parameter::SpotLifetime, true) => "the profiles do not show that the spots change".to_owned(),
                _ => format!("{} lies on the bound of its search, {bound}", p.name()),
            })
        };
        Parameter::FIELD.iter().filter_map(on_bound).chain(self.too_sure(free)).collect()
    }

    /// Which errors are known to be too small (`results/calibration-stellar.md`).
    fn too_sure(&self, free: &[String]) -> Option<String> {
        /// Above this vsini (km/s) they are.
        const FAST_KMS: f64 = 45.0;
        let is_fast = *self.parameters.get(Parameter::Vsini.name())? > FAST_KMS;
        let of = [Parameter::OmegaEq, Parameter::DOmega, Parameter::Inclination].map(Parameter::name);
        let of: Vec<&str> = of.into_iter().filter(|name| free.iter().any(|free| free == name)).collect();
        (is_fast && !of.is_empty()).then(|| {
            format!(
                "vsini is above {FAST_KMS:.0} km/s: take {} with twice the errors, which on simulated stars with spots \
                like discs were too small by factors of 1.4 to 1.7",
                of.join(", ")
            )
        })
    }
}

impl ImageRecord {
    fn of(reference: &Reference) -> Self {
        let solution = &reference.solution;
        ImageRecord {
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
    /// spottedness explodes, and the answer hangs on the target (`docs/method.md` section 3).
    fn warning(&self) -> Option<String> {
        let noise = (2.0 / self.data as f64).sqrt() * self.chi2_target;
        (self.chi2_target - self.chi2_reach < noise).then(|| {
            let per_datum = |chi2: f64| chi2 / self.data as f64;
            format!(
                "the target chi2 of {:.3} per datum is close to the floor (three times its lambda comes down to \
                {:.3}): see \
                 whether the answer stays when imaging.chi2_target is raised by {:.3}",
                per_datum(self.chi2_target),
                per_datum(self.chi2_reach),
                per_datum(noise)
            )
        })
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

/// The values that are given, by name.
pub fn by_name(values: &ParameterValues) -> BTreeMap<String, f64> {
    Parameter::ALL.iter().filter_map(|&p| Some((p.name().to_string(), values.given(p)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_stars_are_too_sure_of_their_shear() {
        let of = |vsini_kms: f64, free: &[&str]| {
            let parameters = BTreeMap::from([("vsini_kms".to_owned(), vsini_kms)]);
            let (spot_break_degree, velocity_jitter_kms, ln_evidence, data) = (7.0, 0.0, 0.0, 1);
            let record = FieldRecord { parameters, spot_break_degree, velocity_jitter_kms, ln_evidence, data };
            record.warnings(&free.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())
        };
        let [warning] = &of(60.0, &["k_kms", "domega_rad_d", "inclination_deg"])[..] else { panic!("one warning") };
        assert!(warning.contains("take domega_rad_d, inclination_deg with twice the errors"), "{warning}");
        assert!(of(40.0, &["domega_rad_d"]).is_empty());
        assert!(of(60.0, &["k_kms", "vsini_kms"]).is_empty());
    }
}
