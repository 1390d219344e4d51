//! The compressed data of all epochs, and their covariance `C = J K J^T + 1` as a dense matrix.

use super::Kernel;
use super::dense::{self, Factor};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Numbers of all epochs beyond which a filter is faster (`benches/field.rs`).
const FILTER_BEYOND: usize = 4000;

/// Numbers of all epochs, in units of their noise.
#[derive(Clone, Debug)]
pub struct Numbers {
    /// Times (d) of the epochs, and the ranges of their numbers.
    pub times_d: Vec<f64>,
    pub parts: Vec<Range<usize>>,
    /// J S^(1/2) (n, H).
    pub rows: DMatrix<f64>,
    /// Common columns (n, numbers).
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

    /// The same, unless a filter is faster than dense matrices for so many numbers.
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

    /// `J S^(1/2)` times coefficients (H, epochs), one column per epoch.
    pub fn seen(&self, coefficients: &DMatrix<f64>) -> DVector<f64> {
        let mut seen = DVector::zeros(self.rows.nrows());
        // by columns, in their order in memory
        for (rows, coefficients) in self.rows.column_iter().zip(coefficients.row_iter()) {
            for (part, coefficient) in self.parts.iter().zip(coefficients.iter()) {
                let rows = &rows.as_slice()[part.clone()];
                seen.as_mut_slice()[part.clone()].iter_mut().zip(rows).for_each(|(to, row)| *to += row * coefficient);
            }
        }
        seen
    }

    /// `S^(1/2) J^T` times numbers (H, epochs), one column per epoch.
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
