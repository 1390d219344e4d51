//! The covariance `C = J K J^T + 1` of the numbers of all epochs, and what they have in common, factored: dense for as
//! many numbers as it is faster for, by a filter in time beyond. Both are the same Cholesky factor.

use super::Kernel;
use super::dense::{self, Factor};
use super::filter::Filter;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::Range;

/// Numbers of all epochs beyond which a filter is faster (`benches/field.rs`).
const FILTER_BEYOND: usize = 4000;

/// Products with random signs from which a filter has the diagonal of the inverse.
const PROBES: usize = 32;

/// Numbers of all epochs, in units of their noise.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// Times (d) of the epochs, and where the numbers of each stand.
    pub times_d: Vec<f64>,
    pub parts: Vec<Range<usize>>,
    /// J S^(1/2) (n, H).
    pub rows: DMatrix<f64>,
    /// What epochs have in common (n, numbers).
    pub common: DMatrix<f64>,
}

impl Numbers {
    /// Of epochs at these times, and their parts of both matrices.
    pub fn new(times_d: Vec<f64>, rows: &[DMatrix<f64>], common: &[DMatrix<f64>], coefficients: usize) -> Self {
        let mut end = 0;
        let part = |rows: &DMatrix<f64>| {
            end += rows.nrows();
            end - rows.nrows()..end
        };
        let parts: Vec<Range<usize>> = rows.iter().map(part).collect();
        let numbers = common.iter().map(DMatrix::ncols).max().unwrap_or(0);
        let (rows, common) = (stacked(rows, &parts, coefficients), stacked(common, &parts, numbers));
        Numbers { times_d, parts, rows, common }
    }

    /// J S J^T (n, n), lower triangle.
    pub fn spatial(&self) -> DMatrix<f64> {
        dense::gram(&self.rows)
    }

    /// The same, unless there are so many numbers that a filter is faster than dense matrices.
    pub fn spatial_of_few(&self) -> Option<DMatrix<f64>> {
        (self.rows.nrows() <= FILTER_BEYOND).then(|| self.spatial())
    }

    /// Puts other rows (numbers, H) in the place of some, in [`Numbers::spatial`] as well if that is given.
    pub fn replace(&mut self, places: &[usize], rows: &DMatrix<f64>, spatial: Option<&mut DMatrix<f64>>) {
        for (place, row) in places.iter().zip(rows.row_iter()) {
            self.rows.set_row(*place, &row);
        }
        let Some(spatial) = spatial else { return };
        let across = &self.rows * rows.transpose();
        for (place, across) in places.iter().zip(across.column_iter()) {
            for (other, product) in across.iter().enumerate() {
                spatial[(other.max(*place), other.min(*place))] = *product;
            }
        }
    }

    /// `J S^(1/2)` times coefficients (H, epochs), each epoch its own.
    pub fn seen(&self, coefficients: &DMatrix<f64>) -> DVector<f64> {
        let mut seen = DVector::zeros(self.rows.nrows());
        // by columns, as they stand in memory
        for (rows, coefficients) in self.rows.column_iter().zip(coefficients.row_iter()) {
            for (part, coefficient) in self.parts.iter().zip(coefficients.iter()) {
                let rows = &rows.as_slice()[part.clone()];
                seen.as_mut_slice()[part.clone()].iter_mut().zip(rows).for_each(|(to, row)| *to += row * coefficient);
            }
        }
        seen
    }

    /// `S^(1/2) J^T` times numbers (H, epochs), each epoch its own.
    pub fn pulled(&self, x: &DVector<f64>) -> DMatrix<f64> {
        let x = x.as_slice();
        let dot = |rows: &[f64], x: &[f64]| rows.iter().zip(x).map(|(row, x)| row * x).sum::<f64>();
        DMatrix::from_fn(self.parts.len(), self.rows.ncols(), |k, h| {
            let part = self.parts[k].clone();
            dot(&self.rows.column(h).as_slice()[part.clone()], &x[part])
        })
        .transpose()
    }

    /// Multiplies the blocks of the lower triangle of a matrix (n, n) by a function of their delay.
    pub fn in_time(&self, matrix: &mut DMatrix<f64>, k: impl Fn(f64) -> f64) {
        let epochs = || self.parts.iter().zip(&self.times_d);
        for (column, later) in epochs() {
            for (row, earlier) in epochs().filter(|(row, _)| row.start >= column.start) {
                let mut block = matrix.view_range_mut(row.clone(), column.clone());
                block *= k(later - earlier);
            }
        }
    }

    /// The dense factor, given [`Numbers::spatial`]; `None` where the covariance is not positive definite or not
    /// finite.
    pub fn dense(&self, spatial: DMatrix<f64>, kernel: &Kernel) -> Option<Factor> {
        let mut covariance = spatial;
        self.in_time(&mut covariance, |delay| kernel.at(delay));
        covariance.iter_mut().step_by(self.rows.nrows() + 1).for_each(|variance| *variance += 1.0);
        if self.common.ncols() > 0 {
            covariance += dense::gram(&self.common);
        }
        Factor::new(covariance)
    }
}

/// Rows of all epochs, zeros for one without columns.
fn stacked(of_epochs: &[DMatrix<f64>], parts: &[Range<usize>], columns: usize) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(parts.last().map_or(0, |part| part.end), columns);
    for (of_epoch, part) in of_epochs.iter().zip(parts) {
        if of_epoch.ncols() > 0 {
            rows.rows_range_mut(part.clone()).copy_from(of_epoch);
        }
    }
    rows
}

/// Cholesky factor `L L^T` of the covariance.
#[derive(Clone, Debug)]
pub enum Covariance {
    /// Of few numbers.
    Dense(Factor),
    /// Of many.
    InTime(Filter),
}

impl Covariance {
    /// Dense of numbers whose `spatial` part is given, or else a filter, with directions of coefficients `near` those
    /// that it sees (H, directions), if they are known. `None` where it is not positive definite or not finite.
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

    /// Directions of the coefficients, in units of their standard deviations, that epochs see (H, directions); `None`
    /// of a dense factor, which does not ask.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn some(n: usize, m: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, m, |i, j| ((i * 7919 + j * 104_729 + i * j * 31) % 1009) as f64 / 1009.0 - 0.5)
    }

    fn numbers() -> Numbers {
        let rows = [some(3, 9), some(4, 9) * 2.0, some(2, 9)];
        let common = [0; 3].map(|_| DMatrix::zeros(0, 0));
        Numbers::new(vec![0.0, 1.0, 5.0], &rows, &common, 9)
    }

    #[test]
    fn rows_that_are_replaced_are_in_the_products() {
        let mut numbers = numbers();
        let mut spatial = numbers.spatial();
        numbers.replace(&[2, 6], &some(2, 9), Some(&mut spatial));
        assert_eq!(numbers.rows.row(6), some(2, 9).row(1));
        assert!((spatial.lower_triangle() - numbers.spatial().lower_triangle()).amax() < 1e-14);
    }

    #[test]
    fn each_epoch_sees_its_own_coefficients() {
        let numbers = numbers();
        let (seen, x) = (numbers.seen(&some(9, 3)), some(9, 1).column(0).into_owned());
        let pulled = numbers.pulled(&x);
        for (k, part) in numbers.parts.iter().enumerate() {
            let rows = numbers.rows.rows_range(part.clone()).into_owned();
            assert!((seen.rows_range(part.clone()) - &rows * some(9, 3).column(k)).amax() < 1e-14);
            assert!((pulled.column(k) - rows.transpose() * x.rows_range(part.clone())).amax() < 1e-14);
        }
    }
}
