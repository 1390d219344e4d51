//! The data of one time, linear in the field: `r = J c + noise`.

use nalgebra::{DMatrix, DVector};

/// What was measured at one time, and how it depends on the coefficients of the field there: `data - model(c)` is
/// `misfit - J (c - c0)` to first order, for the coefficients c0 around which the model was made linear.
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch {
    /// Time (d).
    pub time_d: f64,
    /// J (data, H): derivative of the model with respect to the coefficients.
    pub jacobian: DMatrix<f64>,
    /// Data minus model at c0.
    pub misfit: DVector<f64>,
    /// Variance of the noise of each datum (positive).
    pub variance: DVector<f64>,
    /// Change of the model by each nuisance of this epoch, per standard deviation of its prior (data, nuisances): they
    /// are integrated out. No columns: no nuisances.
    pub nuisances: DMatrix<f64>,
    /// D' (data, columns): change of the model by each number whose gradient and information are asked for, for example
    /// the velocity. The same number of columns, perhaps none, in every epoch.
    pub slopes: DMatrix<f64>,
}

impl Epoch {
    /// Number of data.
    pub fn len(&self) -> usize {
        self.misfit.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.misfit.is_empty()
    }

    /// Whether all numbers are finite, and variances positive.
    pub(super) fn is_sound(&self) -> bool {
        let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
        self.time_d.is_finite()
            && finite(self.jacobian.as_slice())
            && finite(self.misfit.as_slice())
            && finite(self.nuisances.as_slice())
            && finite(self.slopes.as_slice())
            && self.variance.iter().all(|v| v.is_finite() && *v > 0.0)
    }

    /// Panics where shapes do not go together: that is a mistake of the program.
    pub(super) fn check_shapes(&self, coefficients: usize) {
        let n = self.len();
        assert_eq!(self.jacobian.shape(), (n, coefficients), "J of an epoch");
        assert_eq!(self.variance.len(), n, "variances of an epoch");
        assert_eq!(self.nuisances.nrows(), n, "nuisances of an epoch");
        assert_eq!(self.slopes.nrows(), n, "slopes of an epoch");
    }

    /// Covariance of the noise, nuisances included.
    pub(super) fn noise(&self) -> DMatrix<f64> {
        let mut noise = &self.nuisances * self.nuisances.transpose();
        for (j, variance) in self.variance.iter().enumerate() {
            noise[(j, j)] += variance;
        }
        noise
    }
}
