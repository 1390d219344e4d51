//! The linear part of the forward model: a map of the surface to the line depth and continuum of every profile, before the
//! division of one by the other; and its transpose.
//!
//! Method section 1: `sum_p w x l(v - v_p - V_k)` for every bin and `sum_p w x` for every profile. Left out: brightness
//! (what x is), the division by the continuum, data.

use super::convolution::{ProfileConvolution, Rows};
use super::deposit::{Deposit, LANES};
use super::grid::SurfaceGrid;
use super::line_profile::LineKernel;
use super::{StarSettings, StarState};
use crate::observation::Observations;
use std::sync::Arc;

/// When and at which velocities the star is observed.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Width of a velocity bin (km/s).
    pub step_kms: f64,
    /// Of each profile: time (d), velocity of its first bin (km/s), number of bins.
    pub profiles: Vec<(f64, f64, usize)>,
}

impl Sampling {
    /// The sampling of a set of observations.
    pub fn of(observations: &Observations) -> Self {
        let profile = |p: &crate::observation::Profile| (p.time_d, p.first_velocity_kms, p.intensity.len());
        Sampling { step_kms: observations.step_kms, profiles: observations.profiles.iter().map(profile).collect() }
    }

    /// Number of bins of all profiles together.
    pub fn bins(&self) -> usize {
        self.profiles.iter().map(|p| p.2).sum()
    }
}

/// Most nodes of the velocity grid, which spans twice the fastest velocity in steps of a fraction of the local line's width.
pub const MOST_NODES: f64 = u16::MAX as f64;

/// Most grid steps in a velocity bin; beyond it the line is so much narrower than a bin that it hides between two of them.
pub const MOST_STEPS_PER_BIN: f64 = 200.0;

/// The response of a sampled set of profiles to a map of the star.
#[derive(Clone, Debug)]
pub struct Response {
    deposit: Arc<Deposit>,
    convolutions: Vec<ProfileConvolution>,
    steps_per_bin: usize,
    /// First bin of each profile, and the end.
    starts: Vec<usize>,
}

impl Response {
    /// The response at one state of star and planet.
    pub fn new(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, sampling: &Sampling) -> Self {
        let steps_per_bin = LineKernel::steps_per_bin(star.line, sampling.step_kms);
        let since_epoch: Vec<f64> = sampling.profiles.iter().map(|p| p.0 - star.epoch_d).collect();
        let step = sampling.step_kms / steps_per_bin as f64;
        let deposit = Deposit::new(grid, state, star.limb_darkening, &since_epoch, step);
        Response::shifted(Arc::new(deposit), star, state, sampling)
    }

    /// Size of the velocity grid that a response takes: grid steps a bin, and nodes. Refuse more than [`MOST_STEPS_PER_BIN`] or
    /// [`MOST_NODES`] before a response is asked for.
    pub fn velocity_grid(star: &StarSettings, state: &StarState, step_kms: f64) -> (f64, f64) {
        let steps = LineKernel::steps_per_bin(star.line, step_kms) as f64;
        (steps, Deposit::nodes_at(state, star.limb_darkening, step_kms / steps))
    }

    /// The response at a state that differs from this one's by orbit and systemic velocity alone: only the line is shifted.
    pub fn with_velocities(&self, star: &StarSettings, state: &StarState, sampling: &Sampling) -> Self {
        Response::shifted(Arc::clone(&self.deposit), star, state, sampling)
    }

    fn shifted(deposit: Arc<Deposit>, star: &StarSettings, state: &StarState, sampling: &Sampling) -> Self {
        let steps_per_bin = LineKernel::steps_per_bin(star.line, sampling.step_kms);
        let kernel = LineKernel::new(star.line, deposit.step_kms);
        let mut starts = vec![0];
        let mut convolutions = Vec::with_capacity(sampling.profiles.len());
        for &(time, first_velocity, bins) in &sampling.profiles {
            let shift = state.vsys_kms + state.orbit.velocity_kms(star.cycle(time));
            let first_bin = first_velocity - shift - deposit.origin_kms;
            convolutions.push(ProfileConvolution::new(&kernel, deposit.step_kms, steps_per_bin, first_bin));
            starts.push(starts[starts.len() - 1] + bins);
        }
        Response { deposit, convolutions, steps_per_bin, starts }
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.deposit.pixels()
    }

