//! The RV jitter s from the velocities of the profiles, spots marginalised out.
//!
//! The image counts an RV jitter s0 as noise of the profiles. Its most likely velocities `v = I^-1 g` do not depend on
//! s0, as velocity and jitter enter the profiles alike, and their covariance is `C_f + (s^2 - s0^2) 1`, where `C_f =
//! I^-1 (noise + f (I - noise)) I^-1` has unresolved spots f times as large in variance as the entropy expects. So v
//! has a Gaussian density, from which s follows: uniform in s and in ln f, marginalised over f, with a free velocity
//! common to all profiles. The estimate is the root of the mean of s^2, which adds to the variance of a velocity.
//!
//! Without an orbit in the model a planet would be absorbed by the jitter, and hidden. With `A^2` the variance of the
//! velocities, an orbit with both amplitudes N(0, A^2) adds `A^2 X X^t` to their covariance, X its cosine and sine. The
//! odds for an orbit of any period (uniform in frequency) against none, both hypotheses marginalised over s and f, are
//! those of the densities; by chance, without an orbit, they exceed c with a probability of at most 1/c. So s is
//! estimated together with the orbit of the highest density where the odds are larger than the inverse of the
//! false-alarm probability of a candidate.

use super::MeasuredJitter;
use crate::numerics::logarithms::ln_sum;
use crate::planets::periodogram::{Frequencies, FrequencySettings};
use crate::planets::verdict::CANDIDATE_FAP;
use crate::surface::expansion::Expansion;
use crate::surface::static_map::UNRESOLVED_SPOTS;
use nalgebra::{DMatrix, DVector, Matrix2, SymmetricEigen, Vector2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Sizes of unresolved spots for each factor of ten.
const SIZES_PER_DECADE: f64 = 2.0;

/// Trial frequencies per inverse time base.
const OVERSAMPLING: f64 = 4.0;

/// Trial frequencies that share one matrix product.
const BLOCK: usize = 128;

/// Smallest s, in units of the least uncertain velocity: the profiles cannot distinguish it from 0.
const SMALLEST: f64 = 0.02;

/// Largest s, in units of the scatter of the velocities.
const LARGEST: f64 = 5.0;

/// Steps in s, relative: for estimates, and for the odds of an orbit.
const STEPS: (f64, f64) = (0.01, 0.08);

/// Values of s are omitted where their density is this far below the highest (in ln).
const NEGLIGIBLE: f64 = 12.0;

/// Rounding limits variances to at least this fraction of the largest.
const ROUNDING: f64 = 1e-9;

/// An RV jitter with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scatter {
    /// The standard deviation (km/s).
    pub kms: f64,
    /// Its standard error (km/s).
    pub error_kms: f64,
}

/// The jitter with an orbit in the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BesideOrbit {
    /// The jitter.
    #[serde(flatten)]
    pub scatter: Scatter,
    /// Period of the orbit over the rotation period.
    pub porb_over_prot: f64,
    /// Its semi-amplitude (km/s).
    pub k_kms: f64,
    /// ln of the odds for an orbit, of any period, against none.
    pub ln_odds: f64,
    /// Whether these are large enough for the jitter with the orbit to be used.
    pub counts: bool,
}

/// The velocities for one size of unresolved spots, along the axes of their covariance without jitter.
struct Size {
    variance: DVector<f64>,
    velocity: DVector<f64>,
    axes: DMatrix<f64>,
}

/// Densities of an orbit at the trial frequencies.
struct Orbits {
    /// ln of the density at each frequency, marginalised over sizes of spots and jitter.
    ln_density: Vec<f64>,
    /// The frequency, size of spots and s of the highest density.
    best: (usize, usize, f64),
}

