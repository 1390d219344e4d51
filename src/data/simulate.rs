//! Synthetic observations: a spotted star with its planet through the forward model, and photon noise (Petit et al.
//! 2015, section 2).
//!
//! Spots and faculae are hard-edged discs, each pixel of the star holding the fraction of it that they cover. A spot of
//! filling factor s leaves 1 - s of the surface free, which faculae brighten: `B = 1 - (1 - c) s + (1 - s) e`, with the
//! largest s and the largest excess e of the discs that overlap. With evolving spots each profile has its own map. The
//! same simulation gives the same numbers on every machine and with any number of threads.
//!
//! [`Schedule`] draws times of observation, restricted to nights at a [`Site`], [`RandomSpots`] spots; `maps` puts them
//! on a grid.

mod maps;
mod random_spots;
mod schedule;
mod site;

pub use random_spots::RandomSpots;
pub use schedule::Schedule;
pub use site::Site;

use crate::model::ParameterValues;
use crate::numerics::units::SECONDS_PER_DAY;
use crate::star::observation::{Observations, Profile};
use crate::star::{Band, Brightness, Facula, Quadrature, Response, Sampling, Seen, Spot, StarSettings, SurfaceGrid};
use crate::surface::nuisances::{LineAndContinuum, templates};
use crate::surface::photometry::Flux;
use maps::Content;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

/// Standard error of observations without noise: that of a signal-to-noise ratio of 1000.
pub const SIGMA_WITHOUT_NOISE: f64 = 1e-3;

/// Observations to be simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// The spots (radians), including evolving ones.
    pub spots: Vec<Spot>,
    /// The faculae (radians).
    pub faculae: Vec<Facula>,
    /// All parameters as simulated: those of the config, except for `truth`.
    pub truth: ParameterValues,
    /// Times of the profiles (d).
    pub times_d: Vec<f64>,
    /// Velocity of the first bin (km/s).
    pub first_velocity_kms: f64,
    /// Width of a bin (km/s).
    pub step_kms: f64,
    /// Number of bins.
    pub bins: usize,
    /// Signal-to-noise ratio of each bin; no noise if `None`.
    pub snr: Option<f64>,
    /// Seed of the noise.
    pub seed: u64,
    /// Pixels of the star.
    pub pixels: usize,
    /// Standard deviations of errors of line and continuum of each profile.
    pub continuum: LineAndContinuum,
    /// RV jitter of the profiles (km/s).
    pub velocity_jitter_kms: f64,
    /// Velocity that is added to all profiles (km/s).
    pub zero_point_kms: f64,
    /// Correlation length of the noise in bins: the sum of its correlations with all bins of a long profile, 1 for
    /// white noise.
    pub correlated_bins: f64,
    /// Exposure time of all profiles (s); instants if `None`.
    pub exposure_s: Option<f64>,
}

/// Samples per exposure of a simulated star, relative to those of the model.
const FINER_LOOKS: usize = 3;

/// Stream of the random numbers of line and continuum; noise is drawn from stream 0.
const CONTINUUM_STREAM: u64 = 1;

/// Stream of the random numbers of the RV jitter.
const ZERO_POINT_STREAM: u64 = 2;

/// Stream of the random numbers of light curves.
const FLUX_STREAM: u64 = 5;

impl Simulation {
    /// Standard error of each bin, in units of the continuum.
    pub fn sigma(&self) -> f64 {
        self.snr.map_or(SIGMA_WITHOUT_NOISE, |snr| 1.0 / snr)
    }

    /// The observations of `star`.
    pub fn observe(&self, star: &StarSettings) -> Observations {
        let grid = SurfaceGrid::equal_area(self.pixels, Quadrature::Gauss2x2);
        let state = self.truth.state();
        let zero_points = self.zero_points_kms();
        // a line shifted to the red by its RV offset equals the line evaluated on bins shifted to the blue
        let own = self.first_velocity_kms - self.zero_point_kms;
        let first = |k: usize| zero_points.get(k).map_or(own, |v| own - v);
        let profiles = self.times_d.iter().enumerate().map(|(k, time)| (*time, first(k), self.bins)).collect();
        let mut seen = Seen::from(Sampling { step_kms: self.step_kms, profiles });
        if let Some(exposure_s) = self.exposure_s {
            seen.exposures = seen.exposures(star, &state, &vec![exposure_s / SECONDS_PER_DAY; self.times_d.len()]);
            seen.exposures.iter_mut().for_each(|exposure| exposure.looks *= FINER_LOOKS);
        }
        let response = Response::of_sets(&grid, star, &state, &[seen]);
        let contrast = self.contrast(star);
        let mut depths = match self.is_changing() {
            true => {
                let content = Content::Brightness(Brightness::of_spots(contrast));
                response.depths_of_each(&self.maps(content, &grid, &self.times_d))
            }
            false => response.depths(&self.brightness(&grid, contrast)),
        };
        for (depths, nuisances) in depths.chunks_exact_mut(self.bins).zip(self.nuisances()) {
            for (j, depth) in depths.iter_mut().enumerate() {
                let changes = templates(j, self.bins, *depth).into_iter().zip(nuisances.numbers());
                *depth += changes.map(|(template, number)| template * number).sum::<f64>();
            }
        }
        let noise = self.noise(depths.len());
        let intensity: Vec<f64> = depths.iter().zip(noise).map(|(depth, noise)| 1.0 - depth + noise).collect();
        let profile = |(intensity, time_d): (&[f64], &f64)| Profile {
            time_d: *time_d,
            first_velocity_kms: self.first_velocity_kms,
            step_kms: self.step_kms,
            intensity: intensity.to_vec(),
            sigma: vec![self.sigma(); self.bins],
            exposure_s: self.exposure_s,
        };
        let profiles = intensity.chunks_exact(self.bins).zip(&self.times_d).map(profile).collect();
        Observations { profiles }
    }

