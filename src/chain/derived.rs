//! Quantities that follow from the parameters of a draw: computed for each draw, summarised like parameters.
//!
//! An event that comes back with a period, of which the draws say time and period, is counted from a given time t0: the phase
//! `(T - t0) / P` is unwrapped around its mode, as a periodic parameter is, and the turn is that whose median is nearest to t0. Where
//! period or phase are hardly known the intervals are as wide as that. Left out: the formulas.

use super::convergence::{Diagnostic, ParameterKind};
use super::statistics::{periodic_mode, quantile, unwrap_around};
use super::summary::{ParameterSummary, parameter_summary};
use super::{Chain, Series};
use rayon::prelude::*;
use std::sync::Arc;

/// What a draw says, by its parameters in the order of the chain.
pub type Formula<T> = Arc<dyn Fn(&[f64]) -> T + Send + Sync>;

/// How a quantity follows from the parameters.
#[derive(Clone)]
pub enum Rule {
    /// A number.
    Value(Formula<f64>),
    /// A number that is 0 where the named parameter is, and has an upper limit where that has one.
    Amplitude(String, Formula<f64>),
    /// An event that comes back: one of its times, and the period.
    Event {
        /// The time t0 near which it is wanted.
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
    /// What it is, in a line.
    pub definition: String,
    /// How it is computed.
    pub rule: Rule,
}

/// The same with what a chain says of it.
#[derive(Clone)]
pub struct Settled {
    /// The quantity.
    pub quantity: Derived,
    /// What the chain says.
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
    /// Summarises `quantity` over the steps of `chain` from `discarded` on; `has_limit` says which parameters touch zero.
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

    /// The value at a draw, an event's in the turn of the summary.
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
