//! The star's side of the marginal likelihood: the profiles of each harmonic.

use super::MEAN_FILLING;
use super::basis::Basis;
use super::condense::Condensed;
use super::light::Light;
use crate::field::{Epoch, Jacobian};
use crate::star::{Response, StarState};
use crate::surface::expansion::VELOCITY_STEP_KMS;
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Line depth and continuum of every profile for each harmonic, before the division of one by the other; depths in
/// compressed form.
#[derive(Clone, Debug)]
pub struct Design {
    response: Response,
    condensed: Arc<Condensed>,
    /// Line depths per profile (H, coefficients).
    line: Vec<Arc<DMatrix<f64>>>,
    /// Continua (H, profiles).
    continuum: DMatrix<f64>,
    /// The same for a uniformly spotted star, with the mean filling factor of the field.
    mean_line: Vec<DVector<f64>>,
    mean_continuum: Vec<f64>,
    light: Light,
    /// Derivatives of the depths with velocity, where they are needed often.
    moving: Option<Arc<Moving>>,
}

/// Derivatives of the line depth of every profile with velocity (per km/s).
#[derive(Debug)]
struct Moving {
    /// The star to whose velocities they apply.
    state: StarState,
    /// For each harmonic, per profile (H, coefficients).
    line: Vec<DMatrix<f64>>,
    /// For a uniformly spotted star.
    mean_line: Vec<DVector<f64>>,
}

impl Design {
    /// The design of the star in `imager` at `state`, by one model application per harmonic.
    pub fn new(imager: &Imager, basis: &Basis, state: &StarState) -> Self {
        Design::of(imager, basis, (imager.response(state), state), None)
    }

    /// The design seen through a response at a state, in the coefficients of a design that is `like` this one, of a
    /// similar star.
    pub fn of(
        imager: &Imager,
        basis: &Basis,
        (response, state): (Response, &StarState),
        like: Option<&Design>,
    ) -> Self {
        let (lines, continuum) = of_harmonics(&response, basis);
        let [(bare, _), (mean, mean_continuum)] = [0.0, MEAN_FILLING].map(|filling| uniform(&response, filling));
        let condensed = match like {
            Some(like) => Arc::clone(&like.condensed),
            None => Arc::new(Condensed::new(imager, basis, (&response, state), &lines, &bare)),
        };
        let line = told(&condensed, &lines).into_iter().map(Arc::new).collect();
        let mean_line = told_each(&condensed, &response, &mean);
        let light = Light::new(imager, basis, state);
        Design { response, condensed, line, continuum, mean_line, mean_continuum, light, moving: None }
    }

    /// Adds derivatives of the depths with the velocities of the star at `state`, that of the design. They cost as much
    /// as two designs and save a chain a tenth of its time; a fit with its few dozen maps takes as long as without.
    #[must_use]
    pub fn moving(mut self, imager: &Imager, basis: &Basis, state: &StarState) -> Self {
        let at = |h: f64| {
            let shifted = StarState { vsys_kms: state.vsys_kms + h, ..*state };
            let response = imager.with_velocities(&self.response, &shifted);
            let (lines, _) = of_harmonics(&response, basis);
            let (mean, _) = uniform(&response, MEAN_FILLING);
            (told(&self.condensed, &lines), told_each(&self.condensed, &response, &mean))
        };
        let ((above, mean_above), (below, mean_below)) = (at(VELOCITY_STEP_KMS), at(-VELOCITY_STEP_KMS));
        let line = above.into_iter().zip(below).map(|(a, b)| (a - b) / (2.0 * VELOCITY_STEP_KMS)).collect();
        let means = mean_above.into_iter().zip(mean_below);
        let mean_line = means.map(|(a, b)| (a - b) / (2.0 * VELOCITY_STEP_KMS)).collect();
        self.moving = Some(Arc::new(Moving { state: *state, line, mean_line }));
        self
    }

    /// Derivatives of the coefficients of each profile with its velocity, for maps of these coefficients (H, epochs),
    /// if they are known for the star at `state` without recomputing the pixels.
    pub(super) fn known_slopes(&self, state: &StarState, maps: &DMatrix<f64>) -> Option<Vec<DMatrix<f64>>> {
        let moving = self.moving.as_ref().filter(|moving| moving.state == *state)?;
        let slope = |k: usize| {
            let (slope, _) = self.divided(k, (&moving.line[k], &moving.mean_line[k]), &maps.column(k).into_owned());
            DMatrix::from_column_slice(slope.len(), 1, slope.as_slice())
        };
        Some((0..self.response.profiles()).map(slope).collect())
    }

