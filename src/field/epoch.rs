//! The data of one time, linear in the field: `r = J c + noise`.

use super::{FieldError, Jacobian};
use nalgebra::allocator::Allocator;
use nalgebra::{DMatrix, DVector, DefaultAllocator, Dim, Dyn, Matrix, OMatrix, Storage};

/// The measurements at one time, and their dependence on the coefficients of the field there: `data - model(c)` is
/// `misfit - J (c - c0)` to first order, for the coefficients c0 around which the model was made linear.
#[derive(Clone, Debug, PartialEq)]
pub struct Epoch {
    /// Time (d).
    pub time_d: f64,
    /// J (data, H): derivative of the model with respect to the coefficients.
    pub jacobian: Jacobian,
    /// Data minus model at c0.
    pub misfit: DVector<f64>,
    /// Variance of the noise of each datum (positive).
    pub variance: DVector<f64>,
    /// Change of the model by each nuisance of this epoch, per standard deviation of its prior (data, nuisances): they
    /// are marginalised over. No columns: no nuisances.
    pub nuisances: DMatrix<f64>,
    /// ln of the density of data of this time that do not depend on the field, and are not among these; 0 if there are
    /// none.
    pub beside: f64,
    /// D' (data, columns): change of the model by each number whose gradient and information are requested, for example
    /// the velocity. The same number of columns, perhaps none, in every epoch.
    pub slopes: DMatrix<f64>,
    /// Change of the model by each number common to epochs, per standard deviation of its prior (data, numbers): they
    /// are marginalised over, one of each for all epochs. The same number of columns in every epoch that has any.
    pub common: DMatrix<f64>,
    /// Derivative, with respect to the coefficients (H), of the logarithm of the divisor of the model, such as a
    /// continuum from the same field; no elements where there is none.
    pub divisor: DVector<f64>,
}

impl Epoch {
    /// A single datum at a time (d), without nuisances or slopes: the derivative of the model (1, H), data minus model,
    /// standard error, and its common columns (1, numbers).
    pub fn of_datum(time_d: f64, row: DMatrix<f64>, misfit: f64, sigma: f64, common: DMatrix<f64>) -> Self {
        Epoch {
            time_d,
            jacobian: row.into(),
            misfit: DVector::from_element(1, misfit),
            variance: DVector::from_element(1, sigma * sigma),
            nuisances: DMatrix::zeros(1, 0),
            beside: 0.0,
            slopes: DMatrix::zeros(1, 0),
            common,
            divisor: DVector::zeros(0),
        }
    }

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
            && self.jacobian.is_finite()
            && finite(self.misfit.as_slice())
            && finite(self.nuisances.as_slice())
            && finite(self.slopes.as_slice())
            && finite(self.common.as_slice())
            && finite(self.divisor.as_slice())
            && self.variance.iter().all(|v| v.is_finite() && *v > 0.0)
    }

    /// With independent noise of these standard deviations (columns) on each number that has slopes: more nuisances. An
    /// RV jitter is one, with slopes `D'`; if it is marginalised over in the quadratic only, the most probable field is
    /// that without jitter.
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

    /// `N^-1` times columns (data, columns), N without the common columns; `None` where N has no Cholesky factor.
    pub(super) fn weighed<C: Dim, S: Storage<f64, Dyn, C>>(
        &self,
        columns: &Matrix<f64, Dyn, C, S>,
    ) -> Option<OMatrix<f64, Dyn, C>>
    where
        DefaultAllocator: Allocator<Dyn, C>,
    {
        if self.nuisances.ncols() > 0 {
            return Some(self.noise().cholesky()?.solve(columns));
        }
        let mut weighed = columns.clone_owned();
        weighed.column_iter_mut().for_each(|mut column| column.component_div_assign(&self.variance));
        Some(weighed)
    }

    /// Panics where shapes do not match: a programming error.
    pub(super) fn check_shapes(&self, coefficients: usize) {
        let n = self.len();
        assert_eq!(self.jacobian.shape(), (n, coefficients), "J of an epoch");
        assert_eq!(self.variance.len(), n, "variances of an epoch");
        assert_eq!(self.nuisances.nrows(), n, "nuisances of an epoch");
        assert_eq!(self.slopes.nrows(), n, "slopes of an epoch");
        assert_eq!(self.common.nrows(), n, "what an epoch has in common with others");
        assert!(self.divisor.is_empty() || self.divisor.len() == coefficients, "divisor of an epoch");
    }

    /// Covariance of the noise, nuisances of this epoch included.
    pub(super) fn noise(&self) -> DMatrix<f64> {
        let mut noise = &self.nuisances * self.nuisances.transpose();
        for (j, variance) in self.variance.iter().enumerate() {
            noise[(j, j)] += variance;
        }
        noise
    }
}

/// `J^T N^-1 misfit` of all epochs (H, epochs), with the common columns as part of the noise.
///
/// With N0 the noise of the epochs apart and B their common columns, `N^-1 = N0^-1 - V (1 + B^T V)^-1 V^T`, `V = N0^-1
/// B`.
///
/// # Errors
/// [`FieldError::NotFinite`] where that is not finite, or a covariance of noise has no Cholesky factor.
pub(super) fn pulled(epochs: &[Epoch]) -> Result<DMatrix<f64>, FieldError> {
    let not_finite = |epoch: usize| FieldError::NotFinite { epoch };
    let weighed = |(k, epoch): (usize, &Epoch)| epoch.weighed(&epoch.misfit).ok_or(not_finite(k));
    let mut weighed: Vec<DVector<f64>> = epochs.iter().enumerate().map(weighed).collect::<Result<_, _>>()?;
    let numbers = in_common(epochs);
    if numbers > 0 {
        let mut inner = DMatrix::identity(numbers, numbers);
        let mut along = DVector::zeros(numbers);
        let mut sharing = Vec::new();
        for (k, epoch) in epochs.iter().enumerate().filter(|(_, epoch)| epoch.common.ncols() > 0) {
            let own = epoch.weighed(&epoch.common).ok_or(not_finite(k))?;
            inner += epoch.common.tr_mul(&own);
            along += own.tr_mul(&epoch.misfit);
            sharing.push((k, own));
        }
        let first = sharing[0].0;
        let found = inner.cholesky().ok_or(not_finite(first))?.solve(&along);
        sharing.iter().for_each(|(k, own)| weighed[*k] -= own * &found);
    }
    let mut all = DMatrix::zeros(epochs.first().map_or(0, |epoch| epoch.jacobian.shape().1), epochs.len());
    for (k, (epoch, weighed)) in epochs.iter().zip(&weighed).enumerate() {
        let pulled = epoch.jacobian.tr_times(weighed);
        if !pulled.iter().all(|x| x.is_finite()) {
            return Err(not_finite(k));
        }
        all.set_column(k, &pulled);
    }
    Ok(all)
}

/// Number of columns common to the epochs.
pub(super) fn in_common(epochs: &[Epoch]) -> usize {
    epochs.iter().map(|epoch| epoch.common.ncols()).max().unwrap_or(0)
}
