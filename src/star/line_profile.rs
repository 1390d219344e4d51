//! The local line, and its kernel on the velocity grid of the deposits.
//!
//! A pixel of velocity v is deposited on a uniform grid of step h with the quintic B-spline; the sum over the grid of
//! `deposit x kernel` must give the local line `l(v - v_p)`. So the kernel is the line deconvolved from the spline: in
//! Fourier space `l(k) / sinc(kh/2)^6`. For a Gaussian line `1/sinc^6 = exp(h^2 k^2/4 + h^4 k^4/480 + h^6 k^6/30240 +
//! ...)` gives a closed form: a Gaussian narrowed by h^2/2, times two small Hermite corrections. What remains is
//! aliasing, `2 l(k) (kh/2 pi)^6`, below 3e-7 of the line's depth for h = sigma/3.5 (the cubic spline needs h =
//! sigma/20 for that).
//!
//! A Voigt profile is treated in the same way, with its Gaussian narrowed and its fourth and sixth derivatives for the
//! Hermite corrections. Its wings extend over all bins and brightness, so that they are never cut off: of the
//! equivalent width, `(2/pi) gamma/v` lies beyond v from the centre and outside a velocity range that ends there.

use super::LocalLine;
use super::voigt;
use crate::numerics::vector::elementary::exp_minus;
use crate::numerics::vector::{self, Instructions, Task};
use std::f64::consts::TAU;

/// Reach of a Gaussian kernel in standard deviations; the tail left out is 4e-8 of the line's area.
const REACH_SIGMAS: f64 = 5.5;

/// The line must span at least this many grid steps per standard deviation.
const STEPS_PER_SIGMA: f64 = 3.5;

/// The local line deconvolved from the spline of the deposit.
#[derive(Clone, Copy, Debug)]
pub struct LineKernel {
    sigma: f64,
    gamma: f64,
    norm: f64,
    fourth: f64,
    sixth: f64,
}

impl LineKernel {
    /// Kernel of `line` for a grid of step `grid_step` (km/s).
    pub fn new(line: LocalLine, grid_step: f64) -> Self {
        let sigma = (line.sigma_kms.powi(2) - grid_step * grid_step / 2.0).sqrt();
        let ratio = grid_step / sigma;
        LineKernel {
            sigma,
            gamma: line.gamma_kms,
            norm: line.strength_kms() / (sigma * TAU.sqrt()),
            fourth: ratio.powi(4) / 480.0,
            sixth: ratio.powi(6) / 30240.0,
        }
    }

    /// How many grid steps a velocity bin of width `bin_kms` must be divided into for this line.
    pub fn steps_per_bin(line: LocalLine, bin_kms: f64) -> usize {
        (bin_kms * STEPS_PER_SIGMA / line.sigma_kms).ceil().max(1.0) as usize
    }

    /// Distance (km/s) beyond which the kernel is dropped.
    pub fn reach_kms(&self) -> f64 {
        if self.gamma > 0.0 { f64::INFINITY } else { REACH_SIGMAS * self.sigma }
    }

    /// Depths on the nodes of a grid, from the node that lies this many steps below the line's centre.
    pub fn sample(&self, first: f64, step_kms: f64, depths: &mut [f64]) {
        vector::run(Sample { kernel: self, first, step_kms, depths });
    }

    /// Depth of a Gaussian line at distance `v` (km/s) from its centre.
    #[inline(always)]
    fn gaussian(&self, i: impl Instructions, v: f64) -> f64 {
        let x2 = (v / self.sigma) * (v / self.sigma);
        let he4 = (x2 - 6.0) * x2 + 3.0;
        let he6 = ((x2 - 15.0) * x2 + 45.0) * x2 - 15.0;
        self.norm * exp_minus(i, 0.5 * x2) * (1.0 + self.fourth * he4 - self.sixth * he6)
    }

    /// Depth at distance `v` (km/s) from the centre of a line with a Lorentzian.
    fn voigt(&self, v: f64) -> f64 {
        let [w, fourth, sixth] = voigt::even_derivatives(v / self.sigma, self.gamma / self.sigma);
        self.norm * (w + self.fourth * fourth - self.sixth * sixth)
    }
}

/// The work of [`LineKernel::sample`].
struct Sample<'a> {
    kernel: &'a LineKernel,
    first: f64,
    step_kms: f64,
    depths: &'a mut [f64],
}

