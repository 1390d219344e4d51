//! Stand-in for `crate::ensemble::SamplerSettings`, to be dropped when that lands: see `mod.rs`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Size, seed and stopping rule of the chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SamplerSettings {
    /// Number of independent ensembles.
    pub ensembles: usize,
    /// Walkers of each ensemble; even, and at least twice the number of free parameters.
    pub walkers: usize,
    /// Largest number of steps of each walker. May differ when a chain is resumed.
    pub steps: usize,
    /// Seed of all random numbers of the chain.
    pub seed: u64,
    /// Stop once R-hat of every parameter is below this, and ... May differ when a chain is resumed.
    pub rhat: f64,
    /// ... once the effective sample size of every parameter is above this. May differ when a chain is resumed.
    pub ess: f64,
}

impl Default for SamplerSettings {
    fn default() -> Self {
        SamplerSettings { ensembles: 4, walkers: 32, steps: 2000, seed: 1, rhat: 1.01, ess: 1000.0 }
    }
}

/// A setting that makes no sense.
#[derive(Debug, thiserror::Error)]
#[error("sampler.{key}: {problem}")]
pub struct SamplerFault {
    key: &'static str,
    problem: String,
}

impl SamplerSettings {
    /// Checks the settings for a number of free parameters, at least 1.
    ///
    /// # Errors
    /// Naming the first key at fault.
    pub fn validate(&self, free: usize) -> Result<(), SamplerFault> {
        const MOST: usize = 1 << 20;
        let (key, problem) = match self {
            s if !(1..=MOST).contains(&s.ensembles) => ("ensembles", format!("{} must be 1 to {MOST}", s.ensembles)),
            s if s.walkers % 2 == 1 => ("walkers", format!("{} must be even", s.walkers)),
            s if !(2 * free..=MOST).contains(&s.walkers) => {
                let least = 2 * free;
                ("walkers", format!("{} must be {least} (twice the number of free parameters) to {MOST}", s.walkers))
            }
            s if s.steps == 0 => ("steps", "0 must be at least 1".to_string()),
            s if !(s.rhat > 1.0 && s.rhat.is_finite()) => ("rhat", format!("{} must be above 1", s.rhat)),
            s if !(s.ess > 0.0 && s.ess.is_finite()) => ("ess", format!("{} must be above 0", s.ess)),
            _ => return Ok(()),
        };
        Err(SamplerFault { key, problem })
    }
}
