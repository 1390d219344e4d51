//! One observed profile, given line and continuum of a map from the response: its misfit, and the input of the
//! transposed response for gradient and curvature of chi2 / 2.
//!
//! Vectors have the length of the data; a profile uses some of the bins.

use super::data::Data;
use crate::numerics::vector::linear::short_dot;
use crate::numerics::vector::{Instructions, Task};
use std::ops::Range;

/// Computes the model depth `D = line / continuum` and its weighted residual; returns chi2 of the profile.
pub struct Misfit<'a> {
    pub data: &'a Data,
    pub bins: Range<usize>,
    pub continuum: f64,
    /// The line on input, the depth on output.
    pub model: &'a mut [f64],
    pub differences: &'a mut [f64],
    pub weighted_residual: &'a mut [f64],
}

impl Task for Misfit<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let Misfit { data, bins, continuum, model, differences, weighted_residual } = self;
        let residuals = differences[bins.clone()].iter_mut().zip(&data.depth[bins.clone()]);
        for (model, (residual, depth)) in model[bins.clone()].iter_mut().zip(residuals) {
            *model /= continuum;
            *residual = *model - depth;
        }
        data.weigh(i, bins.clone(), differences, weighted_residual);
        short_dot(i, &differences[bins.clone()], &weighted_residual[bins])
    }
}

/// Computes the input of the transpose for the gradient: the profile's `back`; returns that of the continuum.
pub struct Pull<'a> {
    /// Slope of the brightness over the continuum.
    pub scale: f64,
    pub model: &'a [f64],
    pub weighted_residual: &'a [f64],
    pub back: &'a mut [f64],
}

impl Task for Pull<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let Pull { scale, model, weighted_residual, back } = self;
        back.iter_mut().zip(weighted_residual).for_each(|(back, residual)| *back = scale * residual);
        -short_dot(i, back, model)
    }
}

/// Computes the input of the transpose for the curvature, `J^T W J v` plus that of the model: with `dD = (line(dB) - D
/// dC) / C`, the second derivative of `D = N/C` in directions v and x is `-(dD[v] dC[x] + dD[x] dC[v]) / C`. Returns
/// that of the continuum.
pub struct Bend<'a> {
    pub data: &'a Data,
    pub bins: Range<usize>,
    /// Slope of the brightness over the continuum.
    pub scale: f64,
    /// Whether the model's curvature is included.
    pub exact: bool,
    /// At the current map.
    pub model: &'a [f64],
    pub weighted_residual: &'a [f64],
    pub differences: &'a mut [f64],
    pub weighed: &'a mut [f64],
    /// Continuum of the change of the map.
    pub d_continuum: f64,
    /// The profile's line of the change of the map on input, the input of the transpose on output.
    pub line: &'a mut [f64],
}

impl Task for Bend<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let Bend { data, bins, scale, exact, model, weighted_residual, differences, weighed, d_continuum, line } = self;
        let (model, residual) = (&model[bins.clone()], &weighted_residual[bins.clone()]);
        let d_continuum = scale * d_continuum;
        for ((d_model, line), model) in differences[bins.clone()].iter_mut().zip(&*line).zip(model) {
            *d_model = scale * line - model * d_continuum;
        }
        data.weigh(i, bins.clone(), differences, weighed);
        line.iter_mut().zip(&weighed[bins.clone()]).for_each(|(back, weighed)| *back = scale * weighed);
        if !exact {
            return -short_dot(i, line, model);
        }
        line.iter_mut().zip(residual).for_each(|(back, residual)| *back -= scale * d_continuum * residual);
        -short_dot(i, line, model) - scale * short_dot(i, residual, &differences[bins])
    }
}
