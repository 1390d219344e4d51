//! Quantities that follow from the parameters of a draw: computed for each draw, summarised like parameters.
//!
//! A recurring event, whose time and period the draws give, is counted from a given time t0: the phase `(T - t0) / P`
//! is unwrapped around its mode, as a periodic parameter is, and the cycle is that whose median is nearest to t0.
//! Poorly constrained periods or phases give wide intervals.

use super::convergence::{Diagnostic, ParameterKind};
use super::parameter::{ParameterSummary, parameter_summary};
use super::statistics::{periodic_mode, unwrap_around};
use super::{Chain, Series};
use crate::numerics::quantile::quantile;
use rayon::prelude::*;
use std::sync::Arc;

/// A function of a draw's parameters in the order of the chain.
pub type Formula<T> = Arc<dyn Fn(&[f64]) -> T + Send + Sync>;

/// The derivation of a quantity from the parameters.
#[derive(Clone)]
pub enum Rule {
    /// A number.
    Value(Formula<f64>),
    /// A number that is 0 where the named parameter is, and has an upper limit where that has one.
    Amplitude(String, Formula<f64>),
    /// A recurring event: one of its times, and the period.
    Event {
        /// The requested time t0 near it.
        near: f64,
        /// Time and period.
        time_and_period: Formula<[f64; 2]>,
    },
}

/// A quantity that follows from the parameters.
#[derive(Clone)]
pub struct Derived {
    /// Its name.
    pub name: String,
    /// Its description in one line, where the name is not enough.
    pub definition: Option<String>,
    /// How it is computed.
    pub rule: Rule,
}

/// The same with its summary by a chain.
#[derive(Clone)]
pub struct Settled {
    /// The quantity.
    pub quantity: Derived,
    /// Its summary.
    pub summary: ParameterSummary,
    /// Of an event: phase from t0, around which it is unwrapped.
    centre: f64,
}

impl std::fmt::Debug for Settled {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.debug_struct("Settled").field("name", &self.quantity.name).field("summary", &self.summary).finish()
    }
}

impl Settled {
    /// Summarises `quantity` over the steps of `chain` from `discarded` on; `has_limit` says which parameters touch
    /// zero.
    pub(super) fn of(chain: &Chain, discarded: usize, quantity: Derived, has_limit: &dyn Fn(&str) -> bool) -> Self {
        let series = |formula: &dyn Fn(&[f64]) -> f64| chain.series_of(discarded, |record| formula(&record.theta));
        match &quantity.rule {
            Rule::Value(formula) => {
                let summary = plain(series(&**formula));
                Settled { quantity, summary, centre: 0.0 }
            }
            Rule::Amplitude(name, formula) => {
                let draws = series(&**formula);
                let limit = has_limit(name).then(|| {
                    let mut values: Vec<f64> = draws.iter().flatten().flatten().copied().collect();
                    values.sort_unstable_by(f64::total_cmp);
                    quantile(&values, 0.95)
                });
                let summary = ParameterSummary { upper95: limit, ..plain(draws) };
                Settled { quantity, summary, centre: 0.0 }
            }
            Rule::Event { near, time_and_period } => {
                let phases = series(&|theta| phase(time_and_period(theta), *near));
                let periods = series(&|theta| time_and_period(theta)[1]);
                let (centre, summary) = event(phases, &periods, *near);
                Settled { quantity, summary, centre }
            }
        }
    }

    /// The value at a draw; for an event in the cycle of the summary.
    pub fn value(&self, theta: &[f64]) -> f64 {
        match &self.quantity.rule {
            Rule::Value(formula) | Rule::Amplitude(_, formula) => formula(theta),
            Rule::Event { near, time_and_period } => {
                let [time, period] = time_and_period(theta);
                let mut phase = [phase([time, period], *near)];
                unwrap_around(&mut phase, self.centre);
                near + period * phase[0]
            }
        }
    }
}

/// Summaries of the quantities, in their order.
pub(super) fn settle(
    chain: &Chain,
    discarded: usize,
    quantities: Vec<Derived>,
    has_limit: &(dyn Fn(&str) -> bool + Sync),
) -> Vec<Settled> {
    quantities.into_par_iter().map(|one| Settled::of(chain, discarded, one, has_limit)).collect()
}

