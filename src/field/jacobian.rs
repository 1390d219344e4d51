//! The Jacobian of the model of an epoch with respect to the coefficients of the field.
//!
//! Its large part, one row per datum, belongs to the model before division by a continuum, and is the same at every
//! expansion point: it is shared, not copied.

use super::dense::{rows_turned, scale_rows};
use nalgebra::{DMatrix, DVector, DVectorView};
use std::sync::Arc;

/// `J = scale A + u d^T` (data, H): of a model `(a + A c) / s(c)`, for example, 1 / s, and minus the model times the
/// derivative of ln s.
#[derive(Clone, Debug, PartialEq)]
pub struct Jacobian {
    /// A^T (H, data): products with columns of coefficients run along contiguous memory.
    turned: Arc<DMatrix<f64>>,
    scale: f64,
    /// u (data) and d (H); zeros where there is no such part.
    outer: (DVector<f64>, DVector<f64>),
}

impl From<DMatrix<f64>> for Jacobian {
    fn from(rows: DMatrix<f64>) -> Self {
        let outer = (DVector::zeros(rows.nrows()), DVector::zeros(rows.ncols()));
        Jacobian::new(Arc::new(rows.transpose()), 1.0, outer)
    }
}

impl Jacobian {
    /// `scale A + u d^T`, given A^T (H, data). Panics where shapes do not match.
    pub fn new(turned: Arc<DMatrix<f64>>, scale: f64, (u, d): (DVector<f64>, DVector<f64>)) -> Self {
        assert_eq!(turned.shape(), (d.len(), u.len()), "both parts of J");
        Jacobian { turned, scale, outer: (u, d) }
    }

    /// Numbers of data and of coefficients.
    pub fn shape(&self) -> (usize, usize) {
        (self.turned.ncols(), self.turned.nrows())
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
        let (u, d) = &self.outer;
        self.scale.is_finite() && finite(self.turned.as_slice()) && finite(u.as_slice()) && finite(d.as_slice())
    }

    /// J (data, H).
    pub fn whole(&self) -> DMatrix<f64> {
        self.after(&DMatrix::identity(self.turned.ncols(), self.turned.ncols()))
    }

    /// `J c`.
    pub fn times(&self, c: DVectorView<f64>) -> DVector<f64> {
        let (u, d) = &self.outer;
        let mut product = u * d.dot(&c);
        product.gemv_tr(self.scale, &self.turned, &c, 1.0);
        product
    }

    /// `J^T x`.
    pub fn tr_times(&self, x: &DVector<f64>) -> DVector<f64> {
        let (u, d) = &self.outer;
        let mut product = d * u.dot(x);
        product.gemv(self.scale, &self.turned, x, 1.0);
        product
    }

    /// `P J` (rows, H) for P (rows, data).
    pub fn after(&self, p: &DMatrix<f64>) -> DMatrix<f64> {
        let (u, d) = &self.outer;
        let coefficients = self.turned.nrows();
        let mut product = DMatrix::zeros(p.nrows(), coefficients);
        product.gemm(self.scale, p, &rows_turned(&self.turned, (0, coefficients)), 0.0);
        product.ger(1.0, &(p * u), d, 1.0);
        product
    }

    /// `J S J^T` (data, data), S diagonal.
    pub fn covariance(&self, variances: &[f64]) -> DMatrix<f64> {
        let (u, d) = &self.outer;
        let mut scaled = (*self.turned).clone();
        scale_rows(&mut scaled, variances);
        let along = scaled.tr_mul(d) * self.scale;
        let own: f64 = d.iter().zip(variances).map(|(d, variance)| d * d * variance).sum();
        let mut covariance = scaled.transpose() * &*self.turned;
        covariance *= self.scale * self.scale;
        covariance.ger(1.0, &along, u, 1.0);
        covariance.ger(1.0, u, &along, 1.0);
        covariance.ger(own, u, u, 1.0);
        covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_the_whole_matrix() {
        let some = |n: usize, m: usize| DMatrix::from_fn(n, m, |i, j| ((7 * i + 5 * j + 3 * i * j) % 11) as f64 - 4.5);
        let (u, d, variances) = (some(4, 1).column(0).into_owned(), some(9, 1).column(0).into_owned(), [0.3; 9]);
        let whole = some(4, 9) * 0.7 + &u * d.transpose();
        let jacobian = Jacobian::new(Arc::new(some(4, 9).transpose()), 0.7, (u, d));
        let close = |got: &DMatrix<f64>, known: &DMatrix<f64>| (got - known).amax() < 1e-12 * known.amax();
        let column = |x: DVector<f64>| DMatrix::from_column_slice(x.len(), 1, x.as_slice());
        assert!(close(&jacobian.whole(), &whole));
        assert!(close(&column(jacobian.times(some(9, 2).column(1))), &column(&whole * some(9, 2).column(1))));
        let x = some(4, 3).column(2).into_owned();
        assert!(close(&column(jacobian.tr_times(&x)), &column(whole.transpose() * &x)));
        assert!(close(&jacobian.after(&some(2, 4)), &(some(2, 4) * &whole)));
        let spread = DMatrix::from_diagonal(&DVector::from_row_slice(&variances));
        assert!(close(&jacobian.covariance(&variances), &(&whole * spread * whole.transpose())));
        assert!(jacobian.is_finite() && !Jacobian::from(DMatrix::repeat(1, 2, f64::NAN)).is_finite());
    }
}