    /// Columns over the bins of each profile, compressed.
    pub fn condensed(&self, columns: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        columns.iter().enumerate().map(|(k, columns)| self.condensed.tell(k, columns)).collect()
    }

    /// Brightness relative to the photosphere (pixels, profiles) of maps with these `coefficients` (H, epochs), at each
    /// profile.
    pub fn brightness(&self, basis: &Basis, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
        let mut brightness = basis.filling(&coefficients.columns(0, self.response.profiles()).into_owned());
        for (k, mut map) in brightness.column_iter_mut().enumerate() {
            let contrast = self.response.contrast(k);
            map.apply(|filling| *filling = 1.0 - (1.0 - contrast) * *filling);
        }
        brightness
    }

    /// Information of the data on the harmonics `of` one degree (harmonics, harmonics): the sum of `J^T N^-1 J` of
    /// lines, of continua by which they are divided, and of light curves.
    pub(super) fn information(&self, imager: &Imager, of: Range<usize>) -> DMatrix<f64> {
        let mut information = self.light.information(imager, of.clone());
        for (k, line) in self.line.iter().enumerate() {
            let scale = (1.0 - self.response.contrast(k)) / self.mean_continuum[k];
            let line = line.rows_range(of.clone()) * scale;
            let continuum = self.continuum.rows_range(of.clone()).column(k) * scale;
            let depth = self.mean_line[k].norm_squared() / self.mean_continuum[k].powi(2);
            information += &line * line.transpose();
            information.ger(depth, &continuum, &continuum, 1.0);
        }
        information
    }

    /// The response of the design.
    pub fn response(&self) -> &Response {
        &self.response
    }

    /// Model depths of profile `k` for a map of these coefficients, and its continuum.
    fn depths(&self, k: usize, coefficients: &DVector<f64>) -> (DVector<f64>, f64) {
        self.divided(k, (&self.line[k], &self.mean_line[k]), coefficients)
    }

    /// The line of profile `k` for a map of these coefficients divided by its continuum, and that continuum, given the
    /// line of each harmonic (H, coefficients) and of a uniformly spotted star.
    fn divided(
        &self,
        k: usize,
        (line, mean): (&DMatrix<f64>, &DVector<f64>),
        coefficients: &DVector<f64>,
    ) -> (DVector<f64>, f64) {
        let q = 1.0 - self.response.contrast(k);
        let continuum = self.mean_continuum[k] - q * self.continuum.column(k).dot(coefficients);
        ((mean - line.tr_mul(coefficients) * q) / continuum, continuum)
    }

    /// The profiles, then the bins of light curves, linearised around maps of these coefficients (H, epochs), without
    /// slopes.
    pub fn epochs(&self, imager: &Imager, maps: &DMatrix<f64>) -> Vec<Epoch> {
        let times_d = imager.times_d();
        let profiles = self.response.profiles();
        let epoch = |k: usize| self.epoch((times_d[k], imager.mean_profile), k, &maps.column(k).into_owned());
        let mut epochs: Vec<Epoch> = (0..profiles).into_par_iter().map(epoch).collect();
        epochs.extend(self.light.epochs(imager, maps.columns_range(profiles..)));
        // common columns of profiles first, then those of light curves
        let of_profiles = epochs.first().map_or(0, |epoch| epoch.common.ncols());
        let of_light = epochs.get(profiles).map_or(0, |epoch| epoch.common.ncols());
        if of_profiles > 0 && of_light > 0 {
            for (k, epoch) in epochs.iter_mut().enumerate() {
                let common = std::mem::replace(&mut epoch.common, DMatrix::zeros(0, 0));
                epoch.common = match k < profiles {
                    true => common.resize_horizontally(of_profiles + of_light, 0.0),
                    false => common.insert_columns(0, of_profiles, 0.0),
                };
            }
        }
        epochs
    }

