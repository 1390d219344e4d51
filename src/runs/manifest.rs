//! The manifest of a run: `manifest.json`, beside its chain.
//!
//! Written before the first step; afterwards only length and goals of the run change (`--extend`, or `steps`, `rhat`
//! and `ess` of the config). Everything that determines a chain is in it or checked against it.

mod conclusions;

pub use conclusions::RunSummary;

use crate::data::config::{Config, Settings};
use crate::data::io::atomic::{WriteError, write_json};
use crate::data::io::saved::Saved;
use crate::model::{
    Elements, FreeParameter, OrbitQuantities, OrbitQuantity, Parameter, Prior, Quoted, definition, in_earths,
};
use crate::runs::blind_search::SearchSummary;
use crate::runs::origin::{self, OptimumRecord, Origin, OriginError};
use crate::sampling::chain::{Chain, ChainError, Goals, ParameterKind, Record, Settled, Shape, Summary, summarise};
use crate::sampling::ensemble::Positions;
use crate::surface::{CHI2, SPOTTEDNESS};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the file in a run's folder.
pub const FILE: &str = "manifest.json";

/// Fraction of the rotation period, or of a fraction of it, within which spots mimic an orbit
/// (`results/calibration.md`).
const NEAR_ROTATION: f64 = 0.15;

/// The content of `manifest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Config, data, program and reference.
    #[serde(flatten)]
    pub origin: Origin,
    /// Names of the sampled parameters, in the order of the chain.
    pub names: Vec<String>,
    /// Names of the other values of each draw.
    #[serde(default = "posterior_numbers")]
    pub numbers: Vec<String>,
    /// Priors of the parameters.
    pub priors: BTreeMap<String, serde_json::Value>,
    /// Number of independent ensembles.
    pub ensembles: usize,
    /// Walkers of each.
    pub walkers: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Smallest last step of the chain, where it was extended.
    pub extend_to: Option<usize>,
    /// Seeds of the joined runs, if it is a merged run, which cannot be resumed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub merged_seeds: Vec<u64>,
    /// The blind search behind the verdict; absent where no orbit was searched for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blind_search: Option<SearchSummary>,
    /// Positions of all walkers at step 0: `[ensemble][walker][parameter]`.
    pub start: Positions,
}

fn posterior_numbers() -> Vec<String> {
    [SPOTTEDNESS, CHI2].map(str::to_owned).to_vec()
}

impl Saved for Manifest {}

impl Manifest {
    /// Warnings for readers of the chain, one line each.
    pub fn warnings(&self) -> Vec<String> {
        let place = |rival: &OptimumRecord| {
            let values: Vec<String> = self.names.iter().map(|n| format!("{n} {:.4}", rival.parameters[n])).collect();
            values.join(", ")
        };
        let line = |rival: &OptimumRecord| format!("Secondary maximum, also used as a start: {}", place(rival));
        let measured = self.origin.measured.lines().into_iter().map(|(label, text)| format!("{label}: {text}"));
        let warnings = self.origin.reference.warnings(&self.names).into_iter();
        let warnings = warnings.chain(self.origin.measured.held_regions(&self.names));
        self.origin.rivals.iter().map(line).chain(warnings).chain(measured).collect()
    }

    /// A warning where the period found is the rotation's or a fraction of it: residual unresolved spots look like an
    /// orbit there, and the posterior does not include them.
    pub fn co_rotation(&self, summary: &Summary) -> Option<String> {
        let counted = self.origin.config.pointer("/imaging/unresolved_spots").is_some_and(|value| value != "entropy");
        let period = summary.parameters.get(Parameter::PorbOverProt.name()).filter(|_| !counted)?;
        let [low, high] = period.ci68;
        // an unconstrained period gives no warning
        if high > low * (1.0 + 2.0 * NEAR_ROTATION) {
            return None;
        }
        let fraction = (1..=4).find(|&n| {
            let here = 1.0 / f64::from(n);
            low < here * (1.0 + NEAR_ROTATION) && high > here * (1.0 - NEAR_ROTATION)
        })?;
        let rotation = if fraction == 1 { "P_rot".to_owned() } else { format!("P_rot/{fraction}") };
        Some(format!(
            "The period lies within {:.0} % of {rotation}, where it is degenerate with spot modulation: the \
            interval of K is too narrow; compare with `dimcmc periodogram` or imaging.unresolved_spots: \"fitted\".",
            100.0 * NEAR_ROTATION
        ))
    }

