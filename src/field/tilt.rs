//! Where ln Z is expanded (`docs/method.md` section 9): not at the most probable field, but where it is most probable
//! with the volume counted of all fields that explain the data.
//!
//! A model `(b - L c) / s(c)` that is divided by what depends on the field itself has a Jacobian in proportion to
//! 1 / s, so that the fields that explain n numbers of an epoch as well fill a volume in proportion to `s^n`. Around
//! the most probable field Laplace's approximation leaves that out, and finds ln Z of spots at S/N 1000 by some 10 too
//! small. `s^n` as a factor of the integrand moves the place of the expansion to where the marginal of s is largest;
//! its value there is taken out of the integral again. To first order that is a tilt `exp(-a^T c)`, `a = -n d ln s /
//! dc` in every epoch, and a Gaussian field with a tilt is one of another mean, `-K a`; to second order it is one more
//! number that was measured.

use super::maps::{correlations, scale_rows};
use super::{Epoch, Field};
use nalgebra::{DMatrix, RowDVector};

/// The tilt of some epochs.
#[derive(Clone, Debug)]
pub struct Tilt {
    /// How many numbers of each epoch the field explains: n.
    pub explained: Vec<f64>,
    /// a (H, epochs).
    by: DMatrix<f64>,
}

impl Tilt {
    /// Of epochs of which the field explains so many numbers.
    pub fn new(explained: Vec<f64>, epochs: &[Epoch]) -> Self {
        let by = tilted(&explained, epochs);
        Tilt { explained, by }
    }

    /// Whether any model is divided by anything.
    pub fn is_needed(epochs: &[Epoch]) -> bool {
        epochs.iter().any(|epoch| !epoch.divisor.is_empty())
    }

    /// a (H, epochs) of the same epochs linearised elsewhere.
    pub fn of(&self, epochs: &[Epoch]) -> DMatrix<f64> {
        tilted(&self.explained, epochs)
    }

    /// The second order of `n ln s` in epoch k as one more number, measured to be what it is: its row of `J S^(1/2)`
    /// (H), given the standard deviations of the coefficients. None where nothing is divided.
    pub fn row(&self, k: usize, epoch: &Epoch, sd: &[f64]) -> Option<RowDVector<f64>> {
        let per_sd = |h: usize| self.explained[k].sqrt() * epoch.divisor[h] * sd[h];
        (!epoch.divisor.is_empty()).then(|| RowDVector::from_fn(sd.len(), |_, h| per_sd(h)))
    }

    /// `K a` (H, times), by which the mean of the field falls at any times (d), given those of the epochs and the
    /// variances of the coefficients.
    pub fn lowers(&self, field: &Field, epochs_d: &[f64], variances: &[f64], times_d: &[f64]) -> DMatrix<f64> {
        let mut lowered = &self.by * correlations(field, epochs_d, times_d);
        scale_rows(&mut lowered, variances);
        lowered
    }

    /// What epoch k adds to ln Z, expanded around these coefficients, where the mean falls by `lowered`:
    /// `1/2 a^T K a + a^T c0`.
    pub fn taken_out(&self, k: usize, lowered: &DMatrix<f64>, around: &DMatrix<f64>) -> f64 {
        let a = self.by.column(k);
        0.5 * a.dot(&lowered.column(k)) + a.dot(&around.column(k))
    }
}

fn tilted(explained: &[f64], epochs: &[Epoch]) -> DMatrix<f64> {
    let mut by = DMatrix::zeros(epochs.first().map_or(0, |epoch| epoch.jacobian.ncols()), epochs.len());
    for (k, (epoch, n)) in epochs.iter().zip(explained).enumerate().filter(|(_, (e, _))| !e.divisor.is_empty()) {
        by.set_column(k, &(&epoch.divisor * -*n));
    }
    by
}
