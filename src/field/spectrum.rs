//! How much of the field each degree of its spherical harmonics holds (`docs/method.md` section 9):
//! `S_l = amplitude^2 [b(b+1) + l(l+1)]^-slope / norm` with a break at degree b, the norm such that the variances of
//! all coefficients sum to amplitude^2.
//!
//! With harmonics of unit mean square that sum is the variance of the field, the same at every point of the sphere.

use serde::{Deserialize, Serialize};

/// A power law in degree, flat below a break: what lies apart by more than the size of the largest spots has nothing to
/// do with each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spectrum {
    /// Standard deviation of the field at any point.
    pub amplitude: f64,
    /// Minus the exponent: small for a field that is rough.
    pub slope: f64,
    /// Degree of the break; 0 for a power law all the way.
    pub break_degree: f64,
}

impl Spectrum {
    /// Variance of each coefficient, given the degrees (1 or more) of all.
    pub fn variances(&self, degrees: &[usize]) -> Vec<f64> {
        let shares = self.shares(degrees);
        shares.into_iter().map(|share| self.amplitude * self.amplitude * share).collect()
    }

    /// Derivative of the logarithm of each variance with respect to the slope; with respect to ln amplitude it is 2.
    pub fn log_variances_by_slope(&self, degrees: &[usize]) -> Vec<f64> {
        let shares = self.shares(degrees);
        let mean: f64 = shares.iter().zip(degrees).map(|(share, l)| share * self.log_size(*l)).sum();
        degrees.iter().map(|l| mean - self.log_size(*l)).collect()
    }

    /// Shares of the coefficients in the field's variance; they sum to 1.
    fn shares(&self, degrees: &[usize]) -> Vec<f64> {
        let weights: Vec<f64> = degrees.iter().map(|l| (-self.slope * self.log_size(*l)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        weights.into_iter().map(|weight| weight / sum).collect()
    }

    /// `ln [b(b+1) + l(l+1)]`.
    fn log_size(&self, degree: usize) -> f64 {
        let size = |l: f64| l * (l + 1.0);
        (size(self.break_degree) + size(degree as f64)).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variances_sum_to_that_of_the_field_and_follow_the_slope() {
        let degrees = [1, 1, 1, 2, 2, 2, 2, 2, 7];
        // sizes of degrees 2 and 1: 6 and 2 without a break, 26 and 22 with one at 4
        for (break_degree, ratio) in [(0.0, 3.0_f64), (4.0, 26.0 / 22.0)] {
            let at = |slope| Spectrum { amplitude: 0.3, slope, break_degree };
            let variances = at(0.75).variances(&degrees);
            assert!((variances.iter().sum::<f64>() - 0.09).abs() < 1e-15);
            assert!((variances[3] / variances[0] - ratio.powf(-0.75)).abs() < 1e-14);
            let (below, above) = (at(0.75 - 1e-5).variances(&degrees), at(0.75 + 1e-5).variances(&degrees));
            for (h, derivative) in at(0.75).log_variances_by_slope(&degrees).into_iter().enumerate() {
                // rounding of 1e-16 over a step of 2e-5
                assert!((derivative - (above[h] / below[h]).ln() / 2e-5).abs() < 1e-9);
            }
        }
    }
}
