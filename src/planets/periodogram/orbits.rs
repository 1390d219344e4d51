//! The best circular orbit at each trial period: a generalised least-squares sine fit (Zechmeister & Kurster 2009)
//! whose weights are the full information matrix of the velocities (`docs/method.md` section 4).
//!
//! With `theta = 2 pi (E - E_mid) / P` the velocities are `V = X (a, b)`, the columns of X being cos and sin of theta.
//! Then `ln L = b' (a, b) - (a, b) A (a, b) / 2` with `A = X' I X` and `b = X' g`; its maximum is `b' A^-1 b / 2`
//! relative to no planet. Periods are in rotation cycles. The systemic velocity is not fitted here: like other
//! parameters of the star it is fixed or marginalised over in the quadratic.

use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Trial periods per matrix product.
const BLOCK: usize = 128;

/// Two velocities (a, b) are degenerate where the curvature along one is below this fraction of the total information.
const SINGULAR: f64 = 1e-9;

/// Standard deviation of a uniform phase (cycles).
pub const SIGMA_OF_UNKNOWN_PHASE: f64 = 0.288_675_134_594_812_9;

/// ln L at one trial period, as a quadratic in (a, b).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// Frequency (orbits a rotation cycle).
    pub frequency: f64,
    /// A: curvature in (a, b) (s^2/km^2).
    pub information: Matrix2<f64>,
    /// b: gradient at no planet (s/km).
    pub gradient: Vector2<f64>,
    /// The best orbit; `None` where the data do not bound a and b.
    pub orbit: Option<CircularOrbit>,
}

/// The best circular orbit at a given period, `V = K cos(2 pi (E / P - phi))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircularOrbit {
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Its standard error (km/s), at this period.
    pub sigma_k_kms: f64,
    /// Phase in [0, 1) (cycles).
    pub phi: f64,
    /// Its standard error at this period, at most that of a uniform phase.
    pub sigma_phi: f64,
    /// ln L relative to no planet.
    pub delta_ln_l: f64,
}

/// The middle of the time base (rotation cycles), from which phases are counted internally.
pub fn mid_cycle(cycles: &[f64]) -> f64 {
    let lo = cycles.iter().copied().fold(f64::INFINITY, f64::min);
    let hi = cycles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    0.5 * (lo + hi)
}

/// X for several frequencies side by side: two columns each, cos and sin of the orbital angle from mid-time.
pub(super) fn design(cycles: &[f64], frequencies: &[f64]) -> DMatrix<f64> {
    let mid = mid_cycle(cycles);
    let mut x = DMatrix::zeros(cycles.len(), 2 * frequencies.len());
    for (j, frequency) in frequencies.iter().enumerate() {
        for (k, cycle) in cycles.iter().enumerate() {
            (x[(k, 2 * j + 1)], x[(k, 2 * j)]) = (TAU * frequency * (cycle - mid)).sin_cos();
        }
    }
    x
}

/// `X' M X` of each frequency of a design.
fn blocks<'a>(x: &'a DMatrix<f64>, mx: &'a DMatrix<f64>) -> impl ExactSizeIterator<Item = Matrix2<f64>> + 'a {
    (0..x.ncols() / 2).map(|j| {
        let entry = |r: usize, c: usize| x.column(2 * j + r).dot(&mx.column(2 * j + c));
        let off = 0.5 * (entry(0, 1) + entry(1, 0));
        Matrix2::new(entry(0, 0), off, off, entry(1, 1))
    })
}

