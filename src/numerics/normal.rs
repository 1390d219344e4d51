//! Probabilities under a normal distribution.

use libm::erfc;
use std::f64::consts::FRAC_1_SQRT_2;

/// Probability that a standard normal deviate is below `x`.
pub fn cumulative(x: f64) -> f64 {
    0.5 * erfc(-x * FRAC_1_SQRT_2)
}
