//! The star's side of the marginal likelihood: what profiles each harmonic makes.

use super::MEAN_FILLING;
use super::basis::Basis;
use super::condense::Condensed;
use super::light::Light;
use crate::field::{Epoch, Jacobian};
use crate::star::{Response, StarState};
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// Line depth and continuum of every profile for each harmonic, before the division of one by the other; depths in the
/// few numbers that hold them.
#[derive(Clone, Debug)]
pub struct Design {
    response: Response,
    condensed: Arc<Condensed>,
    /// Of each profile (numbers, H).
    line: Vec<Arc<DMatrix<f64>>>,
    /// (H, profiles).
    continuum: DMatrix<f64>,
    /// The same of a star that is spotted alike all over, as much as stars of which nothing else is known.
    mean_line: Vec<DVector<f64>>,
    mean_continuum: Vec<f64>,
    light: Light,
}

impl Design {
    /// Of the star in `imager` at `state`. A model application a harmonic.
    pub fn new(imager: &Imager, basis: &Basis, state: &StarState) -> Self {
        Design::of(imager, basis, (imager.response(state), state), None)
    }

    /// Seen through a response at a state, in the numbers of a design that is `like` this one, of a star near by.
    pub fn of(
        imager: &Imager,
        basis: &Basis,
        (response, state): (Response, &StarState),
        like: Option<&Design>,
    ) -> Self {
        let change = |map: &[f64]| {
            let (mut line, mut continuum) = (vec![0.0; response.data_len()], vec![0.0; response.profiles()]);
            response.change(map, &mut line, &mut continuum);
            (line, continuum)
        };
        let columns: Vec<(Vec<f64>, Vec<f64>)> =
            (0..basis.degrees.len()).into_par_iter().map(|h| change(basis.on_pixels.column(h).as_slice())).collect();
        let of_profile = |k: usize| {
            let bins = response.bins(k);
            let mut line = DMatrix::zeros(bins.len(), columns.len());
            for (mut to, (from, _)) in line.column_iter_mut().zip(&columns) {
                to.copy_from_slice(&from[bins.clone()]);
            }
            line
        };
        let lines: Vec<DMatrix<f64>> = (0..response.profiles()).map(of_profile).collect();
        let continuum = DMatrix::from_fn(columns.len(), response.profiles(), |h, k| columns[h].1[k]);
        // of many profiles it is hundreds of megabytes
        drop(columns);
        let [(bare, _), (mean, mean_continuum)] = [0.0, MEAN_FILLING].map(|filling| uniform(&response, filling));
        let condensed = match like {
            Some(like) => Arc::clone(&like.condensed),
            None => Arc::new(Condensed::new(imager, basis, (&response, state), &lines, &bare)),
        };
        let line = lines.par_iter().enumerate().map(|(k, line)| Arc::new(condensed.tell(k, line))).collect();
        let mean = |k: usize| {
            let bins = DMatrix::from_column_slice(response.bins(k).len(), 1, &mean[response.bins(k)]);
            condensed.tell(k, &bins).column(0).into_owned()
        };
        let mean_line = (0..response.profiles()).map(mean).collect();
        let light = Light::new(imager, basis, state);
        Design { response, condensed, line, continuum, mean_line, mean_continuum, light }
    }

    /// Columns over the bins of each profile in its numbers.
    pub fn condensed(&self, columns: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        columns.iter().enumerate().map(|(k, columns)| self.condensed.tell(k, columns)).collect()
    }

    /// Brightness over that of the photosphere (pixels, profiles) of maps with these `coefficients` (H, epochs), as
    /// each profile sees it.
    pub fn brightness(&self, basis: &Basis, coefficients: &DMatrix<f64>) -> DMatrix<f64> {
        let mut brightness = basis.filling(&coefficients.columns(0, self.response.profiles()).into_owned());
        for (k, mut map) in brightness.column_iter_mut().enumerate() {
            let contrast = self.response.contrast(k);
            map.apply(|filling| *filling = 1.0 - (1.0 - contrast) * *filling);
        }
        brightness
    }

    /// The response that it was made with.
    pub fn response(&self) -> &Response {
        &self.response
    }

    /// Model depths of profile `k` for a map of these coefficients, and its continuum.
    fn depths(&self, k: usize, coefficients: &DVector<f64>) -> (DVector<f64>, f64) {
        let q = 1.0 - self.response.contrast(k);
        let continuum = self.mean_continuum[k] - q * self.continuum.column(k).dot(coefficients);
        ((&self.mean_line[k] - &*self.line[k] * coefficients * q) / continuum, continuum)
    }

    /// The profiles, then the bins of light curves, linearised around maps of these coefficients (H, epochs), without
    /// slopes.
    pub fn epochs(&self, imager: &Imager, maps: &DMatrix<f64>) -> Vec<Epoch> {
        let times_d = imager.times_d();
        let profiles = self.response.profiles();
        let epoch = |k: usize| self.epoch((times_d[k], imager.mean_profile), k, &maps.column(k).into_owned());
        let mut epochs: Vec<Epoch> = (0..profiles).into_par_iter().map(epoch).collect();
        epochs.extend(self.light.epochs(imager, maps.columns_range(profiles..)));
        // numbers of profiles first, then those of light curves
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

    /// What is wrong alike in all profiles, most probable for maps of these coefficients (H, epochs): a number for each
    /// of the columns of [`mean_profile`](crate::surface::mean_profile); none where nothing may be.
    pub(super) fn mean_profile(&self, imager: &Imager, maps: &DMatrix<f64>) -> DVector<f64> {
        let epochs = &self.epochs(imager, maps)[..self.response.profiles()];
        let numbers = self.condensed.mean_profile.first().map_or(0, DMatrix::ncols);
        let (mut inner, mut along) = (DMatrix::identity(numbers, numbers), DVector::zeros(numbers));
        for (epoch, alike) in epochs.iter().zip(&self.condensed.mean_profile) {
            let alike = alike * imager.mean_profile;
            // numbers are in units of the noise; nuisances of the profile take what they may
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

/// Line depth and continuum of every profile of a star that is spotted alike all over.
fn uniform(response: &Response, filling: f64) -> (Vec<f64>, Vec<f64>) {
    let mut map = vec![0.0; response.pixels()];
    let (mut line, mut continuum) = (vec![0.0; response.data_len()], vec![0.0; response.profiles()]);
    response.apply_each(&mut map, &mut line, &mut continuum, |first, map| {
        map.fill(1.0 - (1.0 - response.contrast(first)) * filling);
    });
    (line, continuum)
}
