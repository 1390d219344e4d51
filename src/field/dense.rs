//! Products and Cholesky factors of large symmetric matrices, in blocks of columns: nearly all of the work is in
//! products of blocks, which nalgebra does with the best instructions of the processor (some 40 Gflop/s on one core;
//! its own Cholesky factor, column by column, 1.5 to 4). Always the same order of sums, whatever the threads.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector, Dyn, MatrixView};
use rayon::prelude::*;

/// Columns per block.
const BLOCK: usize = 64;

/// Lower triangle (diagonal blocks whole) of `A A^T`, for A (n, m); what is above is zero.
pub fn gram(a: &DMatrix<f64>) -> DMatrix<f64> {
    product_with_transpose(a, a)
}

/// Lower triangle of `A B^T`, for A and B (n, m) whose product is known to be symmetric.
pub fn product_with_transpose(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    let mut product = DMatrix::zeros(n, n);
    for (first, width) in blocks(n, 2 * BLOCK) {
        let mut below = product.view_mut((first, first), (n - first, width));
        below.gemm(1.0, &a.rows(first, n - first), &rows_turned(b, (first, width)), 0.0);
    }
    product
}

/// Lower triangle (diagonal blocks whole) of `A^T A`, for A (n, m); what is above is zero. A share of A at a time is
/// transposed: it may have hundreds of megabytes. Blocks of columns are made side by side; rows in which all later
/// columns are zero, as those of whitened slopes, cost nothing.
pub fn gram_of_columns(a: DMatrixView<f64>) -> DMatrix<f64> {
    let m = a.ncols();
    let mut product = DMatrix::zeros(m, m);
    // the first row in which this column or a later one is not zero
    let mut begin = vec![a.nrows(); m];
    for k in (0..m).rev() {
        let later = begin.get(k + 1).copied().unwrap_or(a.nrows());
        begin[k] = a.column(k).iter().position(|x| *x != 0.0).unwrap_or(a.nrows()).min(later);
    }
    for (row, rows) in blocks(a.nrows(), 16 * BLOCK) {
        let active = begin.partition_point(|begin| *begin < row + rows);
        let turned = a.view((row, 0), (rows, active)).transpose();
        let of_columns = product.as_mut_slice().par_chunks_mut((2 * BLOCK * m).max(1)).enumerate();
        of_columns.for_each(|(k, columns)| {
            let first = 2 * BLOCK * k;
            let width = (columns.len() / m).min(active.saturating_sub(first));
            if width > 0 {
                let mut columns = DMatrixViewMut::from_slice(columns, m, width);
                let mut below = columns.view_mut((first, 0), (active - first, width));
                below.gemm(1.0, &turned.rows(first, active - first), &a.view((row, first), (rows, width)), 1.0);
            }
        });
    }
    product
}

/// `A B`, blocks of columns made side by side.
pub fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    let mut product = DMatrix::zeros(n, b.ncols());
    product.as_mut_slice().par_chunks_mut((BLOCK * n).max(1)).enumerate().for_each(|(k, columns)| {
        let width = columns.len() / n;
        DMatrixViewMut::from_slice(columns, n, width).gemm(1.0, a, &b.columns(BLOCK * k, width), 0.0);
    });
    product
}

/// The transpose of some rows (first, number), in their order in memory. For the right side of a product alone: on the
/// left of few columns nalgebra 0.34 reads beyond its end.
pub(super) fn rows_turned(matrix: &DMatrix<f64>, (first, rows): (usize, usize)) -> Turned<'_> {
    let (n, columns) = matrix.shape();
    let from = if columns > 0 { &matrix.as_slice()[first..] } else { &[] };
    MatrixView::from_slice_with_strides_generic(from, Dyn(columns), Dyn(rows), Dyn(n), Dyn(1))
}

/// Columns whose numbers are not contiguous.
type Turned<'a> = MatrixView<'a, f64, Dyn, Dyn, Dyn, Dyn>;

/// First column and number of columns of every block.
fn blocks(n: usize, block: usize) -> impl DoubleEndedIterator<Item = (usize, usize)> + ExactSizeIterator {
    (0..n.div_ceil(block)).map(move |b| (b * block, block.min(n - b * block)))
}

/// One over each, and 0 for 0.
pub(super) fn inverses(numbers: &[f64]) -> Vec<f64> {
    numbers.iter().map(|x| if *x > 0.0 { x.recip() } else { 0.0 }).collect()
}

/// Multiplies each row by its own factor.
pub(super) fn scale_rows(matrix: &mut DMatrix<f64>, factors: &[f64]) {
    for mut column in matrix.column_iter_mut() {
        column.iter_mut().zip(factors).for_each(|(x, factor)| *x *= factor);
    }
}

