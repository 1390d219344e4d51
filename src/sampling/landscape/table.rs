//! Summary of a likelihood grid: its highest node, whether that is on an edge, and the cost; and its paraboloid.

use super::{Axis, Grid, Landscape, Paraboloid, Undefined};
use crate::numerics::text::{aligned, listed};
use crate::sampling::log_density::Status;
use std::collections::BTreeMap;

/// The table. With `truth` (injected values by name) there is a column for it.
pub fn table(landscape: &Landscape, truth: Option<&BTreeMap<String, f64>>) -> String {
    let head = best(landscape, truth).unwrap_or_else(|| "no node gave a likelihood\n".into());
    let count = |is: fn(Status) -> bool| landscape.count(is);
    head + &format!(
        "{} reconstructions ({} beyond the reach of the target chi2, {} failed), {} model applications each in the \
        median\n",
        landscape.nodes().len(),
        count(|status| status == Status::Unreachable),
        count(Status::is_failure),
        landscape.model_applications_median()
    )
}

/// The node of the largest ln L.
fn best(landscape: &Landscape, truth: Option<&BTreeMap<String, f64>>) -> Option<String> {
    let node = landscape.best()?;
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
    let numbers = listed(landscape.numbers().iter().zip(&node.evaluation.numbers));
    text += &format!("largest ln L {:.3} at node {}{numbers}\n", node.evaluation.log_prob, node.index);
    if !edges.is_empty() {
        let keys: Vec<String> = edges.iter().map(|axis| format!("grid.axes.{}", axis.name)).collect();
        text += &format!("on the edge of the grid, the maximum may lie outside: widen {}\n", keys.join(", "));
    }
    Some(text)
}

/// The paraboloid, or why there is none.
pub fn paraboloid_table(
    found: &Result<Paraboloid, Undefined>,
    grid: &Grid,
    truth: Option<&BTreeMap<String, f64>>,
) -> String {
    let paraboloid = match found {
        Ok(paraboloid) => paraboloid,
        Err(undefined) => return format!("{undefined}\n"),
    };
    let mut head = vec!["parameter", "vertex", "error"];
    if truth.is_some() {
        head.insert(1, "truth");
    }
    let mut rows: Vec<Vec<String>> = vec![head.into_iter().map(str::to_owned).collect()];
    for name in grid.names() {
        let Some(one) = paraboloid.parameters.get(name) else { continue };
        let number = |value: f64| format!("{value:.*}", digits(one.error, 2));
        let mut row = vec![name.to_owned(), number(one.vertex), number(one.error)];
        if let Some(truth) = truth {
            row.insert(1, truth.get(name).map_or_else(|| "-".into(), |value| number(*value)));
        }
        rows.push(row);
    }
    let Paraboloid { nodes, delta_chi2, rms_chi2, unreachable, failed, .. } = paraboloid;
    let mut text = format!(
        "paraboloid through the {nodes} nodes up to {delta_chi2:.1} above the lowest chi2, residuals {:.*}\n",
        digits(rms_chi2.max(1e-6), 2),
        rms_chi2
    );
    if unreachable + failed > 0 {
        text += &format!("left out among them: {unreachable} beyond the reach of the target chi2, {failed} failed\n");
    }
    text + &aligned(&rows)
}

/// Decimals that show this many digits of `value`.
fn digits(value: f64, digits: usize) -> usize {
    (digits as f64 - 1.0 - value.log10().floor()).clamp(0.0, 12.0) as usize
}

/// Decimals that show three digits of the spacing.
fn decimals(axis: &Axis) -> usize {
    digits(axis.spacing(), 3)
}
