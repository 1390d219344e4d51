//! The exported content: a run's chain, and the name, unit, prior and injected value of every parameter.
//!
//! The omitted steps are those of `summary.json`.

use super::ExportError;
use crate::model::{FreeParameter, Prior, Quoted};
use crate::runs::manifest::{Manifest, RunSummary, kinds_and_goals};
use crate::runs::run::{CHAIN, read_chain};
use crate::sampling::chain::{Chain, Settled, statistics::unwrap_around};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// A run, read for export.
#[derive(Clone, Debug)]
pub struct Contents {
    /// The sampled parameters, in the order of the chain.
    pub parameters: Vec<Quantity>,
    /// Derived quantities, draw by draw.
    pub derived: Vec<DerivedQuantity>,
    /// All complete steps.
    pub chain: Chain,
    /// Its file.
    pub path: PathBuf,
    /// Its summary by `analyse`.
    pub summary: RunSummary,
    /// Version of the program that began the run.
    pub version: String,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// SHA-256 (hex) of the part of the config that determines the posterior and the chain.
    pub config_sha256: String,
    /// The config with all defaults filled in.
    pub config: Value,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// A sampled parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// Name.
    pub name: String,
    /// Symbol, in LaTeX without dollars.
    pub latex: &'static str,
    /// Unit; `1` for a ratio.
    pub unit: &'static str,
    /// The prior, as in the config.
    pub prior: Value,
    /// Bounds of the prior, where they are finite.
    pub bounds: [Option<f64>; 2],
    /// Mode of the posterior, around which a periodic parameter (period 1) is unwrapped; `None` for others.
    pub centre: Option<f64>,
    /// Injected value, for simulated data.
    pub injected: Option<f64>,
    /// Factor by which `summary.json` has larger uncertainties than the draws.
    pub sigma_factor: Option<f64>,
}

/// A quantity derived from the parameters of a draw.
#[derive(Clone, Debug)]
pub struct DerivedQuantity {
    /// The quantity, with its values at draws.
    pub settled: Settled,
    /// Symbol, in LaTeX without dollars.
    pub latex: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Injected value, for simulated data.
    pub injected: Option<f64>,
}

impl DerivedQuantity {
    /// Name.
    pub fn name(&self) -> &str {
        &self.settled.quantity.name
    }
}

impl Contents {
    /// Reads the run in a folder; it may still be growing.
    ///
    /// # Errors
    /// [`ExportError`]: no run there, or one without a complete step.
    pub fn read(run: &Path) -> Result<Self, ExportError> {
        let manifest = Manifest::read(run)?;
        let settings = manifest.settings(run)?;
        let path = run.join(CHAIN);
        let chain = read_chain(run, &manifest)?;
        let (kinds, _) = kinds_and_goals(&settings);
        let (summary, settled) = manifest
            .summarise(&settings, &chain)
            .map_err(|source| ExportError::Chain { path: path.clone(), source })?;
        let quantity = |(free, kind): (&FreeParameter, &crate::sampling::chain::ParameterKind)| {
            let name = free.parameter.name();
            let periodic = *kind == crate::sampling::chain::ParameterKind::Periodic;
            Quantity {
                name: name.to_owned(),
                latex: free.parameter.latex(),
                unit: free.parameter.unit(),
                prior: json!(free.prior),
                bounds: bounds(&free.prior),
                centre: periodic.then(|| summary.parameters[name].mode),
                injected: manifest.origin.truth.as_ref().and_then(|truth| truth.get(name).copied()),
                sigma_factor: manifest.origin.reference.widening(free.parameter),
            }
        };
        let parameters = settings.free.iter().zip(&kinds).map(quantity).collect();
        let derived = |settled: Settled| {
            let quantity = Quoted::from_name(&settled.quantity.name)?;
            let injected = manifest.true_quantity(&settings, quantity.name(), settled.summary.median);
            Some(DerivedQuantity { settled, latex: quantity.latex(), unit: quantity.quantity.unit(), injected })
        };
        let derived = settled.into_iter().filter_map(derived).collect();
        let origin = manifest.origin;
        Ok(Contents {
            parameters,
            derived,
            chain,
            path,
            summary,
            version: origin.version,
            data_sha256: origin.data_sha256,
            config_sha256: origin.config_sha256,
            config: origin.config,
            seed: manifest.seed,
        })
    }

    /// Names of the parameters.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.parameters.iter().map(|one| one.name.as_str())
    }

    /// Names of the other values of a draw.
    pub fn numbers(&self) -> impl Iterator<Item = &str> {
        self.chain.shape().numbers.iter().map(String::as_str)
    }

    /// Priors by name, as JSON text.
    pub fn priors(&self) -> String {
        Value::from_iter(self.parameters.iter().map(|one| (one.name.clone(), one.prior.clone()))).to_string()
    }

    /// Injected values by name, as JSON text; `None` for data that were not simulated.
    pub fn injected(&self) -> Option<String> {
        let value = |one: &Quantity| Some((one.name.clone(), Value::from(one.injected?)));
        Some(self.parameters.iter().map(value).collect::<Option<Value>>()?.to_string())
    }

    /// Factors on uncertainties by parameter, as JSON; `None` where there are none.
    pub fn sigma_factors(&self) -> Option<String> {
        let value = |one: &Quantity| Some((one.name.clone(), Value::from(one.sigma_factor?)));
        let factors: Map<String, Value> = self.parameters.iter().filter_map(value).collect();
        (!factors.is_empty()).then(|| Value::from(factors).to_string())
    }

    /// What to know before the draws are used.
    pub fn notes(&self) -> Vec<String> {
        let unsettled = "the chain has not converged, `dimcmc analyse` says what to do".to_owned();
        let of = |one: &Quantity| Some(format!("{} times for {}", one.sigma_factor?, one.name));
        let factors: Vec<String> = self.parameters.iter().filter_map(of).collect();
        let factors = (!factors.is_empty()).then(|| {
            format!("uncertainties in summary.json are larger than the scatter of the draws: {}", factors.join(", "))
        });
        (!self.summary.converged).then_some(unsettled).into_iter().chain(factors).collect()
    }
}

impl Quantity {
    /// The value for programs without periodic parameters: the representative nearest to the mode.
    pub fn unwrapped(&self, value: f64) -> f64 {
        let mut values = [value];
        if let Some(centre) = self.centre {
            unwrap_around(&mut values, centre);
        }
        values[0]
    }

    /// Bounds of the result of [`Quantity::unwrapped`].
    pub fn unwrapped_bounds(&self) -> [Option<f64>; 2] {
        self.centre.map_or(self.bounds, |centre| [Some(centre - 0.5), Some(centre + 0.5)])
    }
}

fn bounds(prior: &Prior) -> [Option<f64>; 2] {
    let (min, max) = prior.bounds();
    [min, max].map(|bound| Some(bound).filter(|x| x.is_finite()))
}