/// Cholesky factor `L L^T` of a symmetric, positive definite matrix.
#[derive(Clone, Debug)]
pub struct Factor {
    /// L; entries above the diagonal blocks are not read.
    lower: DMatrix<f64>,
    /// Inverses of the diagonal blocks of L.
    inverses: Vec<DMatrix<f64>>,
}

impl Factor {
    /// Of a matrix (n, n), of which the lower triangle is read; `None` where it is not positive definite or not finite.
    pub fn new(mut matrix: DMatrix<f64>) -> Option<Self> {
        let n = matrix.nrows();
        let mut inverses = Vec::with_capacity(n.div_ceil(BLOCK));
        for (first, width) in blocks(n, BLOCK) {
            let rest = n - first;
            if first > 0 {
                let left = matrix.view((first, 0), (rest, first));
                let known = left * left.rows(0, width).transpose();
                let mut column = matrix.view_mut((first, first), (rest, width));
                column -= known;
            }
            let diagonal = matrix.view((first, first), (width, width)).into_owned().cholesky()?.unpack();
            let inverse = diagonal.solve_lower_triangular(&DMatrix::identity(width, width))?;
            matrix.view_mut((first, first), (width, width)).copy_from(&diagonal);
            if rest > width {
                let mut below = matrix.view_mut((first + width, first), (rest - width, width));
                below.copy_from(&(below.clone_owned() * inverse.transpose()));
            }
            inverses.push(inverse);
        }
        let finite = matrix.diagonal().iter().all(|x| x.is_finite());
        finite.then_some(Factor { lower: matrix, inverses })
    }

    /// Number n of rows.
    fn len(&self) -> usize {
        self.lower.nrows()
    }

    /// Logarithm of the determinant of the matrix.
    pub fn ln_determinant(&self) -> f64 {
        2.0 * self.lower.diagonal().iter().map(|x| x.ln()).sum::<f64>()
    }

    /// `L^-1 B` in place of B (n, columns), where each column of B is known to be zero in its rows before `starts`,
    /// which are in ascending order.
    pub fn forward_from(&self, b: &mut DMatrix<f64>, starts: &[usize]) {
        let n = b.nrows();
        for ((first, width), inverse) in blocks(n, BLOCK).zip(&self.inverses) {
            let columns = starts.partition_point(|start| *start < first + width);
            let solved = inverse * b.view((first, 0), (width, columns));
            b.view_mut((first, 0), (width, columns)).copy_from(&solved);
            let below = first + width;
            if below < n {
                let left = self.lower.view((below, first), (n - below, width));
                b.view_mut((below, 0), (n - below, columns)).gemm(-1.0, &left, &solved, 1.0);
            }
        }
    }

    /// `L^-T B` in place of B (n, columns).
    pub fn backward(&self, b: &mut DMatrix<f64>) {
        let n = b.nrows();
        for ((first, width), inverse) in blocks(n, BLOCK).zip(&self.inverses).rev() {
            let below = first + width;
            let mut block = b.rows(first, width).into_owned();
            if below < n {
                let left = self.lower.view((below, first), (n - below, width));
                block.gemm(-1.0, &left.transpose(), &b.rows(below, n - below), 1.0);
            }
            b.rows_mut(first, width).copy_from(&(inverse.transpose() * block));
        }
    }

    /// Diagonal of the inverse of the matrix.
    pub fn inverse_diagonal(&self) -> DVector<f64> {
        let inverse = self.lower_inverse();
        DVector::from_iterator(self.len(), inverse.column_iter().map(|column| column.norm_squared()))
    }

    /// Lower triangle (diagonal blocks whole) of the inverse of the matrix.
    pub fn inverse(&self) -> DMatrix<f64> {
        let n = self.len();
        let lower = self.lower_inverse();
        let turned = lower.transpose();
        // row i of L^-T starts at column i
        let mut inverse = DMatrix::zeros(n, n);
        for (first, width) in blocks(n, 2 * BLOCK) {
            for (row, height) in blocks(n, 2 * BLOCK).filter(|(row, _)| *row >= first) {
                let left = turned.view((row, row), (height, n - row));
                let right = lower.view((row, first), (n - row, width));
                inverse.view_mut((row, first), (height, width)).gemm(1.0, &left, &right, 0.0);
            }
        }
        inverse
    }

