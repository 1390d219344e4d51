//! From the data of an epoch to the few numbers that hold what they say of the field.
//!
//! In units of the noise, `N^(-1/2) J S^(1/2)` has some dozen singular values that count: a profile has so many
//! resolution elements. Along all other directions of the data there is white noise and nothing else; what residual and
//! slopes have there enters the evidence as it is (`docs/method.md` section 9). The variance of the field that is left
//! out is at most [`Compression::left_out`] an epoch, in units of that of the noise: ln Z changes by less than half of
//! it for the determinant, and by half of it times the mean square of the residual, about 1.

use super::epoch::Epoch;
use nalgebra::{DMatrix, DVector, DVectorView};
use serde::{Deserialize, Serialize};

/// How much may be lost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Compression {
    /// Variance of the field along the directions of an epoch's data that are left out, over that of the noise; 0 keeps
    /// all.
    pub left_out: f64,
}

impl Default for Compression {
    fn default() -> Self {
        Compression { left_out: 1e-6 }
    }
}

/// An epoch in units of its noise, along the directions that hold something of the field.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// `Q^T N^(-1/2) J S^(1/2)` (directions, H).
    pub rows: DMatrix<f64>,
    /// `Q^T N^(-1/2) r`, r = misfit + J c0.
    pub residual: DVector<f64>,
    /// `Q^T N^(-1/2) D'` (directions, columns).
    pub slopes: DMatrix<f64>,
    /// What is along the other directions.
    pub beside: Beside,
}

/// Along the directions in which there is noise alone: products of residual and slopes.
#[derive(Clone, Debug)]
pub struct Beside {
    /// Number of data of the epoch, all directions.
    pub data: usize,
    /// Logarithm of the determinant of N.
    pub ln_noise: f64,
    /// Squared residual.
    pub chi2: f64,
    /// Slopes times residual.
    pub gradient: DVector<f64>,
    /// Slopes times slopes.
    pub information: DMatrix<f64>,
}

impl Compressed {
    /// Of an epoch linearised around the coefficients `around` (H), which have these prior standard deviations `sd`.
    /// `None` where the covariance of the noise has no Cholesky factor.
    pub fn new(epoch: &Epoch, around: DVectorView<f64>, sd: &[f64], how: Compression) -> Option<Self> {
        let factor = epoch.noise().cholesky()?.unpack();
        let whiten = factor.solve_lower_triangular(&DMatrix::identity(epoch.len(), epoch.len()))?;
        let mut scaled = epoch.jacobian.clone();
        scaled.column_iter_mut().zip(sd).for_each(|(mut column, sd)| column *= *sd);
        let directions = directions(&whiten, &scaled, how)?;
        let along = directions.tr_mul(&whiten);
        let residual = &whiten * (&epoch.misfit + &epoch.jacobian * around);
        let slopes = &whiten * &epoch.slopes;
        let (kept, kept_slopes) = (directions.tr_mul(&residual), directions.tr_mul(&slopes));
        let (rest, rest_slopes) = (residual - &directions * &kept, slopes - &directions * &kept_slopes);
        let beside = Beside {
            data: epoch.len(),
            ln_noise: 2.0 * factor.diagonal().iter().map(|x| x.ln()).sum::<f64>(),
            chi2: rest.norm_squared(),
            gradient: rest_slopes.tr_mul(&rest),
            information: rest_slopes.tr_mul(&rest_slopes),
        };
        Some(Compressed { rows: along * scaled, residual: kept, slopes: kept_slopes, beside })
    }
}

/// Orthonormal directions Q (data, kept) that hold all of `N^(-1/2) J S^(1/2)` but what may be lost; `None` if that is
/// not finite.
fn directions(whiten: &DMatrix<f64>, scaled: &DMatrix<f64>, how: Compression) -> Option<DMatrix<f64>> {
    let n = whiten.nrows();
    if how.left_out == 0.0 {
        return Some(DMatrix::identity(n, n));
    }
    let gram = whiten * (scaled * scaled.transpose()) * whiten.transpose();
    let eigen = gram.try_symmetric_eigen(f64::EPSILON, 0)?;
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
