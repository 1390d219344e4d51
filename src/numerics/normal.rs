//! Probabilities under a normal distribution.

use libm::erfc;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Probability that a standard normal deviate is below `x`.
pub fn cumulative(x: f64) -> f64 {
    0.5 * erfc(-x * FRAC_1_SQRT_2)
}

/// Its logarithm, also far below zero.
pub fn ln_cumulative(x: f64) -> f64 {
    // the first terms of Mills' ratio are exact to 1e-7 there
    const FAR: f64 = -30.0;
    if x > FAR {
        return cumulative(x).ln();
    }
    let inverse = x.powi(-2);
    -0.5 * (x * x + TAU.ln()) - (-x).ln() + (-inverse + 3.0 * inverse.powi(2)).ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_goes_on_where_the_probability_is_zero() {
        let (near, far) = (cumulative(-29.999_999).ln(), ln_cumulative(-30.000_001));
        assert!((near - far).abs() < 1e-4, "{near} {far}");
        // Abramowitz & Stegun, table 26.2: -log10 Q(50) = 544.96634
        assert!((ln_cumulative(-50.0) / std::f64::consts::LN_10 + 544.966_34).abs() < 1e-5);
    }
}