    /// `L^-1`, zeros above the diagonal.
    fn lower_inverse(&self) -> DMatrix<f64> {
        let n = self.len();
        let mut inverse = DMatrix::zeros(n, n);
        for ((first, width), diagonal) in blocks(n, BLOCK).zip(&self.inverses) {
            let left = self.lower.view((first, 0), (width, first));
            let above = diagonal * (left * inverse.view((0, 0), (first, first)));
            inverse.view_mut((first, 0), (width, first)).copy_from(&-above);
            inverse.view_mut((first, first), (width, width)).copy_from(diagonal);
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::Range;

    /// Numbers that look random, (n, m).
    fn some(n: usize, m: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, m, |i, j| ((i * 7919 + j * 104_729 + i * j * 31) % 1009) as f64 / 1009.0 - 0.5)
    }

    #[test]
    fn blocks_do_what_plain_algebra_does() {
        // fewer rows than a block, several blocks, a last one of one row
        for n in [1, 7, 64, 193, 300] {
            let a = some(n, 40);
            let matrix = &a * a.transpose() + DMatrix::identity(n, n);
            let lower = gram(&a) + DMatrix::identity(n, n);
            assert!((lower.lower_triangle() - matrix.lower_triangle()).amax() < 1e-12);
            let factor = Factor::new(lower).unwrap();
            let plain = matrix.clone().cholesky().unwrap();
            assert!((factor.ln_determinant() - plain.ln_determinant()).abs() < 1e-10);
            let mut b = some(n, 9);
            factor.forward_from(&mut b, &[0; 9]);
            assert!((plain.l() * &b - some(n, 9)).amax() < 1e-11);
            factor.backward(&mut b);
            assert!((&matrix * b - some(n, 9)).amax() < 1e-11);
            // columns that begin later and later
            let starts: Vec<usize> = (0..9).map(|j| j * n / 9).collect();
            let late = some(n, 9).map_with_location(|i, j, x| if i < starts[j] { 0.0 } else { x });
            let mut b = late.clone();
            factor.forward_from(&mut b, &starts);
            assert!((plain.l() * b - late).amax() < 1e-11);
            assert!((factor.inverse().lower_triangle() - plain.inverse().lower_triangle()).amax() < 1e-11);
            assert!((factor.inverse_diagonal() - plain.inverse().diagonal()).amax() < 1e-11);
        }
    }

    /// Why results are identical on all processors with AVX2, whatever the width of their registers: every number of a
    /// product is one chain of fused sums, in the order of the rows, in parts of 256.
    #[test]
    fn products_are_sums_in_one_order() {
        #[cfg(target_arch = "x86_64")]
        let fused = std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma");
        #[cfg(not(target_arch = "x86_64"))]
        let fused = cfg!(target_arch = "aarch64");
        for (m, k, n) in [(6, 6, 6), (7, 600, 9), (37, 256, 61), (130, 513, 70)] {
            let (a, b, c) = (some(m, k), some(k, n), some(m, n));
            let next = |x: f64, y: f64, sum: f64| if fused { x.mul_add(y, sum) } else { x * y + sum };
            let part = |i: usize, j: usize, of: Range<usize>| of.fold(0.0, |sum, l| next(a[(i, l)], b[(l, j)], sum));
            let parts = || blocks(k, 256).map(|(first, width)| first..first + width);
            let (product, mut got) = (&a * &b, c.clone());
            got.gemm(-1.0, &a, &b, 1.0);
            for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
                assert_eq!(
                    product[(i, j)],
                    parts().map(|of| part(i, j, of)).fold(0.0, |sum, x| sum + x),
                    "{m} {k} {n}"
                );
                assert_eq!(got[(i, j)], parts().fold(c[(i, j)], |sum, of| sum - part(i, j, of)), "{m} {k} {n}");
            }
        }
    }

    #[test]
    fn many_rows_are_taken_a_share_at_a_time() {
        for columns in [0, 30, 300] {
            let a = some(2500, columns);
            let off = gram_of_columns(a.as_view()).lower_triangle() - a.tr_mul(&a).lower_triangle();
            assert!(off.iter().all(|x| x.abs() < 1e-10), "{columns}");
            // each begins later than the one before, but for one of zeros and one that begins at once
            let begins = |j: usize| if j == 7 { 2500 } else { usize::from(j != 20) * j * 9 };
            let late = a.map_with_location(|i, j, x| if i < begins(j) { 0.0 } else { x });
            let off = gram_of_columns(late.as_view()).lower_triangle() - late.tr_mul(&late).lower_triangle();
            assert!(off.iter().all(|x| x.abs() < 1e-10), "{columns}");
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        let mut matrix = DMatrix::identity(100, 100);
        matrix[(80, 80)] = -1.0;
        assert!(Factor::new(matrix.clone()).is_none());
        matrix[(80, 80)] = f64::NAN;
        assert!(Factor::new(matrix.clone()).is_none());
        matrix[(80, 80)] = f64::INFINITY;
        assert!(Factor::new(matrix).is_none());
    }
}
