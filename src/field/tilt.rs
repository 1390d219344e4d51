//! Where ln Z is expanded (`docs/method.md` section 9): not at the most probable field, but at the maximum including
//! the volume of all fields that explain the data.
//!
//! A model `(b - L c) / s(c)` whose divisor depends on the field has a Jacobian in proportion to 1 / s, so that the
//! fields that explain n numbers of an epoch as well fill a volume in proportion to `s^n`. Around the most probable
//! field Laplace's approximation leaves that out, and finds ln Z of spots at S/N 1000 by some 10 too small. `s^n` as a
//! factor of the integrand moves the place of the expansion to where the marginal of s is largest; its value there is
//! removed from the integral again. To first order that is a tilt `exp(-a^T c)`, `a = -n d ln s / dc` in every epoch,
//! and a Gaussian field with a tilt is one of another mean, `-K a`; to second order it is one more measured number.

use super::compress::Compressed;
use super::dense::{inverses, scale_rows};
use super::numbers::Numbers;
use super::{Epoch, Field};
use nalgebra::DMatrix;

/// The tilt of some epochs.
#[derive(Clone, Debug)]
pub struct Tilt {
    /// How many numbers of each epoch the field explains: n.
    pub explained: Vec<f64>,
    /// a (H, epochs).
    by: DMatrix<f64>,
    /// Which epochs are divided by a continuum.
    divided: Vec<usize>,
}

impl Tilt {
    /// Of epochs of which the field explains so many numbers.
    pub fn new(explained: Vec<f64>, epochs: &[Epoch]) -> Self {
        let by = tilted(&explained, epochs);
        let divided = (0..epochs.len()).filter(|k| !epochs[*k].divisor.is_empty()).collect();
        Tilt { explained, by, divided }
    }

    /// Positions of the numbers of the volume.
    pub fn places(&self, numbers: &Numbers) -> Vec<usize> {
        self.divided.iter().map(|k| numbers.parts[*k].end - 1).collect()
    }

    /// Whether any model is divided by a continuum.
    pub fn is_needed(epochs: &[Epoch]) -> bool {
        epochs.iter().any(|epoch| !epoch.divisor.is_empty())
    }

    /// Includes the volume in the numbers to which epochs around these coefficients (H, epochs) were compressed, and in
    /// their rows and `spatial` part: the mean of the field, whose coefficients have these standard deviations, falls
    /// by `K a`, and the last number of each epoch that is divided by a continuum is the volume.
    pub fn count(
        &self,
        (field, sd): (&Field, &[f64]),
        (epochs, around): (&[Epoch], &DMatrix<f64>),
        compressed: &mut [Compressed],
        (numbers, spatial): (&mut Numbers, Option<&mut DMatrix<f64>>),
    ) {
        let times_d: Vec<f64> = epochs.iter().map(|epoch| epoch.time_d).collect();
        let variances: Vec<f64> = sd.iter().map(|sd| sd * sd).collect();
        let mut lowered = self.lowers(field, &times_d, &variances, &times_d);
        let mut rows = Vec::new();
        for (k, (of, epoch)) in compressed.iter_mut().zip(epochs).enumerate() {
            let (a, around) = (self.by.column(k), around.column(k));
            // 1/2 a^T K a + a^T c0
            of.constant += 0.5 * a.dot(&lowered.column(k)) + a.dot(&around);
            if !epoch.divisor.is_empty() {
                // n ln s to second order: one number, with its own value as the measurement
                let mut row = &epoch.divisor * self.explained[k].sqrt();
                let last = of.expected.len() - 1;
                of.expected[last] = row.dot(&around);
                row.iter_mut().zip(sd).for_each(|(row, sd)| *row *= sd);
                rows.push(row.transpose());
            }
        }
        numbers.replace(&self.places(numbers), &DMatrix::from_rows(&rows), spatial);
        scale_rows(&mut lowered, &inverses(sd));
        let seen = numbers.seen(&lowered);
        for (of, part) in compressed.iter_mut().zip(&numbers.parts) {
            of.expected += seen.rows_range(part.clone());
        }
    }

    /// `K a` (H, times), by which the mean of the field falls at any times (d), given those of the epochs and the
    /// variances of the coefficients.
    pub fn lowers(&self, field: &Field, epochs_d: &[f64], variances: &[f64], times_d: &[f64]) -> DMatrix<f64> {
        let mut lowered = &self.by * field.kernel.between(epochs_d, times_d);
        scale_rows(&mut lowered, variances);
        lowered
    }
}

/// a (H, epochs) of epochs of which the field explains so many numbers.
pub fn tilted(explained: &[f64], epochs: &[Epoch]) -> DMatrix<f64> {
    let mut by = DMatrix::zeros(epochs.first().map_or(0, |epoch| epoch.jacobian.shape().1), epochs.len());
    for (k, (epoch, n)) in epochs.iter().zip(explained).enumerate().filter(|(_, (e, _))| !e.divisor.is_empty()) {
        by.set_column(k, &(&epoch.divisor * -*n));
    }
    by
}
