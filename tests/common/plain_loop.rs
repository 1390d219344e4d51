//! The reference of the response: a plain loop over visible (pixel, profile) pairs, each of which has the local line in
//! a window of velocity bins around its own velocity.
//!
//! Written from the formulas of `docs/method.md` section 1 and the public table of pixel centres alone, so that it is
//! independent of the code that it is compared with.
#![allow(dead_code)]

use dimcmc::internals::star::{Sampling, StarSettings, StarState, SurfaceGrid};
use std::f64::consts::TAU;

/// The response in windows of `WINDOW` bins; of the line, what lies outside is dropped.
pub struct PlainLoop<const WINDOW: usize> {
    pairs: Vec<Pair<WINDOW>>,
    profiles: Vec<Profile>,
}

/// One visible pixel of one profile.
struct Pair<const WINDOW: usize> {
    pixel: u32,
    first_bin: u32,
    weight: f64,
    /// Weight times line in each bin of the window.
    line: [f64; WINDOW],
}

struct Profile {
    pairs: std::ops::Range<usize>,
    bins: std::ops::Range<usize>,
}

impl<const WINDOW: usize> PlainLoop<WINDOW> {
    /// Bytes of a pair.
    pub const PAIR_BYTES: usize = size_of::<Pair<WINDOW>>();

    /// The response at one state of star and planet; every profile must have at least `WINDOW` bins.
    pub fn new(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, sampling: &Sampling) -> Self {
        let mut plain = PlainLoop { pairs: Vec::new(), profiles: Vec::new() };
        let mut first_datum = 0;
        for &(time, first_velocity, bins) in &sampling.profiles {
            assert!(bins >= WINDOW, "{bins} bins are fewer than a window of {WINDOW}");
            let first_pair = plain.pairs.len();
            let shift = state.vsys_kms + state.motion.velocity_kms(star.cycle(time));
            for pixel in 0..grid.len() {
                let (mu, velocity) = look(grid, pixel, state, time - star.epoch_d);
                if mu <= 0.0 {
                    continue;
                }
                let weight = grid.area[pixel] * mu * star.limb_darkening.at(mu);
                let centre = (velocity + shift - first_velocity) / sampling.step_kms;
                let first_bin = (centre - 0.5 * (WINDOW - 1) as f64).round().clamp(0.0, (bins - WINDOW) as f64);
                let line = std::array::from_fn(|j| {
                    weight * line_depth(star, (first_bin + j as f64 - centre) * sampling.step_kms)
                });
                plain.pairs.push(Pair { pixel: pixel as u32, first_bin: first_bin as u32, weight, line });
            }
            plain
                .profiles
                .push(Profile { pairs: first_pair..plain.pairs.len(), bins: first_datum..first_datum + bins });
            first_datum += bins;
        }
        plain
    }

    /// Number of visible pairs.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Line depth of every bin and continuum of every profile for the map `x`.
    pub fn apply(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        for (profile, continuum) in self.profiles.iter().zip(continuum) {
            let bins = &mut line[profile.bins.clone()];
            bins.fill(0.0);
            *continuum = 0.0;
            for pair in &self.pairs[profile.pairs.clone()] {
                let brightness = x[pair.pixel as usize];
                *continuum += brightness * pair.weight;
                for (bin, line) in bins[pair.first_bin as usize..].iter_mut().zip(&pair.line) {
                    *bin += brightness * line;
                }
            }
        }
    }

    /// Transpose of [`PlainLoop::apply`]; `out` is overwritten.
    pub fn apply_transpose(&self, line: &[f64], continuum: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (profile, continuum) in self.profiles.iter().zip(continuum) {
            let bins = &line[profile.bins.clone()];
            for pair in &self.pairs[profile.pairs.clone()] {
                let window = &bins[pair.first_bin as usize..][..WINDOW];
                // four sums, as a compiler may not reorder one into vectors by itself
                let mut sums = [0.0; 4];
                for (bins, line) in window.chunks_exact(4).zip(pair.line.chunks_exact(4)) {
                    for i in 0..4 {
                        sums[i] += bins[i] * line[i];
                    }
                }
                out[pair.pixel as usize] += continuum * pair.weight + (sums[0] + sums[1]) + (sums[2] + sums[3]);
            }
        }
    }
}

/// Cosine of the angle to the line of sight, and velocity (km/s) in the star's frame, of a pixel's centre.
fn look(grid: &SurfaceGrid, pixel: usize, state: &StarState, since_epoch_d: f64) -> (f64, f64) {
    let (sin_latitude, cos_latitude) = grid.latitude[pixel].sin_cos();
    let omega = state.rotation.omega_eq_rad_d - state.rotation.domega_rad_d * sin_latitude * sin_latitude;
    let psi = grid.longitude[pixel] + omega * since_epoch_d;
    let mu = sin_latitude * state.inclination.cos() + cos_latitude * state.inclination.sin() * psi.cos();
    let velocity = state.vsini_kms * omega / state.rotation.omega_eq_rad_d * cos_latitude * psi.sin();
    (mu, velocity)
}

/// Depth of the local line at distance `v` (km/s) from its centre.
fn line_depth(star: &StarSettings, v: f64) -> f64 {
    let sigma = star.line.sigma_kms;
    star.line.strength_kms() / (sigma * TAU.sqrt()) * (-0.5 * (v / sigma).powi(2)).exp()
}
