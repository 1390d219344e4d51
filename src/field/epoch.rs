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
    /// ln of the density of data of this time that say nothing of the field, and are not among these; 0 if there are
    /// none.
    pub beside: f64,
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
            && self.beside.is_finite()
            && finite(self.jacobian.as_slice())
            && finite(self.misfit.as_slice())
            && finite(self.nuisances.as_slice())
            && finite(self.slopes.as_slice())
            && self.variance.iter().all(|v| v.is_finite() && *v > 0.0)
    }

    /// With noise of its own on each number of which there are slopes, of these standard deviations (columns): more
    /// nuisances. A velocity jitter is this, with slopes `D'`; that of [`super::Quadratic::jittered`] leaves the most
    /// probable field as it is without.
    #[must_use]
    pub fn jittered(mut self, sd: &[f64]) -> Self {
        assert_eq!(sd.len(), self.slopes.ncols(), "standard deviations of all numbers of an epoch");
        let (before, more) = (self.nuisances.ncols(), sd.len());
        self.nuisances = self.nuisances.resize_horizontally(before + more, 0.0);
        for (j, sd) in sd.iter().enumerate() {
            self.nuisances.set_column(before + j, &(self.slopes.column(j) * *sd));
        }
        self
    }

    /// `J^T N^-1 misfit` (H); `None` where that is not finite, or the covariance of the noise has no Cholesky factor.
    pub(super) fn pulled(&self) -> Option<DVector<f64>> {
        let weighed = match self.nuisances.ncols() {
            0 => self.misfit.component_div(&self.variance),
            _ => self.noise().cholesky()?.solve(&self.misfit),
        };
        Some(self.jacobian.tr_mul(&weighed)).filter(|pulled| pulled.iter().all(|x| x.is_finite()))
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