/// The RV jitter in an `expansion` that counts it as `counted_kms`; `None` where there are too few velocities, or they
/// are not bounded.
pub(super) fn fit(expansion: &Expansion, counted_kms: f64, rotation_period_d: f64) -> Option<MeasuredJitter> {
    let profiles = expansion.profiles();
    if profiles < 3 {
        return None;
    }
    let quadratic = expansion.velocities(&[]);
    let (velocities, _) = quadratic.radial_velocities().ok()?;
    let noise = expansion.covariance_of_best(0.0)?;
    let spots = expansion.covariance_of_best(1.0)? - &noise;
    let noise = noise - DMatrix::identity(profiles, profiles) * counted_kms.powi(2);
    // directions that do not constrain a velocity common to all profiles
    let apart = contrasts(profiles);
    let velocities = &apart * velocities;
    let [noise, spots] = [noise, spots].map(|covariance| &apart * covariance * apart.transpose());
    let sizes: Vec<Size> = factors().map(|f| Size::new(&noise + f * &spots, &velocities)).collect();
    let variance = velocities.norm_squared() / velocities.len() as f64;
    let least = sizes[0].variance.min().max(ROUNDING * variance).sqrt();
    let range = (SMALLEST * least, LARGEST * variance.sqrt().max(least));
    let fine = steps(range, STEPS.0);
    let alone: Vec<Vec<f64>> = fine.iter().map(|s| sizes.iter().map(|size| size.ln_density(*s)).collect()).collect();
    let alone: Vec<f64> = alone.iter().map(|densities| ln_sum(densities)).collect();
    let without_planet = scatter(&fine, &alone);
    let beside = |frequencies: Frequencies| {
        let likely = likely(&fine, &alone, range.0);
        beside_orbit(&quadratic.cycles, &apart, &sizes, &frequencies.per_cycle, &likely, (&fine, variance))
    };
    let settings = FrequencySettings { oversampling: Some(OVERSAMPLING), ..FrequencySettings::default() };
    let beside_orbit = Frequencies::new(&quadratic.cycles, rotation_period_d, settings).ok().map(beside);
    let value_kms = beside_orbit.filter(|o| o.counts).map_or(without_planet, |o| o.scatter).kms;
    value_kms.is_finite().then_some(MeasuredJitter { value_kms, without_planet, beside_orbit })
}

/// Sizes of unresolved spots, in variance over that which the entropy expects.
fn factors() -> impl Iterator<Item = f64> {
    let places = (SIZES_PER_DECADE * (UNRESOLVED_SPOTS.1 / UNRESOLVED_SPOTS.0).log10()).round() as i32;
    (0..=places).map(|place| UNRESOLVED_SPOTS.0 * 10f64.powf(f64::from(place) / SIZES_PER_DECADE))
}

/// Values from the first to the last of `range`, each larger than the previous one by this fraction.
fn steps((first, last): (f64, f64), share: f64) -> Vec<f64> {
    let count = ((last / first).ln() / share).ceil() as usize;
    (0..=count).map(|k| first * (share * k as f64).exp()).collect()
}

/// The values of s at which orbits are tried: those that are likely without one, and all smaller ones.
fn likely(s: &[f64], ln_density: &[f64], first: f64) -> Vec<f64> {
    let highest = ln_density.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let last = s.iter().zip(ln_density).rev().find(|(_, ln)| **ln > highest - NEGLIGIBLE).map_or(first, |(s, _)| *s);
    steps((first, last.max(2.0 * first)), STEPS.1)
}

/// Root of the mean square of s and its standard deviation, where s has these densities at values of equal ratios.
fn scatter(s: &[f64], ln_density: &[f64]) -> Scatter {
    let highest = ln_density.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // the steps have the width s
    let weights: Vec<f64> = s.iter().zip(ln_density).map(|(s, ln)| s * (ln - highest).exp()).collect();
    let all: f64 = weights.iter().sum();
    let mean = |power: i32| s.iter().zip(&weights).map(|(s, w)| w * s.powi(power)).sum::<f64>() / all;
    let (first, second) = (mean(1), mean(2));
    Scatter { kms: rounded(second.sqrt()), error_kms: rounded((second - first * first).max(0.0).sqrt()) }
}

