//! The posterior of the field (`docs/method.md` section 9): its mean `c(t) = sum_k k(t - t_k) S J_k^T (C^-1 r)_k`, its
//! standard deviation at points, and the step of Gauss-Newton that both imply.

use super::dense::{inverses, scale_rows};
use super::{Evidence, Field};
use nalgebra::{DMatrix, DMatrixViewMut, DVector};

impl Evidence {
    /// Most probable coefficients (H, epochs) at the times of the epochs.
    pub fn coefficients(&self) -> DMatrix<f64> {
        self.coefficients_at(&self.numbers.times_d)
    }

    /// Most probable coefficients (H, times) at any times (d).
    pub fn coefficients_at(&self, times_d: &[f64]) -> DMatrix<f64> {
        let found = self.spread(&self.dual, times_d);
        let Some(tilt) = &self.tilt else { return found };
        let variances = self.field.spectrum.variances(&self.degrees);
        found - tilt.lowers(&self.field, &self.numbers.times_d, &variances, times_d)
    }

    /// Mean of the field (points, times) at points, given their harmonics (H, points), and at any times (d).
    pub fn means(&self, harmonics: &DMatrix<f64>, times_d: &[f64]) -> DMatrix<f64> {
        harmonics.tr_mul(&self.coefficients_at(times_d))
    }

    /// Standard deviation of the field (points, times) at points, given their harmonics (H, points), and at any times
    /// (d).
    pub fn standard_deviations(&self, harmonics: &DMatrix<f64>, times_d: &[f64]) -> DMatrix<f64> {
        let mut scaled = harmonics.clone();
        scale_rows(&mut scaled, &self.sd);
        let seen = &self.numbers.rows * &scaled;
        let before: Vec<f64> = scaled.column_iter().map(|point| point.norm_squared()).collect();
        let correlations = self.field.kernel.between(&self.numbers.times_d, times_d);
        let mut after = DMatrix::zeros(harmonics.ncols(), times_d.len());
        for (correlations, mut after) in correlations.column_iter().zip(after.column_iter_mut()) {
            let mut known = seen.clone();
            self.correlate(known.columns_range_mut(..), correlations.as_slice());
            self.covariance.forward(&mut known);
            for ((after, before), known) in after.iter_mut().zip(&before).zip(known.column_iter()) {
                // rounding may make it negative
                *after = (before - known.norm_squared()).max(0.0).sqrt();
            }
        }
        after
    }

    /// Posterior means and covariance of numbers that are linear in the field, each given by a row (numbers, H) and a
    /// time (d).
    pub fn predicted(&self, rows: &DMatrix<f64>, times_d: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let coefficients = self.coefficients_at(times_d);
        let mean = DVector::from_fn(rows.nrows(), |k, _| rows.row(k).transpose().dot(&coefficients.column(k)));
        let mut scaled = rows.transpose();
        scale_rows(&mut scaled, &self.sd);
        let mut known = &self.numbers.rows * &scaled;
        let correlations = self.field.kernel.between(&self.numbers.times_d, times_d);
        for (k, correlations) in correlations.column_iter().enumerate() {
            self.correlate(known.columns_mut(k, 1), correlations.as_slice());
        }
        self.covariance.forward(&mut known);
        let before = scaled.tr_mul(&scaled).component_mul(&self.field.kernel.between(times_d, times_d));
        (mean, before - known.tr_mul(&known))
    }

    /// Multiplies the rows of each epoch by its correlation with another time.
    fn correlate(&self, mut known: DMatrixViewMut<f64>, correlations: &[f64]) {
        for (part, correlation) in self.numbers.parts.iter().zip(correlations) {
            let mut rows = known.rows_range_mut(part.clone());
            rows *= *correlation;
        }
    }

    /// The prior variances of such numbers.
    pub fn variances_before(&self, rows: &DMatrix<f64>) -> Vec<f64> {
        let mut scaled = rows.transpose();
        scale_rows(&mut scaled, &self.sd);
        scaled.column_iter().map(|row| row.norm_squared()).collect()
    }

    /// The Newton step (H, epochs) from coefficients c (H, epochs) for a `field` and a model that may differ somewhat
    /// from those of this evidence, where `pulled` is `J^T N^-1 misfit` (H, epochs) at c:
    /// `(1 - K J^T C^-1 J) (K' pulled - c)`, K' of that field, all else of this evidence. With all of one model that is
    /// the step of Gauss-Newton; and it vanishes at the most probable coefficients of the other, `c = K' pulled`.
    pub(super) fn step(&self, field: &Field, coefficients: &DMatrix<f64>, pulled: &DMatrix<f64>) -> DMatrix<f64> {
        let mut gradient = pulled * field.kernel.between(&self.numbers.times_d, &self.numbers.times_d);
        scale_rows(&mut gradient, &field.spectrum.variances(&self.degrees));
        gradient -= coefficients;
        let mut scaled = gradient.clone();
        scale_rows(&mut scaled, &inverses(&self.sd));
        let seen = self.numbers.seen(&scaled);
        gradient - self.spread(&self.covariance.solve(&seen), &self.numbers.times_d)
    }

    /// `K J^T N^(-1/2) x`, coefficients (H, times) at any times (d), of numbers x as compressed.
    fn spread(&self, x: &DVector<f64>, times_d: &[f64]) -> DMatrix<f64> {
        let mut pulls = self.numbers.pulled(x);
        scale_rows(&mut pulls, &self.sd);
        pulls * self.field.kernel.between(&self.numbers.times_d, times_d)
    }
}
