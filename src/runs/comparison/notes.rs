//! Notes on the comparison of chain and likelihood grid, one sentence each.

use super::{Compared, Comparison};
use crate::sampling::chain::Summary;

/// Fraction of draws outside the grid from which it is reported.
const OUTSIDE: f64 = 0.01;

/// Spacing of an axis, in error bars, above which the trapezoid of a Gaussian is off by more than a part in a thousand.
const COARSE: f64 = 1.6;

/// The notes on `comparison`, whose chain has this `summary`.
pub(super) fn notes(comparison: &Comparison, summary: &Summary) -> Vec<String> {
    let named = |is: &dyn Fn(&Compared) -> Option<f64>, text: &dyn Fn(&str, f64) -> String| -> Vec<String> {
        let value = |name: &String| is(&comparison.parameters[name]).map(|value| text(name, value));
        comparison.names.iter().filter_map(value).collect()
    };
    let mut notes = Vec::new();
    if !comparison.converged {
        notes.push(format!("the chain has not converged: {}", summary.advice.join("; ")));
    }
    if !comparison.fixed_in_landscape.is_empty() {
        let missing = comparison.fixed_in_landscape.join(", ");
        notes.push(format!(
            "{missing} fixed in the grid, sampled in the chain: its conditional intervals are narrower and may be \
            shifted"
        ));
    }
    if comparison.outside > OUTSIDE {
        let percent = |name: &str, share: f64| format!("{name} {:.1} %", 100.0 * share);
        let axes = named(&|one| Some(one.outside).filter(|share| *share > 0.0), &percent).join(", ");
        notes.push(format!(
            "{:.1} % of the draws lie outside the grid ({axes}), whose intervals cover the inside only: widen its axes",
            100.0 * comparison.outside
        ));
    }
    let coarse = named(&|one| one.spacing.filter(|s| *s > COARSE), &|name, s| format!("{name} {s:.1}"));
    if !coarse.is_empty() {
        notes.push(format!(
            "the grid is coarse (node spacing in error bars of the chain: {}): integrals are approximate",
            coarse.join(", ")
        ));
    }
    if comparison.cost.landscape.failed > 0 {
        let failed = comparison.cost.landscape.failed;
        notes.push(format!("{failed} nodes without a value have zero probability in the grid's intervals"));
    }
    let [run, grid] = &comparison.versions;
    if run != grid {
        notes.push(format!("the chain was made by version {run} of the program, the grid by {grid}"));
    }
    notes
}