/// The orbit that explains the velocities best, and the jitter with it.
fn beside_orbit(
    cycles: &[f64],
    apart: &DMatrix<f64>,
    sizes: &[Size],
    frequencies: &[f64],
    likely: &[f64],
    (fine, variance): (&[f64], f64),
) -> BesideOrbit {
    let orbits = Orbits::new(cycles, apart, sizes, frequencies, likely, variance);
    let alone: Vec<f64> = sizes.iter().flat_map(|size| likely.iter().map(|s| s.ln() + size.ln_density(*s))).collect();
    let ln_odds = ln_sum(&orbits.ln_density) - (frequencies.len() as f64).ln() - ln_sum(&alone);
    let (frequency, size, s) = orbits.best;
    let wave = apart * waves(cycles, &frequencies[frequency..=frequency]);
    let along: Vec<DMatrix<f64>> = sizes.iter().map(|size| size.axes.tr_mul(&wave)).collect();
    let densities: Vec<f64> = fine
        .iter()
        .map(|s| {
            let of = |(size, along): (&Size, &DMatrix<f64>)| size.ln_density(*s) + size.orbit(*s, along, variance).0;
            ln_sum(&sizes.iter().zip(&along).map(of).collect::<Vec<_>>())
        })
        .collect();
    BesideOrbit {
        scatter: scatter(fine, &densities),
        porb_over_prot: 1.0 / frequencies[frequency],
        k_kms: rounded(sizes[size].orbit(s, &along[size], variance).1),
        ln_odds,
        counts: ln_odds > -CANDIDATE_FAP.ln(),
    }
}

impl Size {
    fn new(covariance: DMatrix<f64>, velocities: &DVector<f64>) -> Self {
        let eigen = SymmetricEigen::new(0.5 * (&covariance + covariance.transpose()));
        let floor = ROUNDING * eigen.eigenvalues.max();
        let velocity = eigen.eigenvectors.tr_mul(velocities);
        Size { variance: eigen.eigenvalues.map(|e| e.max(floor)), velocity, axes: eigen.eigenvectors }
    }

    /// ln of the density of the velocities with an RV jitter `s`, up to a constant.
    fn ln_density(&self, s: f64) -> f64 {
        let term = |(variance, velocity): (&f64, &f64)| {
            let all = variance + s * s;
            all.ln() + velocity * velocity / all
        };
        -0.5 * self.variance.iter().zip(&self.velocity).map(term).sum::<f64>()
    }

    /// The gain by an orbit with cosine and sine `along` the axes, and its semi-amplitude.
    fn orbit(&self, s: f64, along: &DMatrix<f64>, amplitude2: f64) -> (f64, f64) {
        let weight = self.variance.map(|variance| 1.0 / (variance + s * s));
        let weighted = DMatrix::from_diagonal(&weight) * along;
        let information = weighted.tr_mul(along);
        let gradient = weighted.tr_mul(&self.velocity);
        let matrix = Matrix2::new(information[(0, 0)], information[(0, 1)], information[(1, 0)], information[(1, 1)]);
        gain(matrix, Vector2::new(gradient[0], gradient[1]), amplitude2)
    }
}