/// The best orbit at every frequency (orbits a rotation cycle).
pub fn scan(quadratic: &VelocityQuadratic, frequencies: &[f64]) -> Vec<Trial> {
    let block = |frequencies: &[f64]| {
        let x = design(&quadratic.cycles, frequencies);
        let ix = &quadratic.information * &x;
        let b = x.tr_mul(&quadratic.gradient);
        let least = SINGULAR * quadratic.information.trace();
        let trial = |(j, information)| {
            let frequency = frequencies[j];
            let gradient = Vector2::new(b[2 * j], b[2 * j + 1]);
            let orbit = best(information, gradient, least)
                .map(|(ab, covariance, height)| orbit(&quadratic.cycles, frequency, ab, covariance, height));
            Trial { frequency, information, gradient, orbit }
        };
        blocks(&x, &ix).enumerate().map(trial).collect::<Vec<_>>()
    };
    frequencies.par_chunks(BLOCK).flat_map_iter(block).collect()
}

/// The best orbit at one frequency.
pub fn at(quadratic: &VelocityQuadratic, frequency: f64) -> Trial {
    scan(quadratic, &[frequency])[0]
}

/// Information on (a, b) of an orbit at one frequency with the amplitudes of an orbit at another free under a prior of
/// information `prior` (s^2/km^2). `None` where either is not bounded.
pub fn between(quadratic: &VelocityQuadratic, frequency: f64, other: f64, prior: f64) -> Option<Matrix2<f64>> {
    let x = design(&quadratic.cycles, &[frequency, other]);
    let a = x.tr_mul(&(&quadratic.information * &x));
    let [own, across, others] = [(0, 0), (0, 2), (2, 2)].map(|at| a.fixed_view::<2, 2>(at.0, at.1).into_owned());
    let least = SINGULAR * quadratic.information.trace();
    let others = others + Matrix2::identity() * prior;
    let rest = own - across * others.try_inverse().filter(|_| eigenvalues(&others).0 > least)? * across.transpose();
    (prior > 0.0 || eigenvalues(&rest).0 > least).then_some(rest)
}

/// Smallest and largest eigenvalue of a symmetric matrix; NaN if it contains one.
pub(super) fn eigenvalues(m: &Matrix2<f64>) -> (f64, f64) {
    let (mean, half) = (0.5 * m.trace(), 0.5 * (m[(0, 0)] - m[(1, 1)]));
    let spread = half.hypot(m[(0, 1)]);
    (mean - spread, mean + spread)
}

/// (a, b) where ln L is highest, their covariance, and that height. `None` where some direction is unbounded.
fn best(a: Matrix2<f64>, b: Vector2<f64>, least: f64) -> Option<(Vector2<f64>, Matrix2<f64>, f64)> {
    let bounded = eigenvalues(&a).0 > least;
    let covariance = a.try_inverse().filter(|_| bounded)?;
    let ab = covariance * b;
    Some((ab, covariance, 0.5 * b.dot(&ab)))
}

fn orbit(cycles: &[f64], frequency: f64, ab: Vector2<f64>, covariance: Matrix2<f64>, delta_ln_l: f64) -> CircularOrbit {
    let k_kms = ab.norm();
    let along = if k_kms > 0.0 { ab / k_kms } else { Vector2::x() };
    let across = Vector2::new(-along.y, along.x);
    let sigma = |direction: Vector2<f64>| direction.dot(&(covariance * direction)).sqrt();
    CircularOrbit {
        k_kms,
        sigma_k_kms: sigma(along),
        phi: phi(cycles, frequency, ab),
        sigma_phi: (sigma(across) / (TAU * k_kms)).min(SIGMA_OF_UNKNOWN_PHASE),
        delta_ln_l,
    }
}

/// The phase of (a, b), counted from cycle 0 instead of mid-time, in [0, 1).
pub(super) fn phi(cycles: &[f64], frequency: f64, ab: Vector2<f64>) -> f64 {
    let phi = (mid_cycle(cycles) * frequency + ab.y.atan2(ab.x) / TAU).rem_euclid(1.0);
    // the remainder of a tiny negative number rounds to 1
    if phi < 1.0 { phi } else { 0.0 }
}

