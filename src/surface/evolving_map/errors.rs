//! How well the profiles tell the field: standard errors of amplitude, slope and lifetime from the second derivatives
//! of ln Z and its priors, the jitter held (Laplace's approximation; MacKay 2003, chapter 27).
//!
//! Each field has its own maps. Differences span about a standard error, as ln Z is known to a few hundredths only.

use super::climb::{assumed_at, limits, place};
use super::fit::takes_minutes;
use super::{Fitted, Known, Marginal};
use crate::surface::FieldErrors;
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, Vector4};
use rayon::prelude::*;
use std::sync::Arc;

/// Steps in ln amplitude, slope and ln lifetime.
const STEP: [f64; 3] = [0.15, 0.4, 0.3];

impl Fitted {
    /// Those of what is not known beforehand and lies within its bounds; none where they would take minutes, or where
    /// ln Z has no maximum here.
    pub(super) fn errors(&self, imager: &Imager, known: &Known) -> FieldErrors {
        let here = &self.marginal;
        let (from, free, limits) = (place(&here.assumed), known.free(&here.assumed), limits(known));
        let has_room = |i: &usize| from[*i] - STEP[*i] >= limits[*i].0 && from[*i] + STEP[*i] <= limits[*i].1;
        let told: Vec<usize> = (0..3).filter(|i| free[*i]).filter(has_room).collect();
        if told.is_empty() || takes_minutes(imager, &here.basis) {
            return FieldErrors::default();
        }
        let height = |moves: &[f64]| {
            let mut to: Vector4<f64> = from;
            told.iter().zip(moves).for_each(|(i, steps)| to[*i] += steps * STEP[*i]);
            let there = assumed_at(to, &here.assumed);
            let design = Arc::clone(&here.design);
            Marginal::new(imager, &here.basis, design, here.values, there, Some(here)).ok().map(|of| known.height(&of))
        };
        let Some(information) = information(told.len(), known.height(here), height) else {
            return FieldErrors::default();
        };
        let Some(covariance) = information.cholesky().map(|factor| factor.inverse()) else {
            return FieldErrors::default();
        };
        let sigma = |i: usize| {
            let at = told.iter().position(|told| *told == i)?;
            let sigma = covariance[(at, at)].sqrt() * STEP[i];
            // ln amplitude and ln lifetime
            Some(if i == 1 { sigma } else { sigma * from[i].exp() })
        };
        FieldErrors { sigma_spot_amplitude: sigma(0), sigma_spot_slope: sigma(1), sigma_spot_lifetime_d: sigma(2) }
    }
}

/// Minus the second derivatives of a `height` of which this is `here`, in steps; `None` where it is unknown beside.
fn information(numbers: usize, here: f64, height: impl Fn(&[f64]) -> Option<f64> + Sync) -> Option<DMatrix<f64>> {
    let pairs: Vec<(usize, usize)> = (0..numbers).flat_map(|i| (0..=i).map(move |j| (i, j))).collect();
    // the two heights on both sides, along one number or along two together
    let sums: Vec<f64> = pairs
        .par_iter()
        .map(|(i, j)| {
            let side = |sign: f64| {
                let mut moves = vec![0.0; numbers];
                [*i, *j].iter().for_each(|k| moves[*k] = sign);
                height(&moves)
            };
            Some(side(1.0)? + side(-1.0)?)
        })
        .collect::<Option<_>>()?;
    let sum = |i: usize, j: usize| sums[pairs.iter().position(|pair| *pair == (i.max(j), i.min(j))).expect("a pair")];
    Some(DMatrix::from_fn(numbers, numbers, |i, j| match i == j {
        true => 2.0 * here - sum(i, i),
        false => 0.5 * (sum(i, i) + sum(j, j) - sum(i, j)) - here,
    }))
}

#[cfg(test)]
mod tests;