impl Orbits {
    fn new(
        cycles: &[f64],
        apart: &DMatrix<f64>,
        sizes: &[Size],
        frequencies: &[f64],
        likely: &[f64],
        amplitude2: f64,
    ) -> Self {
        let mut all = Orbits { ln_density: vec![f64::NEG_INFINITY; frequencies.len()], best: (0, 0, likely[0]) };
        let mut highest = f64::NEG_INFINITY;
        for (number, size) in sizes.iter().enumerate() {
            let alone: Vec<f64> = likely.iter().map(|s| s.ln() + size.ln_density(*s)).collect();
            let weights = DMatrix::from_fn(likely.len(), size.variance.len(), |row, i| {
                1.0 / (size.variance[i] + likely[row].powi(2))
            });
            let block = |frequencies: &[f64]| size.gains(&(apart * waves(cycles, frequencies)), &weights, amplitude2);
            let gains: Vec<Vec<f64>> = frequencies.par_chunks(BLOCK).flat_map_iter(block).collect();
            for (f, gains) in gains.into_iter().enumerate() {
                let here: Vec<f64> = gains.iter().zip(&alone).map(|(gain, alone)| gain + alone).collect();
                all.ln_density[f] = ln_sum(&[all.ln_density[f], ln_sum(&here)]);
                let at = (0..here.len()).max_by(|&a, &b| here[a].total_cmp(&here[b])).expect("some values");
                if here[at] > highest {
                    highest = here[at];
                    all.best = (f, number, likely[at]);
                }
            }
        }
        all
    }
}

impl Size {
    /// Gains in the density by orbits with these cosines and sines, two columns per frequency, by frequency and row of
    /// the `weights`.
    fn gains(&self, waves: &DMatrix<f64>, weights: &DMatrix<f64>, amplitude2: f64) -> Vec<Vec<f64>> {
        let along = self.axes.tr_mul(waves);
        let count = along.ncols() / 2;
        let products = DMatrix::from_fn(along.nrows(), 5 * count, |i, column| {
            let (cos, sin) = (along[(i, 2 * (column / 5))], along[(i, 2 * (column / 5) + 1)]);
            [cos * cos, cos * sin, sin * sin, cos * self.velocity[i], sin * self.velocity[i]][column % 5]
        });
        let sums = weights * products;
        let at = |f: usize, row: usize| {
            let of = |column: usize| sums[(row, 5 * f + column)];
            gain(Matrix2::new(of(0), of(1), of(1), of(2)), Vector2::new(of(3), of(4)), amplitude2).0
        };
        (0..count).map(|f| (0..weights.nrows()).map(|row| at(f, row)).collect()).collect()
    }
}

/// The gain in ln of the velocities' density by two amplitudes of variance `amplitude2`, given their information and
/// gradient, and their most likely length.
fn gain(information: Matrix2<f64>, gradient: Vector2<f64>, amplitude2: f64) -> (f64, f64) {
    let with_prior = information + Matrix2::identity() / amplitude2;
    let Some(covariance) = with_prior.try_inverse() else { return (f64::NEG_INFINITY, 0.0) };
    let best = covariance * gradient;
    let determinant = (with_prior * amplitude2).determinant();
    (0.5 * (gradient.dot(&best) - determinant.ln()), best.norm())
}

/// Cosine and sine of each frequency (orbits per rotation cycle), two columns each.
fn waves(cycles: &[f64], frequencies: &[f64]) -> DMatrix<f64> {
    let mean = cycles.iter().sum::<f64>() / cycles.len() as f64;
    DMatrix::from_fn(cycles.len(), 2 * frequencies.len(), |k, column| {
        let (sin, cos) = (TAU * frequencies[column / 2] * (cycles[k] - mean)).sin_cos();
        if column % 2 == 0 { cos } else { sin }
    })
}

/// Orthonormal rows that span all vectors with a mean of 0 (Helmert's).
fn contrasts(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n - 1, n, |row, column| {
        let size = (row + 1) as f64;
        let norm = (size * (size + 1.0)).sqrt();
        match column {
            _ if column <= row => 1.0 / norm,
            _ if column == row + 1 => -size / norm,
            _ => 0.0,
        }
    })
}

