//! Variance of the field by degree of its spherical harmonics (`docs/method.md` section 9):
//! `S_l = amplitude^2 [b(b+1) + l(l+1)]^-slope / norm` with a turnover at degree b, the norm such that the variances of
//! all coefficients sum to amplitude^2.
//!
//! With harmonics of unit mean square that sum is the variance of the field, the same at every point of the sphere.

use serde::{Deserialize, Serialize};

/// A power law in degree, flat below a turnover: points farther apart than the size of the largest spots are
/// uncorrelated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spectrum {
    /// Standard deviation of the field at any point.
    pub amplitude: f64,
    /// Power-law index (minus the exponent): small for a rough field.
    pub slope: f64,
    /// Turnover degree; 0 for a pure power law.
    pub break_degree: f64,
}

/// Degrees (1 or more) of the coefficients of a field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Degrees {
    /// Of each.
    pub of_each: Vec<usize>,
    /// Of coefficients that no data constrain but that contribute to the variance of the field.
    pub unseen: Vec<usize>,
}

impl From<Vec<usize>> for Degrees {
    fn from(of_each: Vec<usize>) -> Self {
        Degrees { of_each, unseen: Vec::new() }
    }
}

impl Degrees {
    /// Number of coefficients.
    pub fn len(&self) -> usize {
        self.of_each.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.of_each.is_empty()
    }
}

impl Spectrum {
    /// Variance of each coefficient.
    pub fn variances(&self, degrees: &Degrees) -> Vec<f64> {
        let [seen, _] = self.shares(degrees);
        seen.into_iter().map(|share| self.amplitude * self.amplitude * share).collect()
    }

    /// Derivative of the logarithm of each variance with respect to the power-law index; with respect to ln amplitude
    /// it is 2.
    pub fn log_variances_by_slope(&self, degrees: &Degrees) -> Vec<f64> {
        let [seen, unseen] = self.shares(degrees);
        let along = |shares: &[f64], of: &[usize]| -> f64 {
            shares.iter().zip(of).map(|(share, l)| share * self.log_size(*l)).sum()
        };
        let mean = along(&seen, &degrees.of_each) + along(&unseen, &degrees.unseen);
        degrees.of_each.iter().map(|l| mean - self.log_size(*l)).collect()
    }

    /// Shares in the field's variance of the coefficients and of those that no data constrain; they sum to 1.
    fn shares(&self, degrees: &Degrees) -> [Vec<f64>; 2] {
        let weight = |l: &usize| (-self.slope * self.log_size(*l)).exp();
        let weights = [&degrees.of_each, &degrees.unseen].map(|of| of.iter().map(weight).collect::<Vec<f64>>());
        let sum: f64 = weights.iter().flatten().sum();
        weights.map(|of| of.into_iter().map(|weight| weight / sum).collect())
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
        let degrees = Degrees::from(vec![1, 1, 1, 2, 2, 2, 2, 2, 7]);
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

    /// Coefficients that no data constrain do not change the variances of the others, nor their derivatives.
    #[test]
    fn what_is_unseen_has_its_share() {
        let spectrum = Spectrum { amplitude: 0.3, slope: 0.75, break_degree: 4.0 };
        let all = Degrees::from(vec![1, 2, 2, 7, 7]);
        let some = Degrees { of_each: vec![1, 2, 7], unseen: vec![2, 7] };
        let of = |degrees: &Degrees| [spectrum.variances(degrees), spectrum.log_variances_by_slope(degrees)];
        for (all, some) in of(&all).iter().zip(of(&some)) {
            for (all, some) in [all[0], all[1], all[3]].iter().zip(some) {
                assert!((all / some - 1.0).abs() < 1e-14, "{all} {some}");
            }
        }
    }
}