    /// Star and data, for commonly quoted quantities of an orbit.
    pub fn orbit_quantities(&self, settings: &Settings) -> OrbitQuantities {
        OrbitQuantities::new(&settings.star, settings.mass_msun, self.origin.time_span_d)
    }

    /// The summary of the run's chain with its verdict, and with commonly quoted quantities of the orbit, draw by draw,
    /// also separately.
    ///
    /// # Errors
    /// A chain without a step.
    pub fn summarise(&self, settings: &Settings, chain: &Chain) -> Result<(RunSummary, Vec<Settled>), ChainError> {
        let (kinds, goals) = kinds_and_goals(settings);
        let mut summary = summarise(chain, &kinds, &goals)?;
        for f in &settings.free {
            let of = summary.parameters.get_mut(f.parameter.name());
            if let (Some(factor), Some(one)) = (self.origin.reference.widening(f.parameter), of) {
                one.widen(factor, f.prior.bounds());
            }
        }
        let quantities = self.orbit_quantities(settings).of_draws(&settings.free, &settings.values);
        let settled = summary.derive(chain, quantities);
        let mass = summary.derived.get(OrbitQuantity::MinimumMass.name());
        if let Some(earths) = mass.and_then(|mass| in_earths(mass.upper95.unwrap_or(mass.median))) {
            let meaning = summary.definitions.entry(OrbitQuantity::MinimumMass.name().to_owned()).or_default();
            meaning.push_str(&format!("; {earths}"));
        }
        for name in &summary.names {
            if let Some(meaning) = definition(name) {
                summary.definitions.insert(name.clone(), meaning.to_owned());
            }
        }
        Ok((RunSummary::of(chain, summary, settings, self.blind_search.as_ref()), settled))
    }

    /// The injected value of a quantity of the orbit, for an event the one nearest to the estimate; `None` where no
    /// planet was injected.
    pub fn true_quantity(&self, settings: &Settings, name: &str, estimate: f64) -> Option<f64> {
        let truth = self.origin.truth.as_ref()?;
        let quoted = Quoted::from_name(name)?;
        let elements = &Elements::PLANETS[quoted.planet];
        let mut values = settings.values;
        // a simulated orbit is circular unless its shape is given
        values.orbit_mut(elements.planet).shape = None;
        let given = truth.iter().filter_map(|(name, value)| Some((Parameter::from_name(name)?, *value)));
        given.filter(|(p, _)| !p.is_ephemeris()).for_each(|(p, value)| values.set(p, value));
        truth.get(elements.k.name()).filter(|k| **k != 0.0)?;
        self.orbit_quantities(settings).value(quoted.quantity, &elements.orbit(&values), Some(estimate))
    }

    /// Injected values of the parameters and of derived quantities in `summary`, for its table; `None` for observed
    /// data.
    pub fn truth(&self, settings: &Settings, summary: &Summary) -> Option<BTreeMap<String, f64>> {
        let mut truth = self.origin.truth.clone()?;
        for (name, one) in &summary.derived {
            truth.extend(self.true_quantity(settings, name, one.median).map(|value| (name.clone(), value)));
        }
        Some(truth)
    }

    /// Reads the manifest in a run's folder.
    ///
    /// # Errors
    /// A folder without one, or one that cannot be read.
    pub fn read(folder: &Path) -> Result<Self, OriginError> {
        let manifest: Manifest = origin::read_header(folder, FILE, Manifest::parts)?;
        let wrong = |problem| Err(OriginError::Content { path: folder.join(FILE), problem });
        if let Some(name) = manifest.names.iter().find(|name| Parameter::from_name(name).is_none()) {
            return wrong(format!("names: unknown parameter {name}"));
        }
        if let Some(name) = manifest.priors.keys().find(|name| !manifest.names.contains(name)) {
            return wrong(format!("priors: unknown key {name}"));
        }
        let free = manifest.origin.config.get("parameters").and_then(serde_json::Value::as_object);
        let is_free = |name: &String| free.is_some_and(|free| free.get(name).is_some_and(|prior| !prior.is_null()));
        let count = free.map_or(0, |free| free.values().filter(|prior| !prior.is_null()).count());
        if count != manifest.names.len() || !manifest.names.iter().all(is_free) {
            return wrong("names: are not the parameters of the config".into());
        }
        let prior = |name: &String| manifest.prior(name).is_none();
        if let Some(name) = manifest.names.iter().find(|name| prior(name)) {
            return wrong(format!("priors.{name}: is missing, or no prior"));
        }
        match manifest.has_shape() {
            true => Ok(manifest),
            false => wrong("start: is not of as many ensembles, walkers and parameters as the rest says".into()),
        }
    }

