//! Compression of the data of an epoch to the few numbers that carry its information on the field.
//!
//! In units of the noise, `W J S^(1/2)` with `W N W^T = 1` has few significant singular values: as many as a profile
//! has resolution elements. Along the directions Q of the data that contain these, the field is free; along all others
//! it is fixed at the expansion point, with white noise (`docs/method.md` section 9).
//!
//! Misfit and slopes are included in Q, which makes several results exact: in the most probable field `C^-1 r = N^-1
//! misfit`, so that it, and the gradient there, do not depend on what is left out. ln Z and the information do: ln Z by
//! less than half of the variance left out, [`Compression::left_out`] in every epoch.

use super::epoch::Epoch;
use nalgebra::{DMatrix, DVector, DVectorView};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The tolerated loss.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Compression {
    /// Largest variance of the field, over that of the noise, along the directions of an epoch's data that are left
    /// out; 0 keeps all.
    pub left_out: f64,
}

impl Default for Compression {
    fn default() -> Self {
        Compression { left_out: 1e-3 }
    }
}

/// Largest number of steps for eigenvalues: some 2 per number are usual, and for non-finite input the iteration does
/// not end.
const MOST_ROTATIONS: usize = 10_000;

/// The compression of an epoch.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// W (data, data), lower triangular.
    whiten: DMatrix<f64>,
    /// Q (data, kept), orthonormal.
    directions: DMatrix<f64>,
    /// `Q^T W J c0`, which turns a misfit into a residual; where the model is divided by a continuum, one more number
    /// for the volume (`tilt`), which has no misfit: 0 until that is included.
    pub expected: DVector<f64>,
    /// Terms of ln Z beyond squares and determinants of these numbers: `-1/2 ln |N| - n/2 ln 2 pi`, n data, and the
    /// density of other data.
    pub constant: f64,
}

/// Misfit and slopes of an epoch in these numbers, and sums along the other directions.
#[derive(Clone, Debug)]
pub struct Told {
    /// `Q^T W (misfit + J c0)`.
    pub residual: DVector<f64>,
    /// `Q^T W D'` (kept, columns).
    pub slopes: DMatrix<f64>,
    /// Squared misfit along the other directions.
    pub chi2: f64,
    /// Slopes times misfit there.
    pub gradient: DVector<f64>,
    /// Slopes times slopes there.
    pub information: DMatrix<f64>,
}

impl Compressed {
    /// The compression of an epoch linearised around the coefficients `around` (H), which have these prior standard
    /// deviations `sd`; its `Q^T W J S^(1/2)` (kept, H), and its common columns, `Q^T W B` (kept, numbers), both with a
    /// row of zeros where the model is divided by a continuum. The tolerated loss applies to the sum of `sharing`
    /// epochs. `None` where the covariance of the noise has no Cholesky factor.
    pub fn new(
        epoch: &Epoch,
        around: DVectorView<f64>,
        sd: &[f64],
        (how, sharing): (Compression, usize),
    ) -> Option<(Self, [DMatrix<f64>; 2])> {
        let factor = epoch.noise().cholesky()?.unpack();
        let n = epoch.len();
        let whiten = factor.solve_lower_triangular(&DMatrix::identity(n, n))?;
        let mut common = &whiten * &epoch.common;
        let mut directions = DMatrix::identity(n, n);
        if how.left_out > 0.0 && n > 0 {
            let variances: Vec<f64> = sd.iter().map(|sd| sd * sd).collect();
            let mut covariance = &whiten * epoch.jacobian.covariance(&variances) * whiten.transpose();
            if common.ncols() > 0 {
                covariance.gemm(sharing as f64, &common, &common.transpose(), 1.0);
            }
            directions = leading_directions(covariance, how)?;
            directions = with_directions(directions, &(&whiten * &epoch.misfit));
            directions = with_directions(directions, &(&whiten * &epoch.slopes));
            common = directions.tr_mul(&common);
        }
        let numbers = directions.ncols() + usize::from(!epoch.divisor.is_empty());
        let mut rows = epoch.jacobian.after(&(directions.transpose() * &whiten).resize_vertically(numbers, 0.0));
        rows.column_iter_mut().zip(sd).for_each(|(mut column, sd)| column *= *sd);
        common.resize_vertically_mut(numbers, 0.0);
        let expected = directions.tr_mul(&(&whiten * epoch.jacobian.times(around))).resize_vertically(numbers, 0.0);
        let ln_noise = 2.0 * factor.diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let constant = epoch.beside - 0.5 * (ln_noise + n as f64 * TAU.ln());
        Some((Compressed { whiten, directions, expected, constant }, [rows, common]))
    }

    /// Misfit (data) and slopes (data, columns) of this epoch, those it was made from or others.
    pub fn tell(&self, misfit: &DVector<f64>, slopes: &DMatrix<f64>) -> Told {
        let (misfit, slopes) = (&self.whiten * misfit, &self.whiten * slopes);
        let (kept, kept_slopes) = (self.directions.tr_mul(&misfit), self.directions.tr_mul(&slopes));
        let (rest, rest_slopes) = (misfit - &self.directions * &kept, slopes - &self.directions * &kept_slopes);
        let numbers = self.expected.len();
        Told {
            residual: kept.resize_vertically(numbers, 0.0) + &self.expected,
            slopes: kept_slopes.resize_vertically(numbers, 0.0),
            chi2: rest.norm_squared(),
            gradient: rest_slopes.tr_mul(&rest),
            information: rest_slopes.tr_mul(&rest_slopes),
        }
    }

    /// Number of data.
    pub fn data(&self) -> usize {
        self.whiten.nrows()
    }
}

/// Orthonormal directions (data, kept) that contain all of this `covariance` (data, data) but the tolerated loss;
/// `None` if that is not finite.
pub fn leading_directions(covariance: DMatrix<f64>, how: Compression) -> Option<DMatrix<f64>> {
    let n = covariance.nrows();
    let eigen = covariance.try_symmetric_eigen(f64::EPSILON, MOST_ROTATIONS)?;
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let mut left_out = 0.0;
    let kept = order.into_iter().skip_while(|i| {
        left_out += eigen.eigenvalues[*i].max(0.0);
        left_out <= how.left_out
    });
    let columns: Vec<_> = kept.map(|i| eigen.eigenvectors.column(i)).collect();
    Some(if columns.is_empty() { DMatrix::zeros(n, 0) } else { DMatrix::from_columns(&columns) })
}

/// Orthonormal directions extended by some more columns.
pub fn with_directions<C: nalgebra::Dim, S: nalgebra::Storage<f64, nalgebra::Dyn, C>>(
    mut directions: DMatrix<f64>,
    more: &nalgebra::Matrix<f64, nalgebra::Dyn, C, S>,
) -> DMatrix<f64> {
    for column in more.column_iter() {
        let mut rest = column - &directions * directions.tr_mul(&column);
        // twice, as the first pass leaves rounding errors of the size of the column
        rest -= &directions * directions.tr_mul(&rest);
        let norm = rest.norm();
        if norm > 1e-10 * column.norm() {
            let columns = directions.ncols();
            directions = directions.insert_column(columns, 0.0);
            directions.set_column(columns, &(rest / norm));
        }
    }
    directions
}
