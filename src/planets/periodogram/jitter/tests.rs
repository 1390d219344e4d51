//! A jitter against the covariance of velocities, and its false-alarm probability.

use super::super::sample::{self, STABILITY_KMS, uneven};
use super::super::{Frequencies, FrequencySettings, Search, SearchSettings};
use super::*;

/// Against the covariance of the velocities, by dense algebra.
#[test]
fn a_jitter_adds_to_the_covariance() {
    let n = 8;
    let cycles = uneven(n, 4.0);
    let rv = 0.3 * sample::normal(n, 3);
    let without = sample::correlated(&cycles, &rv, 5);
    let jitters = Jitters::new(&without, 0.2, STABILITY_KMS);
    let covariance = without.information.clone().try_inverse().unwrap();
    let density = |s: f64| {
        let c = &covariance + DMatrix::identity(n, n) * s * s;
        (c.clone().try_inverse().unwrap(), -0.5 * c.determinant().ln())
    };
    let ln_l = |s: f64| -0.5 * rv.dot(&(density(s).0 * &rv)) + density(s).1;
    for (level, size) in jitters.levels.iter().zip(SIZES) {
        let inverse = density(0.2 * size).0;
        assert!((&level.quadratic.information - &inverse).norm() < 1e-9 * inverse.norm());
        assert!((&level.quadratic.gradient - &inverse * &rv).norm() < 1e-9 * inverse.norm());
        let above = ln_l(0.2 * size) - ln_l(0.0) - (1.0 + (0.2 * size / STABILITY_KMS).powi(2)).ln();
        assert!((level.ln_l - jitters.levels[0].ln_l - above).abs() < 1e-9, "{size}");
        // gradients of a star without a planet: C(s)^-1 C(0.2) C(s)^-1
        let c = &covariance + DMatrix::identity(n, n) * 0.04;
        let expected = &inverse * c * &inverse;
        let drawn = &level.kept * &jitters.covariance * level.kept.transpose();
        assert!((drawn - &expected).norm() < 1e-9 * expected.norm());
    }
}

fn search(n: usize, k_kms: f64, jitter_kms: f64, seed: u64) -> f64 {
    let cycles = uneven(n, 4.0);
    let rv = sample::orbit(&cycles, k_kms, 1.7, 0.3)
        + 0.03 * sample::normal(n, 1000 + seed)
        + jitter_kms * sample::normal(n, 2000 + seed);
    let without = sample::independent(&cycles, &rv, &DVector::from_element(n, 0.03));
    let found_kms = (rv.norm_squared() / n as f64 - 9e-4).max(0.0).sqrt();
    let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
    let settings = SearchSettings { draws: 1000, seed: 1 };
    let found = Search::with_jitter(&Jitters::new(&without, found_kms, STABILITY_KMS), &frequencies, settings).unwrap();
    found.false_alarm.probability(found.best().orbit.delta_ln_l).value()
}

/// Twelve velocities: a planet of 0.6 km/s looks entirely like a jitter without an orbit in the model.
#[test]
fn a_strong_planet_does_not_hide_behind_its_own_jitter() {
    let found: Vec<f64> = (0..3).map(|seed| search(12, 0.6, 0.0, seed)).collect();
    assert!(found.iter().all(|p| *p < 1e-3), "{found:?}");
}

/// A jitter alone: false-alarm probabilities are uniform.
#[test]
fn a_jitter_is_no_planet() {
    let mut found: Vec<f64> = (0..60).map(|seed| search(15, 0.0, 0.2, seed)).collect();
    found.sort_by(f64::total_cmp);
    let apart = |(k, p): (usize, &f64)| (p - (k as f64 + 0.5) / 60.0).abs();
    let distance = found.iter().enumerate().map(apart).fold(0.0, f64::max);
    // exceeded once in a thousand by chance: 1.95 / sqrt(60)
    assert!(distance < 0.25 && found[0] > 1e-4, "{distance} {found:?}");
}