fn plain(series: Series) -> ParameterSummary {
    let values = series.iter().flatten().flatten().copied().collect();
    let diagnostic = Diagnostic::of(series, ParameterKind::Linear);
    parameter_summary(values, ParameterKind::Linear, &diagnostic)
}

fn phase([time, period]: [f64; 2], near: f64) -> f64 {
    (time - near) / period
}

/// The phase around which an event is unwrapped, and the summary of its times.
fn event(phases: Series, periods: &Series, near: f64) -> (f64, ParameterSummary) {
    let mut values: Vec<f64> = phases.iter().flatten().flatten().copied().collect();
    let periods: Vec<f64> = periods.iter().flatten().flatten().copied().collect();
    let diagnostic = Diagnostic::of(phases, ParameterKind::Periodic);
    let mode = periodic_mode(&values, diagnostic.ess.unwrap_or(1.0));
    let from_near = |values: &mut [f64], centre: f64| {
        unwrap_around(values, centre);
        let times = values.iter().zip(&periods).map(|(phase, period)| phase * period).collect();
        parameter_summary(times, ParameterKind::Linear, &diagnostic)
    };
    let middle = [0.0, -1.0].map(|turn| {
        let centre = mode + turn;
        (centre, from_near(&mut values, centre))
    });
    let [first, second] = middle;
    let (centre, one) = if second.1.median.abs() < first.1.median.abs() { second } else { first };
    let ends = |[low, high]: [f64; 2]| [near + low, near + high];
    let summary = ParameterSummary {
        median: near + one.median,
        mean: near + one.mean,
        mode: near + one.mode,
        ci68: ends(one.ci68),
        ci95: ends(one.ci95),
        hdi68: ends(one.hdi68),
        hdi95: ends(one.hdi95),
        ..one
    };
    (centre, summary)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One ensemble with one walker per value, so that order does not matter.
    fn series(values: &[f64]) -> Series {
        vec![vec![values.to_vec()]]
    }

    /// Normal scores of even quantiles are not needed: values spread evenly over +- `half`.
    fn spread(centre: f64, half: f64, count: usize) -> Vec<f64> {
        (0..count).map(|k| centre + half * (2.0 * (k as f64 + 0.5) / count as f64 - 1.0)).collect()
    }

    /// Times cluster at their place, whatever the cycle of each draw, on the nearer side of t0.
    #[test]
    fn an_event_is_taken_in_the_turn_next_to_the_middle() {
        for (phase, time) in [(0.3, 103.0), (7.3, 103.0), (-2.7, 103.0), (0.48, 104.8), (0.53, 95.3), (-0.4, 96.0)] {
            let phases: Vec<f64> =
                spread(phase, 0.04, 801).iter().enumerate().map(|(k, x)| x + (k % 3) as f64).collect();
            let (centre, summary) = event(series(&phases), &series(&[10.0; 801]), 100.0);
            assert!((summary.median - time).abs() < 0.01, "{phase}: {summary:?}");
            assert!((100.0 + 10.0 * centre - time).abs() < 0.3 && (summary.sd - 0.8 / 12f64.sqrt()).abs() < 0.01);
            assert!(summary.ci68[0] > time - 0.4 && summary.ci68[1] < time + 0.4);
            assert!((summary.ci95[1] - summary.ci95[0] - 0.95 * 0.8).abs() < 0.01, "{summary:?}");
        }
    }

    /// A poorly constrained period does not spread the times more than their phases do.
    #[test]
    fn an_uncertain_period_and_an_unknown_phase() {
        let periods: Vec<f64> = (0..4001).map(|k| 2.0 + 16.0 * ((k * 7919) % 4001) as f64 / 4001.0).collect();
        let times = spread(101.0, 0.1, 4001);
        let phases: Vec<f64> = times.iter().zip(&periods).map(|(t, p)| phase([*t + 5.0 * p, *p], 100.0)).collect();
        let (_, known) = event(series(&phases), &series(&periods), 100.0);
        assert!((known.median - 101.0).abs() < 0.01 && known.ci95[0] > 100.8 && known.ci95[1] < 101.2, "{known:?}");
        let anywhere = spread(0.5, 0.5, 4001);
        let (_, unknown) = event(series(&anywhere), &series(&vec![10.0; 4001]), 100.0);
        assert!((unknown.ci95[1] - unknown.ci95[0] - 9.5).abs() < 0.1, "{unknown:?}");
    }
}