impl Task for Sample<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) {
        let Sample { kernel, first, step_kms, depths } = self;
        for (node, depth) in depths.iter_mut().enumerate() {
            *depth = (first - node as f64) * step_kms;
        }
        if kernel.gamma > 0.0 {
            depths.iter_mut().for_each(|depth| *depth = kernel.voigt(*depth));
        } else {
            for depth in depths {
                *depth = kernel.gaussian(i, *depth);
            }
        }
    }
}

/// Nodes of the deposit of a pixel, and terms of the polynomials of their weights.
pub const DEPOSIT_NODES: usize = 6;

/// The quintic B-spline on one grid cell: weights of the nodes -2, -1 and 0 of the cell (rows) as polynomials in the
/// position `t` in [-1/2, 1/2] from its middle (coefficients of 1, t, ... t^5). Those of the nodes 3, 2 and 1 are their
/// mirror images, with odd powers of opposite sign. All six sum to the polynomial 1.
///
/// A pixel with a spread of velocities is deposited with the means of the powers over it, `t^k + k (k - 1) t^(k-2)
/// spread` to second order, where `spread` = (variance of its velocity) / (2 h^2).
pub const DEPOSIT_WEIGHTS: [[f64; DEPOSIT_NODES]; DEPOSIT_NODES / 2] = [
    [1.0 / 3840.0, -1.0 / 384.0, 1.0 / 96.0, -1.0 / 48.0, 1.0 / 48.0, -1.0 / 120.0],
    [79.0 / 1280.0, -25.0 / 128.0, 7.0 / 32.0, -1.0 / 16.0, -1.0 / 16.0, 1.0 / 24.0],
    [841.0 / 1920.0, -77.0 / 192.0, -11.0 / 48.0, 7.0 / 24.0, 1.0 / 24.0, -1.0 / 12.0],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Depth at distance `v` (km/s) from the line's centre.
    fn at(kernel: &LineKernel, v: f64) -> f64 {
        let mut depth = [f64::NAN];
        kernel.sample(v, 1.0, &mut depth);
        depth[0]
    }

    fn gaussian(v: f64, variance: f64, area: f64) -> f64 {
        area * (-0.5 * v * v / variance).exp() / (TAU * variance).sqrt()
    }

    /// Line of a pixel at `v_p`, through the deposit.
    fn through_grid(line: LocalLine, step: f64, v: f64, v_p: f64, variance: f64) -> f64 {
        let kernel = LineKernel::new(line, step);
        let cell = (v_p / step).floor();
        let spread = variance / (2.0 * step * step);
        let weight = |row: &[f64; 6], t: f64| {
            let plus = |factor: f64| t * t + factor * spread;
            let powers = [1.0, t, plus(2.0), t * plus(6.0), t * t * plus(12.0), t * t * t * plus(20.0)];
            row.iter().zip(powers).map(|(c, power)| c * power).sum::<f64>()
        };
        let t = v_p / step - cell - 0.5;
        let line = |node: f64| at(&kernel, v - (cell + node) * step);
        let nodes = DEPOSIT_WEIGHTS.iter().zip([-2.0, -1.0, 0.0]);
        nodes.map(|(row, node)| weight(row, t) * line(node) + weight(row, -t) * line(1.0 - node)).sum()
    }

    #[test]
    fn a_voigt_profile_without_a_lorentzian_is_the_gaussian() {
        let line = LocalLine::gaussian(3.0, 5.8);
        let gaussian = LineKernel::new(line, 0.85);
        let voigt = LineKernel::new(LocalLine { gamma_kms: 1e-12, ..line }, 0.85);
        for v in (0..400).map(|i| 0.1 * f64::from(i)) {
            // rounding of the sixth derivative, which the recurrence loses up to |z|^6 of
            assert!((at(&voigt, v) - at(&gaussian, v)).abs() < 1e-12 * at(&gaussian, 0.0), "{v}");
        }
    }

    #[test]
    fn deposit_and_kernel_give_back_the_line_widened_by_the_pixel() {
        let line = LocalLine::gaussian(3.0, 5.8);
        let peak = gaussian(0.0, 9.0, 5.8);
        // a point: aliasing alone; a pixel: second order in its variance, 3/8 (0.2 / 9)^2, and the aliasing of a second
        // derivative
        for (variance, tolerance) in [(0.0, 1e-6), (0.2, 3e-4)] {
            for i in 0..200 {
                let (v, v_p) = (-9.0 + 0.09 * i as f64, 0.037 * i as f64);
                let error = through_grid(line, 0.85, v, v_p, variance) - gaussian(v - v_p, 9.0 + variance, 5.8);
                assert!(error.abs() < tolerance * peak, "v {v} v_p {v_p} variance {variance}: {error:e}");
            }
        }
    }
}