/// (a, b) of an orbit of semi-amplitude `k_kms` and phase `phi`.
pub(super) fn amplitudes(cycles: &[f64], frequency: f64, k_kms: f64, phi: f64) -> Vector2<f64> {
    let (sin, cos) = (TAU * (phi - mid_cycle(cycles) * frequency)).sin_cos();
    Vector2::new(k_kms * cos, k_kms * sin)
}

/// Velocities of the orbit (a, b) at that frequency (km/s).
pub(super) fn velocities(cycles: &[f64], frequency: f64, ab: Vector2<f64>) -> DVector<f64> {
    design(cycles, &[frequency]) * ab
}

#[cfg(test)]
mod tests {
    use super::super::sample::{self, uneven};
    use super::*;

    /// With independent velocities it is the weighted least-squares sine fit.
    #[test]
    fn diagonal_information_is_weighted_least_squares() {
        let cycles = uneven(40, 3.0);
        let sigma = DVector::from_fn(40, |k, _| 0.02 + 0.001 * k as f64);
        let rv = sample::orbit(&cycles, 0.1, 1.7, 0.3) + sample::normal(40, 4).component_mul(&sigma);
        let quadratic = sample::independent(&cycles, &rv, &sigma);
        for period in [0.31, 0.9, 1.0, 1.7, 5.0] {
            let found = at(&quadratic, 1.0 / period).orbit.unwrap();
            let x = design(&cycles, &[1.0 / period]);
            let weighted = DMatrix::from_fn(40, 2, |k, c| x[(k, c)] / sigma[k]);
            let target = rv.component_div(&sigma);
            let ab = weighted.clone().svd(true, true).solve(&target, 1e-12).unwrap();
            let chi2_drop = target.norm_squared() - (&target - &weighted * &ab).norm_squared();
            assert!((found.k_kms - ab.norm()).abs() < 1e-10 * ab.norm());
            assert!((found.delta_ln_l - 0.5 * chi2_drop).abs() < 1e-8, "{period}");
            let model = sample::orbit(&cycles, found.k_kms, period, found.phi);
            assert!((model - x * ab).norm() < 1e-10);
        }
    }

    /// The origin of time changes only the phase.
    #[test]
    fn the_origin_of_time_does_not_matter() {
        let cycles = uneven(30, 4.0);
        let shift = 321.37;
        let later: Vec<f64> = cycles.iter().map(|e| e + shift).collect();
        let rv = sample::orbit(&cycles, 0.1, 1.3, 0.9) + 0.05 * sample::normal(30, 8);
        let one = sample::correlated(&cycles, &rv, 3);
        let other = VelocityQuadratic { cycles: later, ..one.clone() };
        for period in [0.4, 1.3, 6.0] {
            let (a, b) = (at(&one, 1.0 / period).orbit.unwrap(), at(&other, 1.0 / period).orbit.unwrap());
            assert!((a.k_kms - b.k_kms).abs() < 1e-9 && (a.delta_ln_l - b.delta_ln_l).abs() < 1e-8);
            assert!((a.sigma_k_kms - b.sigma_k_kms).abs() < 1e-9 && (a.sigma_phi - b.sigma_phi).abs() < 1e-9);
            let turned = (a.phi + shift / period - b.phi).rem_euclid(1.0);
            assert!(turned.min(1.0 - turned) < 1e-9, "{turned}");
        }
    }

    #[test]
    fn profiles_at_one_time_show_no_orbit() {
        let cycles = vec![0.3; 5];
        let rv = DVector::from_element(5, 0.1);
        let quadratic = sample::independent(&cycles, &rv, &DVector::from_element(5, 0.01));
        assert_eq!(at(&quadratic, 0.7).orbit, None);
        let nothing = VelocityQuadratic { gradient: DVector::zeros(5), cycles: uneven(5, 2.0), ..quadratic };
        let orbit = at(&nothing, 0.7).orbit.unwrap();
        assert_eq!((orbit.k_kms, orbit.delta_ln_l, orbit.sigma_phi), (0.0, 0.0, SIGMA_OF_UNKNOWN_PHASE));
    }
}
