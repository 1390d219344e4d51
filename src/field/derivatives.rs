//! Derivatives of ln Z with respect to the hyperparameters of the field (`docs/method.md` section 9): `1/2 a^T dC a -
//! 1/2 tr(C^-1 dC)` with a = `C^-1 r`, for `dC = J dK J^T`.

use super::Evidence;
use super::dense;
use nalgebra::DMatrix;

/// Derivatives of ln Z with respect to the hyperparameters, with the linearisation of model and residuals fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives {
    /// By ln amplitude.
    pub ln_amplitude: f64,
    /// By the power-law index of the spectrum.
    pub slope: f64,
    /// By ln lifetime; 0 for a static field.
    pub ln_lifetime: f64,
    /// By the persistent share.
    pub persistent: f64,
}

impl Evidence {
    /// Derivatives of ln Z with respect to the hyperparameters, with dense matrices of all numbers: twice the work of
    /// ln Z.
    ///
    /// # Panics
    /// Where C is positive definite in time, but not as a dense matrix.
    pub fn derivatives(&self) -> Derivatives {
        let (numbers, kernel) = (&self.numbers, &self.field.kernel);
        let spatial = numbers.spatial();
        let factor = numbers.dense(spatial.clone(), kernel).expect("the covariance had a factor before");
        // 1/2 (a a^T - C^-1), of which the lower triangle is used twice
        let mut pull = -factor.inverse();
        pull.ger(1.0, &self.dual, &self.dual, 1.0);
        pull.fill_upper_triangle(0.0, 1);
        pull.iter_mut().step_by(numbers.rows.nrows() + 1).for_each(|x| *x *= 0.5);
        let along = |spatial: &DMatrix<f64>, k: &dyn Fn(f64) -> f64| {
            let mut change = spatial.clone();
            numbers.in_time(&mut change, k);
            pull.dot(&change)
        };
        let by_slope = self.field.spectrum.log_variances_by_slope(&self.degrees);
        let mut weighted = numbers.rows.clone();
        weighted.column_iter_mut().zip(by_slope).for_each(|(mut column, weight)| column *= weight);
        let by_slope = dense::product_with_transpose(&weighted, &numbers.rows);
        Derivatives {
            ln_amplitude: 2.0 * along(&spatial, &|delay| kernel.at(delay)),
            slope: along(&by_slope, &|delay| kernel.at(delay)),
            ln_lifetime: along(&spatial, &|delay| kernel.by_log_lifetime(delay)),
            persistent: along(&spatial, &|delay| kernel.by_persistent(delay)),
        }
    }
}
