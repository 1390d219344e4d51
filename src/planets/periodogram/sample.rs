//! Velocities for the tests of this module: orbits, deviates, and quadratics.

use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// Stability of the spectrograph (km/s).
pub const STABILITY_KMS: f64 = 0.03;

/// `n` cycles spread unevenly over `span`.
pub fn uneven(n: usize, span: f64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(n as u64);
    (0..n).map(|k| span * (k as f64 + rng.random_range(0.0..0.9)) / n as f64).collect()
}

/// Velocities of a circular orbit.
pub fn orbit(cycles: &[f64], k: f64, period: f64, phi: f64) -> DVector<f64> {
    DVector::from_iterator(cycles.len(), cycles.iter().map(|e| k * (TAU * (e / period - phi)).cos()))
}

/// `n` standard normal deviates.
pub fn normal(n: usize, seed: u64) -> DVector<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    DVector::from_fn(n, |_, _| rng.sample(StandardNormal))
}

/// The quadratic of velocities `rv` whose information is given.
pub fn with_information(cycles: &[f64], rv: &DVector<f64>, information: DMatrix<f64>) -> VelocityQuadratic {
    VelocityQuadratic { cycles: cycles.to_vec(), gradient: &information * rv, information }
}

/// The quadratic of independent velocities.
pub fn independent(cycles: &[f64], rv: &DVector<f64>, sigma: &DVector<f64>) -> VelocityQuadratic {
    with_information(cycles, rv, DMatrix::from_diagonal(&sigma.map(|s| 1.0 / (s * s))))
}

/// The quadratic of velocities with correlated uncertainties of some 0.05 km/s.
pub fn correlated(cycles: &[f64], rv: &DVector<f64>, seed: u64) -> VelocityQuadratic {
    let n = cycles.len();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mix = DMatrix::from_fn(n, n, |_, _| rng.sample::<f64, _>(StandardNormal)) / (n as f64).sqrt();
    with_information(cycles, rv, (DMatrix::identity(n, n) + mix.tr_mul(&mix)) * 400.0)
}
