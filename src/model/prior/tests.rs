//! Tests of the priors.

use super::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn examples() -> Vec<Prior> {
    vec![
        Prior::Uniform { min: -1.5, max: 0.3 },
        Prior::LogUniform { min: 0.01, max: 4.0 },
        Prior::Normal { mean: 40.0, sd: 0.5, min: f64::NEG_INFINITY, max: f64::INFINITY },
        Prior::Normal { mean: 0.05, sd: 0.1, min: 0.0, max: 0.3 },
        Prior::Normal { mean: -2.0, sd: 0.1, min: 0.0, max: f64::INFINITY },
        Prior::Isotropic { min: 0.0, max: 90.0 },
        Prior::Isotropic { min: 20.0, max: 55.0 },
        Prior::Disc { max_eccentricity: 0.6 },
        Prior::Periodic,
    ]
}

/// A finite interval that contains all but 1e-20 of the density.
fn interval(prior: &Prior) -> (f64, f64) {
    match *prior {
        Prior::Normal { mean, sd, min, max } => {
            let reach = 10.0 * sd + (mean.clamp(min, max) - mean).abs();
            (min.max(mean - reach), max.min(mean + reach))
        }
        _ => prior.bounds(),
    }
}

/// Cumulative distribution at the right edges of `n` equal cells, by the midpoint rule.
fn cumulative(prior: &Prior, n: usize) -> (f64, f64, Vec<f64>) {
    let (lo, hi) = interval(prior);
    let width = (hi - lo) / n as f64;
    let mut sum = 0.0;
    let cells = (0..n).map(|k| {
        sum += width * prior.log_density(lo + (k as f64 + 0.5) * width).exp();
        sum
    });
    (lo, hi, cells.collect())
}

#[test]
fn densities_integrate_to_one() {
    for prior in examples() {
        let total = *cumulative(&prior, 20_000).2.last().unwrap();
        // The midpoint rule on 1/x over these cells is accurate to 3e-6.
        assert!((total - 1.0).abs() < 1e-5, "{prior:?}: {total}");
    }
}

#[test]
fn samples_follow_the_density() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    const DRAWS: usize = 20_000;
    for prior in examples() {
        let (lo, hi, cdf) = cumulative(&prior, 20_000);
        let mut draws: Vec<f64> = (0..DRAWS).map(|_| prior.sample(&mut rng)).collect();
        draws.sort_by(f64::total_cmp);
        let distance = draws.iter().enumerate().map(|(k, x)| {
            assert!(prior.contains(*x), "{prior:?}: {x}");
            let position = (x - lo) / (hi - lo) * cdf.len() as f64;
            let cell = (position as usize).min(cdf.len() - 1);
            let before = if cell == 0 { 0.0 } else { cdf[cell - 1] };
            let expected = before + (position - cell as f64) * (cdf[cell] - before);
            (expected - k as f64 / DRAWS as f64).abs().max((expected - (k + 1) as f64 / DRAWS as f64).abs())
        });
        // Kolmogorov-Smirnov: sqrt(n) D exceeds 1.95 once in a thousand.
        let distance = distance.fold(0.0, f64::max) * (DRAWS as f64).sqrt();
        assert!(distance < 1.95, "{prior:?}: {distance}");
    }
}

#[test]
fn outside_the_bounds_is_impossible() {
    for prior in examples() {
        assert_eq!(prior.log_density(f64::NAN), f64::NEG_INFINITY);
        if !matches!(prior, Prior::Periodic) {
            let (min, max) = prior.bounds();
            assert_eq!(prior.log_density(min - 1e-9), f64::NEG_INFINITY);
            assert_eq!(prior.log_density(max + 1e-9), f64::NEG_INFINITY);
        }
    }
}

#[test]
fn an_untruncated_normal_is_the_textbook_one() {
    let prior = Prior::Normal { mean: 1.0, sd: 2.0, min: f64::NEG_INFINITY, max: f64::INFINITY };
    let expected = -0.5 - 2f64.ln() - 0.5 * TAU.ln();
    assert!((prior.log_density(3.0) - expected).abs() < 1e-11);
}

#[test]
fn a_far_tail_stays_finite() {
    // The far tail of a normal is exponential with rate 30.
    let prior = Prior::Normal { mean: 0.0, sd: 1.0, min: 30.0, max: f64::INFINITY };
    assert!((prior.log_density(30.0) - 30f64.ln()).abs() < 2e-3);
}

#[test]
fn wrapping_lands_in_the_unit_interval() {
    for (x, expected) in [(0.25, 0.25), (1.0, 0.0), (-0.25, 0.75), (7.5, 0.5), (-1e-300, 0.0)] {
        assert_eq!(Prior::Periodic.wrap(x), expected);
    }
    assert_eq!(Prior::Uniform { min: 0.0, max: 1.0 }.wrap(1.5), 1.5);
}
