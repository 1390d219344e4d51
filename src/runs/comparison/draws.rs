//! The chain's draws on the axes of a likelihood grid: the fraction outside, and the distance of the others from the
//! grid's distribution.

use super::Pair;
use crate::sampling::chain::{ParameterSummary, Summary};
use crate::sampling::landscape::Marginal;
use serde::{Deserialize, Serialize};

/// Kolmogorov's statistic, times the root of the number of draws, that chance exceeds in 5 % of cases.
const KOLMOGOROV95: f64 = 1.358;

/// Distance of two cumulative distributions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distance {
    /// Largest difference at a node of the axis, among the draws that are inside the grid.
    pub largest: f64,
    /// The distance that the finite number of effective draws alone exceeds in 5 % of cases; null where that number is
    /// unknown.
    pub by_chance95: Option<f64>,
}

/// The chain's draws after the burn-in, on the axes of the likelihood grid.
pub(super) struct Draws {
    /// The likelihood grid under the run's prior, axis by axis; `None` where its density is zero everywhere.
    pub marginals: Vec<Option<Marginal>>,
    /// Those inside the grid: sorted, axis by axis.
    inside: Vec<Vec<f64>>,
    /// Fraction outside, for all axes together.
    pub outside: f64,
    /// The same for each axis.
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

    /// Distance of chain and likelihood grid along an axis; `None` where no draw is inside.
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
