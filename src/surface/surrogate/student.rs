//! A t distribution, in coordinates in which it is isotropic: proposals with heavier tails than those of a Gaussian.

use nalgebra::DVector;
use rand::{Rng, RngCore};
use rand_distr::{ChiSquared, StandardNormal};

/// Its degrees of freedom.
const DEGREES: f64 = 8.0;

/// A draw around zero.
pub(super) fn draw(dimension: usize, rng: &mut dyn RngCore) -> DVector<f64> {
    let normal = DVector::from_fn(dimension, |_, _| rng.sample::<f64, _>(StandardNormal));
    let chi2: f64 = rng.sample(ChiSquared::new(DEGREES).expect("positive"));
    normal * (DEGREES / chi2).sqrt()
}

/// ln of the density at `at`, but for a constant.
pub(super) fn log_density(at: &DVector<f64>) -> f64 {
    -0.5 * (DEGREES + at.len() as f64) * (at.norm_squared() / DEGREES).ln_1p()
}
