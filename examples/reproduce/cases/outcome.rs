//! The outcome of a case: three estimates of the same orbit, with their costs.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A value with its 68 % interval; that of a periodic parameter may leave [0, 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its interval.
    pub ci68: [f64; 2],
    /// Its 95 % interval; for an estimate with an error bar, two of them on each side.
    pub ci95: [f64; 2],
}

/// One method for the orbit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Route {
    /// The parameters by name; empty where the method failed.
    pub parameters: BTreeMap<String, Estimate>,
    /// Number of reconstructions, without the search for the reference.
    pub reconstructions: usize,
    /// Seconds; unknown where it was stopped and resumed.
    pub seconds: Option<f64>,
    /// A remark: why it failed, or that a chain did not converge.
    pub note: Option<String>,
}

/// The outcome of a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Why there is no result at all.
    pub failed: Option<String>,
    /// What was injected, all parameters by name.
    pub truth: BTreeMap<String, f64>,
    /// Target chi2 per datum; above the config's where that could not be reached.
    pub chi2_target: Option<f64>,
    /// Multiplier of chi2 / 2 in the image at the best orbit, times the number of data.
    pub lambda_data: Option<f64>,
    /// Spot coverage of that image.
    pub spottedness: Option<f64>,
    /// Reconstructions of the search for it, which grid and chain share.
    pub search_reconstructions: usize,
    /// Seconds of that search.
    pub search_seconds: f64,
    /// Grid and paraboloid.
    pub grid: Option<Route>,
    /// Chain.
    pub chain: Option<Route>,
    /// The 95 % upper limit of K by the chain, where K is compatible with 0 (km/s).
    pub k_upper95_kms: Option<f64>,
    /// Periodogram: its best orbit.
    pub periodogram: Option<Route>,
    /// Its false-alarm probability.
    pub false_alarm: Option<f64>,
}

/// Ends of the names of columns with the numbers of an estimate.
pub const ENDS: [&str; 5] = ["median", "low68", "high68", "low95", "high95"];

/// Fraction of `of` and its binomial error: that of the fraction with one more of either kind, which is not 0 where all
/// are alike.
pub fn share(count: usize, of: usize) -> [f64; 2] {
    let n = of.max(1) as f64;
    let p = (count as f64 + 1.0) / (n + 2.0);
    [count as f64 / n, (p * (1.0 - p) / n).sqrt()].map(|x| (1000.0 * x).round() / 1000.0)
}

impl Estimate {
    /// A value with a Gaussian error bar.
    pub fn gaussian(value: f64, sigma: f64) -> Self {
        let around = |n: f64| [value - n * sigma, value + n * sigma];
        Estimate { value, ci68: around(1.0), ci95: around(2.0) }
    }

    /// The values of the columns [`ENDS`], NaN where there is no estimate.
    pub fn numbers(estimate: Option<&Self>) -> [f64; 5] {
        estimate.map_or([f64::NAN; 5], |e| [e.value, e.ci68[0], e.ci68[1], e.ci95[0], e.ci95[1]])
    }

    /// Half the width of the 68 % interval.
    pub fn error(&self) -> f64 {
        0.5 * (self.ci68[1] - self.ci68[0])
    }
}

impl Outcome {
    /// The methods used, by name.
    pub fn routes(&self) -> impl Iterator<Item = (&'static str, &Route)> {
        let all = [("grid", &self.grid), ("chain", &self.chain), ("periodogram", &self.periodogram)];
        all.into_iter().filter_map(|(name, route)| Some((name, route.as_ref()?)))
    }

    /// The chain's estimate of a parameter.
    pub fn by_chain(&self, name: &str) -> Option<&Estimate> {
        self.chain.as_ref()?.parameters.get(name)
    }

    /// Whether the injected value is inside the chain's interval of 68 (level 0) or 95 % (1); a phase in any cycle. A
    /// star without a result counts as missed.
    pub fn is_covered(&self, name: &str, level: usize) -> bool {
        let (Some(one), Some(truth)) = (self.by_chain(name), self.truth.get(name)) else { return false };
        let [low, high] = [one.ci68, one.ci95][level];
        let turns: &[f64] = if name == "phi" { &[-1.0, 0.0, 1.0] } else { &[0.0] };
        turns.iter().any(|turn| (low..=high).contains(&(truth + turn)))
    }

    /// Value minus the injected one; for a phase, the shorter way round.
    pub fn deviation(&self, name: &str, estimate: &Estimate) -> Option<f64> {
        let apart = estimate.value - self.truth.get(name)?;
        Some(if name == "phi" { apart - apart.round() } else { apart })
    }
}
