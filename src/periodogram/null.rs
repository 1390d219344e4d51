//! What a periodogram looks like without a planet: the scatter of its gradient, and the highest peak of many such draws.
//!
//! `Delta ln L(P) = |L^-1 X' gradient|^2 / 2` with `A = L L'` at every trial period. The whitened rows of all periods are one
//! matrix, times a square root of the gradient's covariance, times the deviates. Each block of draws has its own stream of
//! random numbers, so that the number of threads does not matter.

use super::orbits::{BLOCK, Trial, blocks, design};
use crate::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Draws that share one matrix product, and one stream of random numbers.
const DRAWS: usize = 250;

/// Directions of the gradient with less than this part of the largest variance do not move.
const STILL: f64 = 1e-13;

/// How the gradient is distributed for stars without a planet: about 0, or about what the entropy's pull on the reference image
/// leaves in it; with the scatter of photon noise, or with the information, which counts spots that might be there as well.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NullModel {
    /// Mean 0, the information as covariance: the null model of the likelihood itself.
    Information,
    /// The information about the mean for the spots of the reference.
    InformationAndBias,
    /// Mean 0, the covariance of photon noise.
    Noise,
    /// Photon noise about the mean for the spots of the reference. Peaks come at harmonics of the rotation first.
    #[default]
    NoiseAndBias,
}

impl NullModel {
    /// The name used by the command and in files.
    pub fn name(self) -> &'static str {
        match self {
            NullModel::Information => "information",
            NullModel::InformationAndBias => "information-and-bias",
            NullModel::Noise => "noise",
            NullModel::NoiseAndBias => "noise-and-bias",
        }
    }

    /// Covariance of the gradient.
    pub fn covariance(self, quadratic: &VelocityQuadratic) -> &DMatrix<f64> {
        match self {
            NullModel::Information | NullModel::InformationAndBias => &quadratic.information,
            NullModel::Noise | NullModel::NoiseAndBias => &quadratic.noise,
        }
    }

    /// Mean of the gradient.
    pub fn mean(self, quadratic: &VelocityQuadratic) -> DVector<f64> {
        match self {
            NullModel::InformationAndBias | NullModel::NoiseAndBias => quadratic.bias.clone(),
            NullModel::Information | NullModel::Noise => DVector::zeros(quadratic.len()),
        }
    }
}

/// Mean and covariance of `X' gradient` at one trial period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// The mean.
    pub mean: Vector2<f64>,
    /// The covariance.
    pub covariance: Matrix2<f64>,
}

/// The scatter at every trial period.
pub fn scatter(quadratic: &VelocityQuadratic, trials: &[Trial], model: NullModel) -> Vec<Scatter> {
    let (covariance, mean) = (model.covariance(quadratic), model.mean(quadratic));
    let block = |trials: &[Trial]| {
        let frequencies: Vec<f64> = trials.iter().map(|t| t.frequency).collect();
        let x = design(&quadratic.cycles, &frequencies);
        let (cx, mx) = (covariance * &x, x.tr_mul(&mean));
        let scatter = |(j, covariance)| Scatter { mean: Vector2::new(mx[2 * j], mx[2 * j + 1]), covariance };
        blocks(&x, &cx).enumerate().map(scatter).collect::<Vec<_>>()
    };
    trials.par_chunks(BLOCK).flat_map_iter(block).collect()
}

/// The highest Delta ln L over the trial periods of each of `draws` gradients.
pub fn maxima(quadratic: &VelocityQuadratic, trials: &[Trial], model: NullModel, draws: usize, seed: u64) -> Vec<f64> {
    let rows = whitened(quadratic, trials, model);
    let block = |block: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(block as u64);
        let size = DRAWS.min(draws - block * DRAWS);
        let mut deviates = DMatrix::from_fn(rows.ncols(), size, |_, _| rng.sample::<f64, _>(StandardNormal));
        // the last column of the rows is the mean
        deviates.row_mut(rows.ncols() - 1).fill(1.0);
        let amplitudes = &rows * deviates;
        let highest = |draw: usize| {
            let column = amplitudes.column(draw);
            column.as_slice().chunks_exact(2).map(|w| 0.5 * (w[0] * w[0] + w[1] * w[1])).fold(0.0, f64::max)
        };
        (0..size).map(highest).collect::<Vec<f64>>()
    };
    (0..draws.div_ceil(DRAWS)).into_par_iter().flat_map_iter(block).collect()
}

/// `L^-1 X' (S, mean)` of all periods, two rows each, S S' being the covariance of the gradient.
fn whitened(quadratic: &VelocityQuadratic, trials: &[Trial], model: NullModel) -> DMatrix<f64> {
    let root = root(model.covariance(quadratic), &model.mean(quadratic));
    let bounded: Vec<&Trial> = trials.iter().filter(|t| t.orbit.is_some()).collect();
    let frequencies: Vec<f64> = bounded.iter().map(|t| t.frequency).collect();
    let mut columns = root * design(&quadratic.cycles, &frequencies);
    for (j, trial) in bounded.iter().enumerate() {
        let Some(factor) = trial.information.cholesky().map(|c| c.l()) else { continue };
        for i in 0..columns.nrows() {
            let first = columns[(i, 2 * j)] / factor[(0, 0)];
            let second = (columns[(i, 2 * j + 1)] - factor[(1, 0)] * first) / factor[(1, 1)];
            (columns[(i, 2 * j)], columns[(i, 2 * j + 1)]) = (first, second);
        }
    }
    columns.transpose()
}

/// Rows `S'` with `S S'` the covariance, and the mean as the last row.
fn root(covariance: &DMatrix<f64>, mean: &DVector<f64>) -> DMatrix<f64> {
    let eigen = covariance.clone().symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let moving: Vec<usize> = (0..mean.len()).filter(|&k| eigen.eigenvalues[k] > STILL * largest).collect();
    let mut rows = DMatrix::zeros(moving.len() + 1, mean.len());
    for (r, &k) in moving.iter().enumerate() {
        rows.row_mut(r).tr_copy_from(&(eigen.eigenvectors.column(k) * eigen.eigenvalues[k].sqrt()));
    }
    rows.row_mut(moving.len()).tr_copy_from(mean);
    rows
}
