//! The covariance `C = J K J^T + 1` of the numbers of all epochs and their common columns, factored: dense where that
//! is faster, by a filter in time for more numbers. Both give the same Cholesky factor.

use super::Kernel;
use super::dense::Factor;
use super::filter::Filter;
use super::numbers::Numbers;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// Products with random signs from which a filter estimates the diagonal of the inverse.
const PROBES: usize = 32;

/// Cholesky factor `L L^T` of the covariance.
#[derive(Clone, Debug)]
pub enum Covariance {
    /// Of few numbers.
    Dense(Factor),
    /// Of many.
    InTime(Filter),
}

impl Covariance {
    /// Dense where the `spatial` part is given, else a filter, with directions of coefficients `near` the observed ones
    /// (H, directions), if known. `None` where it is not positive definite or not finite.
    pub fn new(
        numbers: &Numbers,
        spatial: Option<DMatrix<f64>>,
        kernel: &Kernel,
        near: Option<&DMatrix<f64>>,
    ) -> Option<Self> {
        match spatial {
            None => Filter::new(numbers, kernel, near).map(Covariance::InTime),
            Some(spatial) => numbers.dense(spatial, kernel).map(Covariance::Dense),
        }
    }

    /// Directions of the coefficients, in units of their standard deviations, that epochs constrain (H, directions);
    /// `None` for a dense factor, which does not need them.
    pub fn directions(&self) -> Option<&DMatrix<f64>> {
        match self {
            Covariance::Dense(_) => None,
            Covariance::InTime(filter) => Some(&filter.directions),
        }
    }

    /// Logarithm of its determinant.
    pub fn ln_determinant(&self) -> f64 {
        match self {
            Covariance::Dense(factor) => factor.ln_determinant(),
            Covariance::InTime(filter) => filter.ln_determinant(),
        }
    }

    /// `L^-1 B` in place of B (n, columns), where each column of B is known to be zero in its rows before `starts`,
    /// which are in ascending order.
    pub fn forward_from(&self, b: &mut DMatrix<f64>, starts: &[usize]) {
        match self {
            Covariance::Dense(factor) => factor.forward_from(b, starts),
            Covariance::InTime(filter) => filter.forward_from(b, starts),
        }
    }

    /// `L^-1 B` in place of B (n, columns).
    pub fn forward(&self, b: &mut DMatrix<f64>) {
        self.forward_from(b, &vec![0; b.ncols()]);
    }

    /// `L^-T B` in place of B (n, columns).
    pub fn backward(&self, b: &mut DMatrix<f64>) {
        match self {
            Covariance::Dense(factor) => factor.backward(b),
            Covariance::InTime(filter) => filter.backward(b),
        }
    }

    /// Diagonal of the inverse: by a filter from [`PROBES`] products with random signs.
    fn inverse_diagonal(&self, n: usize) -> DVector<f64> {
        let filter = match self {
            Covariance::Dense(factor) => return factor.inverse_diagonal(),
            Covariance::InTime(filter) => filter,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let signs = DMatrix::from_fn(n, PROBES, |_, _| if rng.random::<bool>() { 1.0 } else { -1.0 });
        let mut products = signs.clone();
        filter.forward_from(&mut products, &[0; PROBES]);
        filter.backward(&mut products);
        products.component_mul(&signs).column_mean()
    }

    /// How many of the numbers of each epoch the field explains: the trace of `C^-1 J K J^T` over them, their number
    /// where there is no noise, 0 where all is noise.
    pub fn explained(&self, numbers: &Numbers) -> Vec<f64> {
        let mut noise = self.inverse_diagonal(numbers.rows.nrows());
        if numbers.common.ncols() > 0 {
            let mut solved = numbers.common.clone();
            self.forward(&mut solved);
            self.backward(&mut solved);
            noise += solved.component_mul(&numbers.common).column_sum();
        }
        let of_epoch = |part: &Range<usize>| (part.len() as f64 - noise.rows_range(part.clone()).sum()).max(0.0);
        numbers.parts.iter().map(of_epoch).collect()
    }

    /// `C^-1 x`.
    pub fn solve(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut column = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
        self.forward(&mut column);
        self.backward(&mut column);
        column.column(0).into_owned()
    }
}
