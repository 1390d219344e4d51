//! The nodes for the fit of a paraboloid: those around the highest one.
//!
//! The region grows from the highest node: of all its neighbours, the one of the largest ln L is added next. So it is
//! connected, and contains another maximum only together with the saddle between them. Nodes where the reconstruction
//! failed or could not reach its target are excluded.

use super::{Axis, Grid, Landscape};
use crate::sampling::log_density::Status;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// By default all nodes up to this much above the minimum of chi2 are included, twice the error bars from it: close
/// enough for a paraboloid, far enough that the rounding of ln L (1e-3) is negligible.
pub const DELTA_CHI2: f64 = 4.0;

/// The user's choice of region; by default it reaches to [`DELTA_CHI2`], or as far as a fit needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rule {
    /// Number of nodes.
    pub nodes: Option<usize>,
    /// Largest distance from the highest one in nodes, along any axis; all within, if `nodes` is absent.
    pub radius: Option<usize>,
}

/// A node of the region.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// Index of the node in the grid.
    pub index: usize,
    /// Distance in nodes from the highest one, along each axis; a periodic axis is cut opposite to that one.
    pub offset: Vec<isize>,
    /// chi2 above that of the highest one.
    pub delta_chi2: f64,
}

/// The region around node `centre`, which must be the highest of those that converged. By default it grows until a fit
/// has `enough`.
pub fn region(landscape: &Landscape, centre: usize, rule: Rule, enough: impl Fn(&[Member]) -> bool) -> Vec<Member> {
    let grid = landscape.grid();
    let height = |index: usize| {
        let evaluation = &landscape.nodes().get(index)?.evaluation;
        (evaluation.status == Status::Converged).then_some(evaluation.log_prob)
    };
    let Some(top) = height(centre) else { return Vec::new() };
    let mut region: Vec<Member> = Vec::new();
    // non-negative numbers are ordered as their bits are
    let mut shore = BTreeMap::from([((0u64, centre), vec![0isize; grid.axes.len()])]);
    let mut seen = BTreeSet::from([centre]);
    let mut level = DELTA_CHI2;
    while let Some(((bits, index), offset)) = shore.pop_first() {
        let delta_chi2 = f64::from_bits(bits);
        let full = match rule {
            Rule { nodes: Some(nodes), .. } => region.len() >= nodes,
            Rule { radius: Some(_), .. } => false,
            Rule { .. } => delta_chi2 > level && enough(&region),
        };
        if full {
            break;
        }
        // nodes as high as the last one needed are included
        level = level.max(delta_chi2);
        for (neighbour, offset) in neighbours(grid, index, &offset) {
            let near = rule.radius.is_none_or(|radius| offset.iter().all(|o| o.unsigned_abs() <= radius));
            if near
                && seen.insert(neighbour)
                && let Some(height) = height(neighbour)
            {
                shore.insert(((2.0 * (top - height)).max(0.0).to_bits(), neighbour), offset);
            }
        }
        region.push(Member { index, offset, delta_chi2 });
    }
    region
}

/// The nodes next to node `index`, across corners too, where `offset` is that of this node.
fn neighbours(grid: &Grid, index: usize, offset: &[isize]) -> Vec<(usize, Vec<isize>)> {
    let position = grid.position(index);
    let mut found = vec![(0, Vec::new())];
    for ((axis, &k), &o) in grid.axes.iter().zip(&position).zip(offset) {
        let steps = [-1, 0, 1].map(|step| Some((moved(axis, k, step)?, o + step)));
        // a periodic axis is cut opposite to its start
        let steps = steps.into_iter().flatten().filter(|(_, o)| !axis.is_circle() || 2 * o.unsigned_abs() < axis.nodes);
        let steps: Vec<(usize, isize)> = steps.collect();
        found = found
            .iter()
            .flat_map(|(index, offset): &(usize, Vec<isize>)| {
                let extended = |&(k, o): &(usize, isize)| (index * axis.nodes + k, [&offset[..], &[o]].concat());
                steps.iter().map(extended).collect::<Vec<_>>()
            })
            .collect();
    }
    found.retain(|(neighbour, _)| *neighbour != index);
    found
}

/// The value `step` after value number `k` of an axis, if it exists.
fn moved(axis: &Axis, k: usize, step: isize) -> Option<usize> {
    if axis.is_circle() {
        return Some((k as isize + step).rem_euclid(axis.nodes as isize) as usize);
    }
    k.checked_add_signed(step).filter(|k| *k < axis.nodes)
}
