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
