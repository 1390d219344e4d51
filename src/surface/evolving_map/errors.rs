//! Uncertainties of the field: standard errors of amplitude, slope and lifetime from the second derivatives of ln Z and
//! its priors, the jitter held (Laplace's approximation; MacKay 2003, chapter 27).
//!
//! Each field has its own maps. ln Z is accurate to a few hundredths only, and so differences span about a standard
//! error.

use super::climb::{assumed_at, limits, place};
use super::fit::takes_minutes;
use super::{Fitted, Known, Marginal};
use crate::model::Parameter;
use crate::surface::FieldErrors;
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, Vector4};
use std::sync::Arc;

/// Usual steps in ln amplitude, slope and ln lifetime.
const STEP: [f64; 3] = [0.15, 0.4, 0.3];

/// Steps are a standard error, but between a third of a usual one and this many.
const MOST: f64 = 2.0;

/// A step is at most this fraction of the width between the bounds.
const PART: f64 = 0.4;

/// Smaller second derivatives for a step of 1 are the noise of ln Z: the profiles do not constrain that parameter.
const LEAST: f64 = 0.3;

/// Indices of the field's parameters, with the steps along them.
type Steps = Vec<(usize, f64)>;

impl Fitted {
    /// Those of parameters that are not given, not at a bound and constrained, all of these free together; none where
    /// they would take minutes.
    pub(super) fn errors(&self, imager: &Imager, known: &Known) -> FieldErrors {
        let here = &self.marginal;
        if takes_minutes(imager, &here.basis) {
            return FieldErrors::default();
        }
        let (top, free, limits) = (place(&here.assumed), known.free(&here.assumed), limits(known));
        let is_at_bound = |i: &usize| self.at_bounds.contains(&Parameter::FIELD[*i].name());
        let within = |i: usize, step: f64| (i, step.min(PART * (limits[i].1 - limits[i].0)));
        let all = (0..3).filter(|i| free[*i] && !is_at_bound(i)).map(|i| within(i, STEP[i]));
        let usual: Steps = all.filter(|(_, step)| *step > 0.0).collect();
        // once, before two threads need it
        here.settled.evidence.explained();
        let height = |steps: &Steps, moves: &[f64]| {
            let mut to = top;
            for ((i, step), times) in steps.iter().zip(moves) {
                // next to a bound the differences are around a point that leaves room for them
                to[*i] = top[*i].clamp(limits[*i].0 + step, limits[*i].1 - step) + times * step;
            }
            let (there, design) = (assumed_at(to, &here.assumed), Arc::clone(&here.design));
            Marginal::new(imager, &here.basis, design, here.values, there, Some(here)).ok().map(|of| known.height(&of))
        };
        let found = || {
            let first = information(usual.len(), |moves| height(&usual, moves), false)?;
            // one standard error each
            let error = |(k, (i, step)): (usize, &(usize, f64))| {
                let errors = if first[(k, k)] > 0.0 { first[(k, k)].sqrt().recip() } else { MOST };
                within(*i, step * errors.clamp(1.0 / 3.0, MOST))
            };
            let steps: Steps = usual.iter().enumerate().map(error).collect();
            let all = information(steps.len(), |moves| height(&steps, moves), true)?;
            Some(of(&steps, &all, &top))
        };
        found().unwrap_or_default()
    }
}

/// Minus the second derivatives of a `height` in that many parameters, in steps, including mixed ones where they are
/// needed; `None` where it is undefined somewhere.
fn information(numbers: usize, height: impl Fn(&[f64]) -> Option<f64> + Sync, mixed: bool) -> Option<DMatrix<f64>> {
    let middle = height(&vec![0.0; numbers])?;
    // the two heights on both sides, along one parameter or along two together. With many profiles each has hundreds of
    // megabytes of maps: no more than two at a time
    let sum = |i: usize, j: usize| {
        let side = |sign: f64| {
            let mut moves = vec![0.0; numbers];
            [i, j].into_iter().for_each(|k| moves[k] = sign);
            height(&moves)
        };
        let (above, below) = rayon::join(|| side(1.0), || side(-1.0));
        Some(above? + below?)
    };
    let mut found = DMatrix::zeros(numbers, numbers);
    for i in 0..numbers {
        found[(i, i)] = 2.0 * middle - sum(i, i)?;
        for j in (0..i).filter(|_| mixed) {
            let both = middle - 0.5 * (found[(i, i)] + found[(j, j)] + sum(i, j)?);
            (found[(i, j)], found[(j, i)]) = (both, both);
        }
    }
    Some(found)
}

/// The uncertainties by the second derivatives in steps, for a field at `top`; without those of unconstrained
/// parameters.
fn of(steps: &Steps, information: &DMatrix<f64>, top: &Vector4<f64>) -> FieldErrors {
    let (told, open): (Vec<usize>, Vec<usize>) = (0..steps.len()).partition(|k| information[(*k, *k)] > LEAST);
    let unconstrained = open.iter().map(|k| Parameter::FIELD[steps[*k].0].name().to_owned()).collect();
    let none = FieldErrors { unconstrained, ..FieldErrors::default() };
    if told.is_empty() {
        return none;
    }
    let factor = information.select_rows(&told).select_columns(&told).cholesky();
    let Some(covariance) = factor.map(|factor| factor.inverse()) else { return none };
    let sigma = |i: usize| {
        let at = told.iter().position(|k| steps[*k].0 == i)?;
        Some(covariance[(at, at)].sqrt() * steps[told[at]].1)
    };
    // the derivatives apply to ln amplitude and ln lifetime
    let of_logarithm = |i: usize| Some(sigma(i)? * top[i].exp());
    FieldErrors {
        sigma_spot_amplitude: of_logarithm(0),
        sigma_spot_slope: sigma(1),
        sigma_spot_lifetime_d: of_logarithm(2),
        ..none
    }
}

#[cfg(test)]
mod tests;
