//! Periodograms without a planet: the highest peak of many draws of the gradient.
//!
//! Without a planet the gradient has mean 0 and the information as covariance: noise and residual (unresolved-spot)
//! noise. `Delta ln L(P) = |L^-1 X' gradient|^2 / 2` with `A = L L'` at every trial period. The whitened rows of all
//! periods are one matrix, times a square root of the information, times the deviates. Each block of draws has its own
//! stream of random numbers, so that the number of threads does not matter.

use super::jitter::{Jitters, Level, root};
use super::orbits::{Trial, design, scan};
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Draws per matrix product and per stream of random numbers.
const DRAWS: usize = 250;

/// Rows, two per trial period, whose product with the draws is held in memory at once.
const ROWS: usize = 1024;

/// The highest Delta ln L over the trial frequencies of each of `draws` gradients, with the best jitter without an
/// orbit and with each.
pub fn maxima(jitters: &Jitters, frequencies: &[f64], draws: usize, seed: u64) -> Vec<f64> {
    heights(jitters, &|level, root| whitened(level, root, frequencies), highest, draws, seed)
}

/// Delta ln L of the amplitude of the velocities `unit` for each of `draws` gradients, 0 for a negative amplitude; the
/// jitter as for [`maxima`].
pub fn amplitudes(jitters: &Jitters, unit: &DVector<f64>, draws: usize, seed: u64) -> Vec<f64> {
    let row = |level: &Level, root: &DMatrix<f64>| {
        let information = unit.dot(&(&level.quadratic.information * unit));
        let row = root * level.kept.tr_mul(unit) / information.sqrt();
        DMatrix::from_row_slice(1, row.len(), row.as_slice())
    };
    heights(jitters, &row, above_zero, draws, seed)
}

/// Delta ln L of each of `draws` gradients: without a jitter, `of` applied to the rows of its level and the deviates.
fn heights(
    jitters: &Jitters,
    rows: &dyn Fn(&Level, &DMatrix<f64>) -> DMatrix<f64>,
    of: fn(&DMatrix<f64>, &DMatrix<f64>) -> Vec<f64>,
    draws: usize,
    seed: u64,
) -> Vec<f64> {
    // from deviates to the gradient, symmetric
    let root = root(&jitters.covariance);
    let (mut without, mut with) = (vec![f64::NEG_INFINITY; draws], vec![f64::NEG_INFINITY; draws]);
    // the rows of one level at a time: those of all take a gigabyte for 400 profiles
    for level in &jitters.levels {
        let (rows, alone) = (rows(level, &root), &level.solved * &root);
        let of_block = |(block, (without, with)): (usize, (&mut [f64], &mut [f64]))| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(block as u64);
            let deviates = DMatrix::from_fn(root.nrows(), with.len(), |_, _| rng.sample::<f64, _>(StandardNormal));
            let amplitudes = &alone * &deviates;
            for (k, highest) in of(&rows, &deviates).into_iter().enumerate() {
                let alone = level.constant + 0.5 * amplitudes.column(k).norm_squared();
                without[k] = without[k].max(alone);
                with[k] = with[k].max(alone + highest);
            }
        };
        let blocks = without.par_chunks_mut(DRAWS).zip(with.par_chunks_mut(DRAWS));
        blocks.enumerate().for_each(of_block);
    }
    with.iter().zip(&without).map(|(with, without)| with - without).collect()
}

/// The highest Delta ln L of each column of deviates.
fn highest(rows: &DMatrix<f64>, deviates: &DMatrix<f64>) -> Vec<f64> {
    let mut highest = vec![0.0f64; deviates.ncols()];
    for first in (0..rows.nrows()).step_by(ROWS) {
        let amplitudes = rows.rows(first, ROWS.min(rows.nrows() - first)) * deviates;
        for (highest, column) in highest.iter_mut().zip(amplitudes.column_iter()) {
            let pairs = column.as_slice().chunks_exact(2).map(|w| 0.5 * (w[0] * w[0] + w[1] * w[1]));
            *highest = pairs.fold(*highest, f64::max);
        }
    }
    highest
}

/// Delta ln L of the amplitude in the only row, where it is above 0.
fn above_zero(row: &DMatrix<f64>, deviates: &DMatrix<f64>) -> Vec<f64> {
    (row * deviates).iter().map(|amplitude| 0.5 * amplitude.max(0.0).powi(2)).collect()
}

/// `L^-1 X' S` of all periods, two rows each, S S' being the covariance of the gradient.
fn whitened(level: &Level, root: &DMatrix<f64>, frequencies: &[f64]) -> DMatrix<f64> {
    let trials = scan(&level.quadratic, frequencies);
    let bounded: Vec<(f64, [f64; 3])> =
        trials.iter().filter_map(|trial| Some((trial.frequency, factor(trial)?))).collect();
    let frequencies: Vec<f64> = bounded.iter().map(|trial| trial.0).collect();
    let mut columns = root * (level.kept.transpose() * design(&level.quadratic.cycles, &frequencies));
    for (j, (_, [a, below, b])) in bounded.into_iter().enumerate() {
        for i in 0..columns.nrows() {
            let first = columns[(i, 2 * j)] / a;
            let second = (columns[(i, 2 * j + 1)] - below * first) / b;
            (columns[(i, 2 * j)], columns[(i, 2 * j + 1)]) = (first, second);
        }
    }
    columns.transpose()
}

/// The elements of L, `A = L L'` being the information of a trial; `None` where no orbit is bounded.
pub(super) fn factor(trial: &Trial) -> Option<[f64; 3]> {
    trial.orbit?;
    let factor = trial.information.cholesky()?.l();
    Some([factor[(0, 0)], factor[(1, 0)], factor[(1, 1)]])
}
