//! The interface of data for an inversion: a misfit, its gradient and its curvature, as functions of an image.

use crate::numerics::vector::Number;

/// Which second derivative of the misfit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// That of the misfit itself: Newton steps converge quadratically.
    Exact,
    /// That of the misfit of the linearised model: never negative, however bad the fit.
    GaussNewton,
}

/// A twice differentiable misfit `chi2(s)` of an image s.
///
/// The methods refer to the image last given to [`Problem::linearise`]. Each call counts its applications of the
/// response: one for `linearise` and `gradient`, two for `curvature`.
pub trait Problem {
    /// Area of every pixel as a fraction of the whole; images have the same length.
    fn area(&self) -> &[f64];

    /// Moves to the image `s` and returns chi2.
    fn linearise(&mut self, s: &[f64]) -> f64;

    /// Gradient of chi2 / 2.
    fn gradient(&mut self, out: &mut [f64]);

    /// Second derivative of chi2 / 2 times `v`, in the precision of `v`.
    fn curvature<N: Number>(&mut self, which: Curvature, v: &[N], out: &mut [N]);

    /// Applications of the response or its transpose so far.
    fn model_applications(&self) -> u32;
}
