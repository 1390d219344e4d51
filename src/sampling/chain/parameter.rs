//! The summary of one parameter, or of a derived quantity: point estimates, intervals and their convergence.
//!
//! - `ci68`, `ci95`: equal tails (16 to 84 %, 2.5 to 97.5 %); `hdi68`, `hdi95`: the shortest intervals.
//! - A periodic parameter is unwrapped around its mode (cut opposite to it) before anything is computed. Point
//!   estimates are written in [0, 1); intervals stay contiguous (lo < hi) and around the median, so lo may be below 0
//!   or hi above 1.
//! - `upper95`, the 95 % quantile, is there for an amplitude whose posterior touches zero: the lower end of its 95 %
//!   HDI is within a tenth of a standard deviation of 0.

use super::autocorrelation::mean;
use super::convergence::{Diagnostic, ParameterKind};
use super::statistics::{mode, periodic_mode, shortest_interval, unwrap_around, wrap};
use crate::numerics::quantile::quantile;
use serde::{Deserialize, Serialize};

fn is_false(flag: &bool) -> bool {
    !flag
}

/// Fraction of a standard deviation within which an amplitude touches zero.
const TOUCH: f64 = 0.1;

/// Summary of one parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterSummary {
    /// Median.
    pub median: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Mode of a kernel density estimate.
    pub mode: f64,
    /// 16 % and 84 % quantiles.
    pub ci68: [f64; 2],
    /// 2.5 % and 97.5 % quantiles.
    pub ci95: [f64; 2],
    /// Shortest interval of 68 %.
    pub hdi68: [f64; 2],
    /// Shortest interval of 95 %.
    pub hdi95: [f64; 2],
    /// R-hat between ensembles; null where the chain is too short.
    pub rhat: Option<f64>,
    /// Effective sample size; null where the chain is too short.
    pub ess: Option<f64>,
    /// Integrated autocorrelation time (steps); null where the chain is too short.
    pub tau: Option<f64>,
    /// Whether the posterior is close to the prior, so that the median is meaningless.
    #[serde(default, skip_serializing_if = "is_false")]
    pub unconstrained: bool,
    /// Factor on its standard deviation and intervals, where those of the draws are too small.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub widened: Option<f64>,
    /// Upper limit (95 %), for an amplitude whose posterior touches zero.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper95: Option<f64>,
}

impl ParameterSummary {
    /// Multiplies its standard deviation and, about the median, its intervals, which stay within the bounds of its
    /// prior: the draws are moved away from their middle (Shaby 2014, J. Comput. Graph. Stat. 23, 588, open-faced
    /// sandwich adjustment).
    pub fn widen(&mut self, factor: f64, (low, high): (f64, f64)) {
        let median = self.median;
        for interval in [&mut self.ci68, &mut self.ci95, &mut self.hdi68, &mut self.hdi95] {
            *interval = interval.map(|end| (median + factor * (end - median)).clamp(low.min(end), high.max(end)));
        }
        self.sd *= factor;
        self.widened = Some(factor);
    }
}

/// Statistics of the pooled draws of one parameter.
pub(super) fn parameter_summary(
    mut values: Vec<f64>,
    kind: ParameterKind,
    diagnostic: &Diagnostic,
) -> ParameterSummary {
    let effective = diagnostic.ess.unwrap_or(1.0);
    let periodic = kind == ParameterKind::Periodic;
    let around = periodic.then(|| periodic_mode(&values, effective));
    if let Some(centre) = around {
        unwrap_around(&mut values, centre);
    }
    values.sort_unstable_by(f64::total_cmp);
    let median = quantile(&values, 0.5);
    // Whole periods that bring the median, and the intervals with it, to [0, 1).
    let turns = if periodic { (median - wrap(median)).round() } else { 0.0 };
    let point = |x: f64| if periodic { wrap(x) } else { x };
    let shift = |[low, high]: [f64; 2]| [low - turns, high - turns];
    let centre = mean(values.iter());
    let squares = values.iter().map(|x| (x - centre).powi(2)).sum::<f64>();
    let sd = (squares / (values.len() as f64 - 1.0).max(1.0)).sqrt();
    let tails = |share: f64| [quantile(&values, 0.5 - 0.5 * share), quantile(&values, 0.5 + 0.5 * share)];
    let hdi95 = shortest_interval(&values, 0.95);
    let touches_zero = kind == ParameterKind::Amplitude && hdi95[0] <= TOUCH * sd;
    ParameterSummary {
        median: point(median),
        mean: point(centre),
        sd,
        mode: around.unwrap_or_else(|| mode(&values, effective)),
        ci68: shift(tails(0.68)),
        ci95: shift(tails(0.95)),
        hdi68: shift(shortest_interval(&values, 0.68)),
        hdi95: shift(hdi95),
        rhat: diagnostic.rhat,
        ess: diagnostic.ess,
        tau: diagnostic.tau,
        unconstrained: false,
        widened: None,
        upper95: touches_zero.then(|| quantile(&values, 0.95)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_widened_about_the_median_within_the_prior() {
        let values = (0..=1000).map(|k| 80.0 + 0.01 * f64::from(k)).collect();
        let diagnostic = Diagnostic { rhat: None, ess: None, tau: None };
        let mut one = parameter_summary(values, ParameterKind::Linear, &diagnostic);
        let before = one.clone();
        one.widen(1.5, (3.0, 89.0));
        assert_eq!((one.median, one.mean, one.widened), (before.median, before.mean, Some(1.5)));
        let [low, high] = before.ci68;
        let expected = [85.0 - 1.5 * (85.0 - low), (85.0 + 1.5 * (high - 85.0)).min(89.0)];
        assert!(one.ci68.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{:?} {expected:?}", one.ci68);
        assert!((one.sd / before.sd - 1.5).abs() < 1e-12);
        assert_eq!(one.ci95[1], before.ci95[1].max(89.0));
    }
}