    /// Number of profiles.
    pub fn profiles(&self) -> usize {
        self.convolutions.len()
    }

    /// Number of visible (pixel, profile) pairs.
    pub fn pairs(&self) -> usize {
        self.deposit.pairs()
    }

    /// Bins of profile `k` within the data.
    pub fn bins(&self, k: usize) -> std::ops::Range<usize> {
        self.starts[k]..self.starts[k + 1]
    }

    /// Number of data.
    pub fn data_len(&self) -> usize {
        self.starts[self.starts.len() - 1]
    }

    /// Line depth of every bin and continuum of every profile for the map `x`.
    pub fn apply(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        if has_avx2() {
            // safe: the processor has what the function needs
            #[allow(unsafe_code)]
            unsafe {
                self.apply_avx2(x, line, continuum);
            }
        } else {
            self.apply_with::<false>(x, line, continuum);
        }
    }

    /// Transpose of [`Response::apply`]; `out` is overwritten.
    pub fn apply_transpose(&self, line: &[f64], continuum: &[f64], out: &mut [f64]) {
        if has_avx2() {
            // safe: the processor has what the function needs
            #[allow(unsafe_code)]
            unsafe {
                self.apply_transpose_avx2(line, continuum, out);
            }
        } else {
            self.apply_transpose_with::<false>(line, continuum, out);
        }
    }

    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
    fn apply_avx2(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        self.apply_with::<true>(x, line, continuum);
    }

    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
    fn apply_transpose_avx2(&self, line: &[f64], continuum: &[f64], out: &mut [f64]) {
        self.apply_transpose_with::<true>(line, continuum, out);
    }

    #[inline(always)]
    fn apply_with<const FMA: bool>(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        let stride = self.deposit.nodes;
        let mut lanes = vec![0.0; LANES * stride];
        let mut rows = Rows::new(stride, self.steps_per_bin);
        for (k, convolution) in self.convolutions.iter().enumerate() {
            self.deposit.gather::<FMA>(k, x, &mut lanes);
            let (nodes, others) = lanes.split_at_mut(stride);
            for other in others.chunks_exact(stride) {
                nodes.iter_mut().zip(other).for_each(|(node, x)| *node += x);
            }
            continuum[k] = nodes.iter().sum();
            rows.interleave(nodes);
            convolution.sum_to_bins::<FMA>(&rows, &mut line[self.bins(k)]);
        }
    }

    #[inline(always)]
    fn apply_transpose_with<const FMA: bool>(&self, line: &[f64], continuum: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let mut nodes = vec![0.0; self.deposit.nodes];
        let mut rows = Rows::new(nodes.len(), self.steps_per_bin);
        for (k, convolution) in self.convolutions.iter().enumerate() {
            convolution.spread_bins::<FMA>(&line[self.bins(k)], &mut rows);
            rows.deinterleave(&mut nodes);
            nodes.iter_mut().for_each(|node| *node += continuum[k]);
            self.deposit.scatter::<FMA>(k, &nodes, out);
        }
    }

    /// Normalised depth `1 - I` of every bin for a brightness map: the observable of method section 1.
    pub fn depths(&self, brightness: &[f64]) -> Vec<f64> {
        let mut depths = vec![0.0; self.data_len()];
        let mut continuum = vec![0.0; self.profiles()];
        self.apply(brightness, &mut depths, &mut continuum);
        for (k, continuum) in continuum.iter().enumerate() {
            depths[self.bins(k)].iter_mut().for_each(|depth| *depth /= continuum);
        }
        depths
    }
}

/// Whether the vector instructions that the hot loops are compiled for as well are there (looked up once, then remembered).
fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}