    /// Its origin, and the names of its parameters.
    fn parts(&self) -> (&Origin, Vec<String>) {
        (&self.origin, self.names.clone())
    }

    /// The prior of a parameter.
    fn prior(&self, name: &str) -> Option<Prior> {
        serde_json::from_value(self.priors.get(name)?.clone()).ok()
    }

    /// The first line of a chain (from 1) that its priors exclude, and why.
    pub fn outside(&self, chain: &Chain) -> Option<(usize, String)> {
        let priors: Vec<Option<Prior>> = self.names.iter().map(|name| self.prior(name)).collect();
        let problem = |record: &Record| {
            let mut values = self.names.iter().zip(&priors).zip(&record.theta);
            let ((name, prior), x) = values.find(|((_, prior), x)| prior.is_some_and(|p| !holds(&p, **x)))?;
            let (min, max) = prior.map_or((f64::NAN, f64::NAN), |prior| prior.bounds());
            Some(format!("{name} {x} is outside its prior ({min} to {max}): no draw of this run"))
        };
        chain.records().iter().enumerate().find_map(|(k, record)| Some((k + 1, problem(record)?)))
    }

    /// Whether the start has the chain's shape.
    fn has_shape(&self) -> bool {
        let walker = |theta: &Vec<f64>| theta.len() == self.names.len();
        let ensemble = |walkers: &Vec<Vec<f64>>| walkers.len() == self.walkers && walkers.iter().all(walker);
        self.shape().size() > 0 && self.start.len() == self.ensembles && self.start.iter().all(ensemble)
    }

    /// Writes it into a run's folder.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_json(&folder.join(FILE), self)
    }

    /// Adopts settings that may change between the parts of a run (its length and goals), and its smallest last step. A
    /// new step limit ends an extension. Returns whether anything changed.
    pub fn update(&mut self, settings: &Settings, extend_to: Option<usize>) -> bool {
        let before = (self.extend_to, self.origin.config.clone());
        let steps = |config: &serde_json::Value| config.pointer("/sampler/steps").cloned();
        if extend_to.is_some() || steps(&self.origin.config) != steps(&settings.resolved) {
            self.extend_to = extend_to;
        }
        self.origin.config = settings.resolved.clone();
        before != (self.extend_to, self.origin.config.clone())
    }

    /// Seeds of all random numbers in it.
    pub fn seeds(&self) -> Vec<u64> {
        if self.merged_seeds.is_empty() { vec![self.seed] } else { self.merged_seeds.clone() }
    }

    /// Shape of the chain.
    pub fn shape(&self) -> Shape {
        let (names, numbers) = (self.names.clone(), self.numbers.clone());
        Shape { names, numbers, ensembles: self.ensembles, walkers: self.walkers }
    }

    /// The settings of the run.
    ///
    /// # Errors
    /// A config that this version does not support.
    pub fn settings(&self, folder: &Path) -> Result<Settings, OriginError> {
        Ok(Config::at(self.origin.config.clone(), &folder.join(FILE)).settings()?)
    }
}

/// Whether a prior contains a value, within rounding at its bounds and within the range of an unbounded Gaussian.
fn holds(prior: &Prior, x: f64) -> bool {
    let (min, max) = prior.bounds();
    let slack = 1e-9 * if (max - min).is_finite() { max - min } else { 1.0 };
    let within_reach = match prior {
        Prior::Normal { mean, sd, .. } => (x - mean).abs() <= BEYOND_GAUSSIAN * sd,
        _ => true,
    };
    x >= min - slack && x <= max + slack && within_reach
}

/// A Gaussian has no double-precision density beyond so many standard deviations.
const BEYOND_GAUSSIAN: f64 = 40.0;

/// The kind of each free parameter, and the goals of the chain.
pub fn kinds_and_goals(settings: &Settings) -> (Vec<ParameterKind>, Goals) {
    let kind = |f: &FreeParameter| match (f.parameter, f.prior) {
        (_, Prior::Periodic) => ParameterKind::Periodic,
        (p, prior) if p.is_phase() && prior.bounds().1 - prior.bounds().0 >= 1.0 => ParameterKind::Periodic,
        (p, _) if p.is_amplitude() => ParameterKind::Amplitude,
        _ => ParameterKind::Linear,
    };
    let goals = Goals { rhat: settings.sampler.rhat, ess: settings.sampler.ess };
    (settings.free.iter().map(kind).collect(), goals)
}
