//! Limits on K at one period: the 95 % upper limit from the data, and the detection limit of the search.
//!
//! Upper limit: the posterior flat in K >= 0 and in phase is, along the direction u of phase in (a, b), the Gaussian
//! `exp(b u K - u A u K^2 / 2)`. Its integral over K is an error function; that over phase is a sum over even steps,
//! which for a periodic function is exact as soon as they resolve it. Detection limit: with an orbit of that K in the
//! data, the whitened amplitude `w = L^-1 X' gradient` (`A = L L'`) is a normal deviate in the plane about `L' u K`;
//! the chance that its length exceeds `sqrt(2 level)` is taken along its mean direction, plus the mean contribution of
//! the transverse noise to the length.

use super::orbits::{Trial, eigenvalues};
use crate::numerics::normal::cumulative;
use libm::erfc;
use nalgebra::Vector2;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// Directions of phase for the upper limit: at least this many, plus this many per inverse radian of the phase
/// uncertainty.
const PHASES: f64 = 64.0;

/// Phases over which the detection probability is averaged.
const DETECTION_PHASES: usize = 24;

/// Bisections of the interval that contains a limit: to 1e-9 of it.
const HALVINGS: usize = 30;

/// The largest x in [0, `high`] at which the rising function is at most `target`.
fn rising(target: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut lo, mut hi) = (0.0, high);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (lo + hi);
        if f(middle) <= target { lo = middle } else { hi = middle }
    }
    0.5 * (lo + hi)
}

fn direction(k: usize, of: usize) -> Vector2<f64> {
    let (sin, cos) = (TAU * k as f64 / of as f64).sin_cos();
    Vector2::new(cos, sin)
}

/// The semi-amplitude (km/s) below which it lies with probability `credence`, at the period of `trial`.
pub fn upper_limit_kms(trial: &Trial, credence: f64) -> Option<f64> {
    let best = trial.orbit?;
    let (least, most) = eigenvalues(&trial.information);
    // the posterior of the phase is no narrower than this many radians
    let narrowest = (least / most).sqrt() / (1.0 + 2.0 * best.delta_ln_l).sqrt();
    let phases = (PHASES / narrowest.min(1.0)).min(1e5) as usize;
    // (weight, centre, 1/width) of the Gaussian along each direction
    let slices: Vec<(f64, f64, f64)> = (0..phases)
        .map(|k| {
            let u = direction(k, phases);
            let (slope, curvature) = (trial.gradient.dot(&u), u.dot(&(trial.information * u)));
            let weight = (0.5 * slope * slope / curvature - best.delta_ln_l).exp() / curvature.sqrt();
            (weight, slope / curvature, curvature.sqrt())
        })
        .filter(|(weight, centre, narrowness)| weight * narrowness > 1e-12 && centre * narrowness > -7.0)
        .collect();
    let below = |k: f64| {
        let part = |(weight, centre, narrowness): &(f64, f64, f64)| {
            let at = |k: f64| -erfc((k - centre) * narrowness * FRAC_1_SQRT_2);
            weight * (at(k) - at(0.0))
        };
        slices.iter().map(part).sum::<f64>()
    };
    let high = best.k_kms + 9.0 / least.sqrt();
    Some(rising(credence * below(high), high, below))
}

/// The semi-amplitude (km/s) with which a planet at the period of `trial` lifts ln L above `level` with that
/// probability.
pub fn detection_limit_kms(trial: &Trial, level: f64, probability: f64) -> Option<f64> {
    trial.orbit?;
    let factor = trial.information.cholesky()?.l();
    let threshold = (2.0 * level).sqrt();
    let detected = |k: f64| {
        let chance = |j: usize| {
            let length = (factor.tr_mul(&direction(j, DETECTION_PHASES)) * k).norm();
            let longer = 0.5 / length.max(1.0);
            cumulative(length + longer - threshold)
        };
        (0..DETECTION_PHASES).map(chance).sum::<f64>() / DETECTION_PHASES as f64
    };
    let least = eigenvalues(&trial.information).0.sqrt();
    Some(rising(probability, (threshold + 6.0) / least, detected))
}

#[cfg(test)]
mod tests {
    use super::super::orbits::at;
    use super::super::sample::{self, uneven};
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Against a Monte Carlo: draws of the Gaussian in (a, b) have weights 1/K, which makes them flat in K and phase.
    #[test]
    fn the_upper_limit_holds_its_share_of_the_posterior() {
        let cycles = uneven(25, 3.0);
        for (k, seed) in [(0.0, 1), (0.05, 2), (0.4, 3)] {
            let rv = sample::orbit(&cycles, k, 1.4, 0.2) + 0.05 * sample::normal(25, seed);
            let trial = at(&sample::correlated(&cycles, &rv, seed), 1.0 / 1.4);
            let limit = upper_limit_kms(&trial, 0.95).unwrap();
            let covariance = trial.information.try_inverse().unwrap();
            let (centre, factor) = (covariance * trial.gradient, covariance.cholesky().unwrap().l());
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (mut inside, mut all) = (0.0, 0.0);
            for _ in 0..400_000 {
                let z = Vector2::new(rng.sample::<f64, _>(StandardNormal), rng.sample(StandardNormal));
                let k = (centre + factor * z).norm();
                all += 1.0 / k;
                inside += if k < limit { 1.0 / k } else { 0.0 };
            }
            // weights 1/K diverge near K = 0 and leave the Monte Carlo errors of some parts in a thousand
            assert!((inside / all - 0.95_f64).abs() < 4e-3, "{k}: {}", inside / all);
        }
    }

    #[test]
    fn a_planet_at_the_detection_limit_is_found_as_often_as_it_says() {
        let cycles = uneven(25, 3.0);
        let quadratic = sample::correlated(&cycles, &nalgebra::DVector::zeros(25), 9);
        let trial = at(&quadratic, 1.0 / 1.1);
        let level = 8.0;
        let factor = trial.information.cholesky().unwrap().l();
        for probability in [0.5, 0.95] {
            let k = detection_limit_kms(&trial, level, probability).unwrap();
            let mut rng = ChaCha8Rng::seed_from_u64(5);
            let n = 40_000;
            let mut found = 0;
            for _ in 0..n {
                let phase: f64 = rng.random_range(0.0..TAU);
                let z = Vector2::new(rng.sample::<f64, _>(StandardNormal), rng.sample(StandardNormal));
                let w = factor.tr_mul(&Vector2::new(phase.cos(), phase.sin())) * k + z;
                found += usize::from(0.5 * w.norm_squared() > level);
            }
            // the counts scatter by 0.0025; the length is taken to first order
            assert!((found as f64 / n as f64 - probability).abs() < 0.01, "{found} for {probability}");
        }
    }
}