    /// The flux of `star` in a band at `times_d`, over that of its bare photosphere, with noise of this standard
    /// deviation and seed.
    pub fn fluxes(&self, star: &StarSettings, band: &Band, times_d: &[f64], (sigma, seed): (f64, u64)) -> Vec<Flux> {
        /// Maps that are held at a time.
        const MAPS: usize = 64;
        let grid = SurfaceGrid::equal_area(self.pixels, Quadrature::Gauss2x2);
        let state = self.truth.state();
        let content = Content::Brightness(Brightness::of_spots(band.contrast(star, &state)));
        let still = self.maps(content, &grid, &times_d[..1]);
        let mut fluxes = Vec::with_capacity(times_d.len());
        for times_d in times_d.chunks(MAPS) {
            let changing = self.is_changing().then(|| self.maps(content, &grid, times_d));
            let flux = |(k, time_d): (usize, &f64)| {
                let map = changing.as_ref().map_or(still.column(0), |maps| maps.column(k));
                let shares = band.shares(&grid, star, &state, &[*time_d]);
                let flux = shares.iter().zip(&map).map(|(share, brightness)| share * brightness).sum::<f64>();
                // spots that are darker at the limb: weights do not sum to 1
                if star.regions.are_plain() { flux } else { flux + 1.0 - shares.iter().sum::<f64>() }
            };
            fluxes.par_extend(times_d.par_iter().enumerate().map(flux));
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(FLUX_STREAM);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let measured = |(time_d, flux): (&f64, f64)| Flux { time_d: *time_d, flux: flux + sigma * draw(), sigma };
        times_d.iter().zip(fluxes).map(measured).collect()
    }

    /// Errors of line and continuum of each profile; empty if there are none.
    pub fn nuisances(&self) -> Vec<LineAndContinuum> {
        if self.continuum == LineAndContinuum::default() {
            return Vec::new();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(CONTINUUM_STREAM);
        let mut draw = || {
            LineAndContinuum::of_numbers(self.continuum.numbers().map(|sd| {
                let normal: f64 = StandardNormal.sample(&mut rng);
                sd * normal
            }))
        };
        self.times_d.iter().map(|_| draw()).collect()
    }

    /// The RV jitter of each profile (km/s), which is added to its velocity; empty if there is none.
    pub fn zero_points_kms(&self) -> Vec<f64> {
        if self.velocity_jitter_kms == 0.0 {
            return Vec::new();
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(ZERO_POINT_STREAM);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        self.times_d.iter().map(|_| self.velocity_jitter_kms * draw()).collect()
    }

    /// Brightness of spots on `star` over that of the photosphere.
    pub fn contrast(&self, star: &StarSettings) -> f64 {
        star.with(&self.truth.state().surface).contrast
    }

    /// Gaussian noise of `n` bins, all profiles one after the other. Neighbours in a profile have the correlation
    /// `rho = (c - 1) / (c + 1)`, bins m apart rho^m, so that the correlations add up to the c `correlated_bins`.
    fn noise(&self, n: usize) -> Vec<f64> {
        if self.snr.is_none() {
            return vec![0.0; n];
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut noise: Vec<f64> = (0..n).map(|_| self.sigma() * draw()).collect();
        let rho = (self.correlated_bins - 1.0) / (self.correlated_bins + 1.0);
        if rho > 0.0 {
            for profile in noise.chunks_mut(self.bins) {
                for j in 1..profile.len() {
                    profile[j] = rho * profile[j - 1] + (1.0 - rho * rho).sqrt() * profile[j];
                }
            }
        }
        noise
    }
}
