//! Data compression from the bins of a profile to a few coefficients that contain its information on spots, line and
//! velocity (`docs/method.md` section 9): in units of the noise, along the directions of the effects of any spots.
//!
//! The rest is noise, and the same for all parameters. Half as many coefficients as bins halve the computing time.

use super::Basis;
use crate::field::{Compression, Spectrum, leading_directions, with_directions};
use crate::star::{Response, StarState};
use crate::surface::expansion::VELOCITY_STEP_KMS;
use crate::surface::imaging::Imager;
use crate::surface::mean_profile;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Spots for which a profile loses no more than [`LEFT_OUT`] of the variance of the noise: rougher and larger than any.
/// Those of slope 0 and an amplitude of 0.85 have less at every degree.
pub(super) const ROUGHEST: Spectrum = Spectrum { amplitude: 1.0, slope: 0.3, break_degree: 0.0 };
const LEFT_OUT: f64 = 1e-3;

/// The compressed profiles.
#[derive(Clone, Debug)]
pub(super) struct Condensed {
    /// From bins to coefficients (coefficients, bins).
    rows: Vec<DMatrix<f64>>,
    /// Depths.
    pub data: Vec<DVector<f64>>,
    /// Nuisances of line and continuum (coefficients, nuisances).
    pub nuisances: Vec<DMatrix<f64>>,
    /// Errors common to all profiles, for a size of 1 (coefficients, columns); no columns without such errors.
    pub mean_profile: Vec<DMatrix<f64>>,
    /// ln of the density of the remaining directions of the bins.
    pub beside: Vec<f64>,
}

impl Condensed {
    /// Compresses profiles for which the harmonics have the `lines` (bins, H), and a star without spots is `bare` (all
    /// bins), seen through `response` at `state`.
    pub fn new(
        imager: &Imager,
        basis: &Basis,
        (response, state): (&Response, &StarState),
        lines: &[DMatrix<f64>],
        bare: &[f64],
    ) -> Self {
        let sd: Vec<f64> = ROUGHEST.variances(&basis.degrees).into_iter().map(f64::sqrt).collect();
        let slopes = bare_slopes(imager, response, state);
        let wrong_alike = if imager.mean_profile > 0.0 { mean_profile::columns(imager) } else { Vec::new() };
        let of_profile = |k: usize| {
            let (bins, data) = (response.bins(k), &imager.data);
            let weights = data.inverse_variance[bins.clone()].iter().map(|w| w.sqrt());
            let weights = DVector::from_iterator(bins.len(), weights);
            let weighed = |x: &[f64]| DVector::from_column_slice(&x[bins.clone()]).component_mul(&weights);
            let mut rough = lines[k].clone();
            for (mut column, sd) in rough.column_iter_mut().zip(&sd) {
                column.component_mul_assign(&weights);
                column *= *sd;
            }
            let mut nuisances = data.nuisances.line_and_continuum_of(bins.clone());
            nuisances.column_iter_mut().for_each(|mut column| column.component_mul_assign(&weights));
            let all = || DMatrix::identity(bins.len(), bins.len());
            let directions =
                leading_directions(&rough * rough.transpose(), Compression { left_out: LEFT_OUT }).unwrap_or_else(all);
            let own = DMatrix::from_columns(&[weighed(bare), weighed(&slopes)]);
            let mut directions = with_directions(with_directions(directions, &own), &nuisances);
            let mut alike = wrong_alike.get(k).cloned().unwrap_or_else(|| DMatrix::zeros(bins.len(), 0));
            alike.column_iter_mut().for_each(|mut column| column.component_mul_assign(&weights));
            if alike.ncols() > 0 {
                directions = with_directions(directions, &alike);
            }
            let depths = weighed(&data.depth);
            let told = directions.transpose() * &depths;
            let rest = depths.norm_squared() - told.norm_squared();
            let left = (bins.len() - told.len()) as f64;
            let beside = weights.iter().map(|w| w.ln()).sum::<f64>() - 0.5 * (rest + left * TAU.ln());
            let mut rows = directions.transpose();
            rows.row_iter_mut().for_each(|mut row| row.component_mul_assign(&weights.transpose()));
            (rows, told, directions.transpose() * nuisances, directions.transpose() * alike, beside)
        };
        let all: Vec<_> = (0..response.profiles()).into_par_iter().map(of_profile).collect();
        let mut condensed =
            Condensed { rows: vec![], data: vec![], nuisances: vec![], mean_profile: vec![], beside: vec![] };
        for (rows, data, nuisances, mean_profile, beside) in all {
            condensed.rows.push(rows);
            condensed.data.push(data);
            condensed.nuisances.push(nuisances);
            condensed.mean_profile.push(mean_profile);
            condensed.beside.push(beside);
        }
        condensed
    }

    /// Compresses columns over the bins of profile `k`.
    pub fn tell(&self, k: usize, columns: &DMatrix<f64>) -> DMatrix<f64> {
        &self.rows[k] * columns
    }
}

/// Derivatives with velocity of the depths of a star without spots.
fn bare_slopes(imager: &Imager, response: &Response, state: &StarState) -> Vec<f64> {
    let bare = vec![1.0; response.pixels()];
    let at = |h: f64| {
        let shifted = StarState { vsys_kms: state.vsys_kms + h, ..*state };
        imager.with_velocities(response, &shifted).depths(&bare)
    };
    let (above, below) = (at(VELOCITY_STEP_KMS), at(-VELOCITY_STEP_KMS));
    above.iter().zip(below).map(|(above, below)| (above - below) / (2.0 * VELOCITY_STEP_KMS)).collect()
}