    /// Most probable errors common to all profiles for maps of these coefficients (H, epochs): one value for each of
    /// the columns of [`mean_profile`](crate::surface::mean_profile); none where they are not modelled.
    pub(super) fn mean_profile(&self, imager: &Imager, maps: &DMatrix<f64>) -> DVector<f64> {
        let epochs = &self.epochs(imager, maps)[..self.response.profiles()];
        let numbers = self.condensed.mean_profile.first().map_or(0, DMatrix::ncols);
        let (mut inner, mut along) = (DMatrix::identity(numbers, numbers), DVector::zeros(numbers));
        for (epoch, alike) in epochs.iter().zip(&self.condensed.mean_profile) {
            let alike = alike * imager.mean_profile;
            // coefficients are in units of the noise; nuisances of the profile add to it
            let mut noise = &epoch.nuisances * epoch.nuisances.transpose();
            (0..noise.nrows()).for_each(|i| noise[(i, i)] += 1.0);
            let Some(factor) = noise.cholesky() else { continue };
            inner += alike.tr_mul(&factor.solve(&alike));
            along += alike.tr_mul(&factor.solve(&epoch.misfit));
        }
        inner.cholesky().map_or(DVector::zeros(numbers), |factor| factor.solve(&along)) * imager.mean_profile
    }

    fn epoch(&self, (time_d, mean_profile): (f64, f64), k: usize, coefficients: &DVector<f64>) -> Epoch {
        let (model, continuum) = self.depths(k, coefficients);
        let scale = -(1.0 - self.response.contrast(k)) / continuum;
        let divisor = self.continuum.column(k) * scale;
        let jacobian = Jacobian::new(Arc::clone(&self.line[k]), scale, (-&model, divisor.clone()));
        Epoch {
            time_d,
            jacobian,
            variance: DVector::repeat(model.len(), 1.0),
            slopes: DMatrix::zeros(model.len(), 0),
            common: &self.condensed.mean_profile[k] * mean_profile,
            divisor,
            misfit: &self.condensed.data[k] - model,
            nuisances: self.condensed.nuisances[k].clone(),
            beside: self.condensed.beside[k],
        }
    }
}

/// Line depths of every profile for each harmonic (bins, H), and continua (H, profiles).
fn of_harmonics(response: &Response, basis: &Basis) -> (Vec<DMatrix<f64>>, DMatrix<f64>) {
    let change = |map: &[f64]| {
        let (mut line, mut continuum) = (vec![0.0; response.data_len()], vec![0.0; response.profiles()]);
        response.change(map, &mut line, &mut continuum);
        (line, continuum)
    };
    // with many profiles it takes hundreds of megabytes
    let columns: Vec<(Vec<f64>, Vec<f64>)> =
        (0..basis.len()).into_par_iter().map(|h| change(basis.on_pixels.column(h).as_slice())).collect();
    let of_profile = |k: usize| {
        let bins = response.bins(k);
        let mut line = DMatrix::zeros(bins.len(), columns.len());
        for (mut to, (from, _)) in line.column_iter_mut().zip(&columns) {
            to.copy_from_slice(&from[bins.clone()]);
        }
        line
    };
    let lines = (0..response.profiles()).map(of_profile).collect();
    (lines, DMatrix::from_fn(columns.len(), response.profiles(), |h, k| columns[h].1[k]))
}

/// Lines (bins, H) of each profile compressed and transposed (H, coefficients).
fn told(condensed: &Condensed, lines: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
    lines.par_iter().enumerate().map(|(k, line)| condensed.tell(k, line).transpose()).collect()
}

/// Depths of all bins, compressed per profile.
fn told_each(condensed: &Condensed, response: &Response, depths: &[f64]) -> Vec<DVector<f64>> {
    let of_profile = |k: usize| {
        let bins = DMatrix::from_column_slice(response.bins(k).len(), 1, &depths[response.bins(k)]);
        condensed.tell(k, &bins).column(0).into_owned()
    };
    (0..response.profiles()).map(of_profile).collect()
}

/// Line depth and continuum of every profile of a uniformly spotted star.
fn uniform(response: &Response, filling: f64) -> (Vec<f64>, Vec<f64>) {
    let mut map = vec![0.0; response.pixels()];
    let (mut line, mut continuum) = (vec![0.0; response.data_len()], vec![0.0; response.profiles()]);
    response.apply_each(&mut map, &mut line, &mut continuum, |first, map| {
        map.fill(1.0 - (1.0 - response.contrast(first)) * filling);
    });
    (line, continuum)
}