/// Three digits: the last bits of a fit are not significant, and all later results depend on them.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ParameterValues;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// The jitter that is counted.
    const COUNTED_KMS: f64 = 0.3;

    /// Thirty profiles of 0.03 km/s photon noise, an RV jitter `s`, unresolved spots of thirty times the variance that
    /// the entropy expects, a common velocity, and an orbit.
    fn drawn(rng: &mut ChaCha8Rng, s: f64, k_kms: f64) -> Expansion {
        let n = 30;
        let cycles: Vec<f64> = (0..n).map(|k| 0.31 * k as f64 + rng.random_range(0.0..0.2)).collect();
        let mut normal =
            |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| rng.sample::<f64, _>(StandardNormal));
        let star = waves(&cycles, &[1.0, 2.0]) * 0.02;
        let spots = &star * star.transpose();
        let [photons, counted] = [0.03, COUNTED_KMS].map(|sd: f64| DMatrix::identity(n, n) * sd.powi(2));
        let orbit = waves(&cycles, &[1.0 / 1.7]).column(0) * k_kms;
        let white = normal(n, 1).column(0) * 0.03f64.hypot(s);
        let velocities = white + (star * normal(4, 1)).column(0) * 30f64.sqrt() + orbit;
        let velocities = velocities + DVector::from_element(n, 0.4);
        let information = (&photons + &counted + spots).cholesky().unwrap().inverse();
        Expansion {
            values: ParameterValues::of_eight([0.0, 1.7, 0.0, 2.0, 0.0, 40.0, 40.0, 0.0]),
            cycles,
            stellar: Vec::new(),
            log_likelihood: 0.0,
            centre: DVector::zeros(n),
            gradient: &information * velocities,
            noise: &information * (photons + counted) * &information,
            information,
        }
    }

    fn fits(s: f64, k_kms: f64) -> Vec<MeasuredJitter> {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        (0..60).map(|_| fit(&drawn(&mut rng, s, k_kms), COUNTED_KMS, 3.0).unwrap()).collect()
    }

    fn counted(fits: &[MeasuredJitter]) -> usize {
        fits.iter().filter(|found| found.beside_orbit.unwrap().counts).count()
    }

    #[test]
    fn the_scatter_comes_back_within_its_error() {
        for s in [0.05, 0.1, 0.2] {
            let fits = fits(s, 0.0);
            let pull = |found: &MeasuredJitter| (found.value_kms - s) / found.without_planet.error_kms;
            let squares = fits.iter().map(|found| pull(found).powi(2)).sum::<f64>() / fits.len() as f64;
            let mean = fits.iter().map(|found| found.value_kms).sum::<f64>() / fits.len() as f64;
            // one of 30 profiles constrains it to 13 %, sixty of them to 2 %; a mean of squares is above the most
            // likely value
            assert!((mean / s - 1.0).abs() < 0.1 && (0.5..1.5).contains(&squares.sqrt()), "{s}: {mean} {squares}");
            assert!(counted(&fits) <= 2, "{s}: {}", counted(&fits));
        }
    }

    /// Velocities that are exact except for photon noise show little.
    #[test]
    fn without_zero_points_little_is_found() {
        let fits = fits(0.0, 0.0);
        let square = fits.iter().map(|found| found.value_kms.powi(2)).sum::<f64>() / fits.len() as f64;
        // 30 profiles constrain the square of 0.03 to 26 %
        assert!(square.sqrt() < 0.02, "{}", square.sqrt());
        assert!(counted(&fits) <= 2);
    }

    /// With an orbit of ten standard errors the jitter is the same as without one.
    #[test]
    fn a_planet_is_not_taken_for_zero_points() {
        let fits = fits(0.1, 10.0 * 0.104 * (2.0f64 / 30.0).sqrt());
        assert!(counted(&fits) >= 58, "{}", counted(&fits));
        let mean = fits.iter().map(|found| found.value_kms).sum::<f64>() / fits.len() as f64;
        assert!((mean / 0.1 - 1.0).abs() < 0.12, "{mean}");
        let right =
            |found: &&MeasuredJitter| (1.0 / found.beside_orbit.unwrap().porb_over_prot - 1.0 / 1.7).abs() < 0.1;
        assert!(fits.iter().filter(right).count() >= 55);
    }
}
