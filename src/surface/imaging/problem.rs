//! The misfit of maps to profiles through one response, with its gradient and curvature: the problem for the
//! maximum-entropy solver.

use super::Data;
use super::profile::{Bend, Misfit, Pull};
use crate::maxent::{Curvature, Problem};
use crate::numerics::vector::linear::combine;
use crate::numerics::vector::{self, Number};
use crate::star::{Brightness, Response};

/// The misfit of maps to profiles, for one response.
pub struct ImagingProblem<'a> {
    area: &'a [f64],
    data: &'a Data,
    response: Response,
    brightness_of: Vec<Brightness>,
    model_applications: u32,
    single_applications: u32,
    /// Model depth of every bin at the current map.
    model: Vec<f64>,
    /// `W (model - data)`, without nuisances `(model - data) / sigma^2`.
    weighted_residual: Vec<f64>,
    continuum: Vec<f64>,
    brightness: Vec<f64>,
    bins: Vec<f64>,
    /// Residuals or changes of the model, before weighting.
    differences: Vec<f64>,
    constants: Vec<f64>,
}

impl<'a> ImagingProblem<'a> {
    /// The problem of `data` seen through `response` on pixels of area fraction `area`, with spots of brightness
    /// `contrast`.
    pub fn new(area: &'a [f64], data: &'a Data, response: Response, contrast: f64) -> Self {
        let brightness = vec![Brightness::of_spots(contrast); response.profiles()];
        ImagingProblem::of_brightness(area, data, response, brightness)
    }

    /// The problem of `data` seen through `response` on pixels of area fraction `area`, with one map or several, which
    /// give the brightness for each profile.
    pub(super) fn of_brightness(
        area: &'a [f64],
        data: &'a Data,
        response: Response,
        brightness_of: Vec<Brightness>,
    ) -> Self {
        let (pixels, bins, profiles) = (area.len(), response.data_len(), response.profiles());
        ImagingProblem {
            area,
            data,
            response,
            brightness_of,
            model_applications: 0,
            single_applications: 0,
            model: vec![0.0; bins],
            weighted_residual: vec![0.0; bins],
            continuum: vec![0.0; profiles],
            brightness: vec![0.0; pixels],
            bins: vec![0.0; bins],
            differences: vec![0.0; bins],
            constants: vec![0.0; profiles],
        }
    }

    /// Number of its model applications in single precision.
    pub fn single_applications(&self) -> u32 {
        self.single_applications
    }

    /// Model depth `1 - I` of every bin at the current map.
    pub fn model(&self) -> &[f64] {
        &self.model
    }

    /// Weights times model minus data, at the current map.
    pub fn weighted_residual(&self) -> &[f64] {
        &self.weighted_residual
    }

    /// The response of the problem.
    pub fn response(&self) -> &Response {
        &self.response
    }

    /// Gradient of the contribution of the given profiles to chi2 / 2, with respect to the map, at the current map.
    pub fn gradient_of(&self, profiles: std::ops::Range<usize>, out: &mut [f64]) {
        self.pulled(profiles, &self.weighted_residual, out);
    }

    /// `J^T x` for the bins of the given profiles, J the derivative of the model with respect to the map.
    pub fn pulled(&self, profiles: std::ops::Range<usize>, x: &[f64], out: &mut [f64]) {
        let (mut bins, mut constants) = (vec![0.0; self.bins.len()], vec![0.0; self.constants.len()]);
        for k in profiles {
            constants[k] = self.pull(k, x, &mut bins);
        }
        self.response.apply_transpose(&bins, &constants, out);
    }

    /// The input of the transpose from profile `k` for such a residual: its bins, and the constant for its continuum.
    fn pull(&self, k: usize, weighted_residual: &[f64], back: &mut [f64]) -> f64 {
        let (bins, scale) = (self.response.bins(k), self.brightness_of[k].slope / self.continuum[k]);
        let (model, weighted_residual) = (&self.model[bins.clone()], &weighted_residual[bins.clone()]);
        vector::run(Pull { scale, model, weighted_residual, back: &mut back[bins] })
    }

    /// Change of every bin's model depth to first order in the change `v` of the map, at the current map.
    pub fn model_change(&mut self, v: &[f64], out: &mut [f64]) {
        self.model_applications += 1;
        self.response.change(v, out, &mut self.constants);
        for k in 0..self.response.profiles() {
            let scale = self.brightness_of[k].slope / self.continuum[k];
            for j in self.response.bins(k) {
                out[j] = scale * (out[j] - self.model[j] * self.constants[k]);
            }
        }
    }

    /// Derivative of chi2 / 2 along the image direction `v` at the current map.
    pub fn slope(&mut self, v: &[f64]) -> f64 {
        let mut change = std::mem::take(&mut self.bins);
        self.model_change(v, &mut change);
        let slope = change.iter().zip(&self.weighted_residual).map(|(change, residual)| change * residual).sum();
        self.bins = change;
        slope
    }
}

impl Problem for ImagingProblem<'_> {
    fn area(&self) -> &[f64] {
        self.area
    }

    fn linearise(&mut self, s: &[f64]) -> f64 {
        self.model_applications += 1;
        let ImagingProblem { response, brightness_of, brightness, model, continuum, .. } = self;
        response.apply_each(brightness, model, continuum, |first, map| {
            let brightness_of = brightness_of[first];
            combine(map, s, |_, s| brightness_of.at(s));
        });
        let ImagingProblem { response, data, model, weighted_residual, continuum, differences, .. } = self;
        let chi2_of = |(k, continuum): (usize, &f64)| {
            let (bins, continuum) = (response.bins(k), *continuum);
            vector::run(Misfit { data, bins, continuum, model, differences, weighted_residual })
        };
        continuum.iter().enumerate().map(chi2_of).sum()
    }

    fn gradient(&mut self, out: &mut [f64]) {
        self.model_applications += 1;
        let mut bins = std::mem::take(&mut self.bins);
        for k in 0..self.response.profiles() {
            self.constants[k] = self.pull(k, &self.weighted_residual, &mut bins);
        }
        self.bins = bins;
        self.response.apply_transpose(&self.bins, &self.constants, out);
    }

    fn curvature<N: Number>(&mut self, which: Curvature, v: &[N], out: &mut [N]) {
        self.model_applications += 2;
        self.single_applications += if N::SINGLE { 2 } else { 0 };
        let exact = which == Curvature::Exact;
        let ImagingProblem {
            response,
            data,
            brightness_of,
            model,
            weighted_residual,
            continuum,
            differences,
            bins: weighed,
            ..
        } = self;
        response.apply_and_back(v, out, |k, line, d_continuum| {
            let (bins, scale) = (response.bins(k), brightness_of[k].slope / continuum[k]);
            vector::run(Bend {
                data,
                bins,
                scale,
                exact,
                model,
                weighted_residual,
                differences,
                weighed,
                d_continuum,
                line,
            })
        });
    }

    fn model_applications(&self) -> u32 {
        self.model_applications
    }
}
