//! The chain's draws on the axes of a landscape: how many are outside, and how far the others are from the landscape's
//! distribution.

use super::Pair;
use crate::sampling::chain::{ParameterSummary, Summary};
use crate::sampling::landscape::Marginal;
use serde::{Deserialize, Serialize};

/// Kolmogorov's statistic, times the root of the number of draws, that chance exceeds once in twenty times.
const KOLMOGOROV95: f64 = 1.358;

/// How far apart two cumulative distributions are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distance {
    /// Largest difference at a node of the axis, among the draws that are inside the grid.
    pub largest: f64,
    /// What the finite number of effective draws alone exceeds once in twenty times; null where that number is unknown.
    pub by_chance95: Option<f64>,
}

/// The chain's draws after the burn-in, on the axes of the landscape.
pub(super) struct Draws {
    /// The landscape under the run's prior, axis by axis; `None` where it is nowhere possible.
    pub marginals: Vec<Option<Marginal>>,
    /// Of those inside the grid: sorted, axis by axis.
    inside: Vec<Vec<f64>>,
    /// Share outside, of all axes together.
    pub outside: f64,
    /// Of each.
    pub outside_axis: Vec<f64>,
}

impl Draws {
    pub fn of(pair: &Pair, summary: &Summary) -> Self {
        let grid = &pair.header.grid;
        let marginal = |axis: usize| Marginal::of(&pair.landscape, axis, &|i, x| pair.prior(i, x));
        let marginals: Vec<Option<Marginal>> = (0..grid.axes.len()).map(marginal).collect();
        let columns: Vec<Option<usize>> =
            grid.names().map(|name| summary.names.iter().position(|sampled| sampled == name)).collect();
        let kept = &pair.chain.records()[summary.discarded_steps * pair.chain.shape().size()..];
        let mut inside = vec![Vec::new(); grid.axes.len()];
        let mut missed = vec![0; grid.axes.len()];
        for record in kept {
            let place =
                |(axis, column): (usize, &Option<usize>)| marginals[axis].as_ref()?.place(record.theta[(*column)?]);
            let places: Vec<Option<f64>> = columns.iter().enumerate().map(place).collect();
            missed.iter_mut().zip(&places).for_each(|(count, place)| *count += usize::from(place.is_none()));
            if let Some(places) = places.into_iter().collect::<Option<Vec<f64>>>() {
                inside.iter_mut().zip(places).for_each(|(axis, x)| axis.push(x));
            }
        }
        inside.iter_mut().for_each(|axis| axis.sort_unstable_by(f64::total_cmp));
        let share = |count: usize| count as f64 / kept.len() as f64;
        let outside = share(kept.len() - inside.first().map_or(0, Vec::len));
        Draws { marginals, inside, outside, outside_axis: missed.into_iter().map(share).collect() }
    }

    /// How far apart chain and landscape are along an axis; `None` where no draw is inside.
    pub fn distance(&self, axis: usize, chain: &ParameterSummary) -> Option<Distance> {
        let (marginal, draws) = (self.marginals[axis].as_ref()?, &self.inside[axis]);
        let share = |x: f64| draws.partition_point(|draw| *draw <= x) as f64 / draws.len() as f64;
        let apart = |x: f64| (share(x) - marginal.cumulative(x)).abs();
        (!draws.is_empty()).then(|| Distance {
            largest: marginal.nodes().into_iter().map(apart).fold(0.0, f64::max),
            by_chance95: chain.ess.map(|ess| KOLMOGOROV95 / ess.sqrt()),
        })
    }
}
