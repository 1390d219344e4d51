//! The landscape in a few lines: where it is highest, whether that is on an edge, and what it cost.

use super::{Axis, Landscape};
use crate::log_density::Status;
use crate::text::aligned;
use std::collections::BTreeMap;

/// The table. With `truth` (injected values by name) there is a column for it.
pub fn table(landscape: &Landscape, truth: Option<&BTreeMap<String, f64>>) -> String {
    let head = best(landscape, truth).unwrap_or_else(|| "no node gave a likelihood\n".into());
    let count = |is: fn(Status) -> bool| landscape.count(is);
    head + &format!(
        "{} reconstructions ({} beyond the reach of the target chi2, {} failed), {} passes each in the median\n",
        landscape.nodes().len(),
        count(|status| status == Status::Unreachable),
        count(Status::is_failure),
        landscape.passes_median()
    )
}

/// Where ln L is largest.
fn best(landscape: &Landscape, truth: Option<&BTreeMap<String, f64>>) -> Option<String> {
    let (node, values) = landscape.best()?;
    let edges = landscape.grid().edges(node.index);
    let mut head = vec!["parameter", "at largest ln L", "spacing", "first", "last", "on an edge"];
    if truth.is_some() {
        head.insert(1, "truth");
    }
    let mut rows: Vec<Vec<String>> = vec![head.into_iter().map(str::to_owned).collect()];
    for (axis, value) in landscape.grid().axes.iter().zip(&node.theta) {
        let number = |value: f64| format!("{value:.*}", decimals(axis));
        let last = axis.value(axis.nodes - 1);
        let on_edge = if edges.contains(&axis) { "yes" } else { "no" };
        let mut row =
            vec![axis.name.clone(), number(*value), number(axis.spacing()), number(axis.value(0)), number(last)];
        row.push(on_edge.into());
        if let Some(truth) = truth {
            row.insert(1, truth.get(&axis.name).map_or_else(|| "-".into(), |value| number(*value)));
        }
        rows.push(row);
    }
    let mut text = aligned(&rows);
    text += &format!(
        "largest ln L {:.3} at node {}, spottedness {:.5}, chi2 {:.2}\n",
        values.log_likelihood, node.index, values.spottedness, values.chi2
    );
    if !edges.is_empty() {
        let keys: Vec<String> = edges.iter().map(|axis| format!("grid.axes.{}", axis.name)).collect();
        text += &format!("on the edge of the grid, the maximum may lie outside: widen {}\n", keys.join(", "));
    }
    Some(text)
}

/// Decimals that show three digits of the spacing.
fn decimals(axis: &Axis) -> usize {
    (2.0 - axis.spacing().log10().floor()).clamp(0.0, 12.0) as usize
}
