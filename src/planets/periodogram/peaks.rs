//! The peaks of the periodogram, each refined between the trial periods, with uncertainties that include that of the
//! period.
//!
//! At a peak ln L is expanded in (a, b, frequency) of the circular orbit; the inverse of that curvature is the
//! covariance of K, period and phase together.

use super::frequencies::Frequencies;
use super::jitter::{BestTrial, Jitters};
use super::orbits::{CircularOrbit, SIGMA_OF_UNKNOWN_PHASE, Trial, amplitudes, mid_cycle, phi, velocities};
use super::refine::{Maximum, Model};
use super::rotation::{Imitation, RotationPeriods};
use super::window::{Alias, SAME, alias};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::Signal;
use nalgebra::{DVector, Matrix3, Vector2, Vector3};
use std::f64::consts::TAU;

/// Peaks up to this far below the highest are kept.
const KEPT_BELOW: f64 = 6.0;

/// The least and largest numbers of peaks kept.
const KEPT: (usize, usize) = (5, 30);

/// Peaks closer than this many inverse time bases count as one.
const SAME_PEAK: f64 = 0.1;

/// A maximum of ln L over orbits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Period over rotation period.
    pub porb_over_prot: f64,
    /// Its standard error; `None` on the edge of the search.
    pub sigma_porb_over_prot: Option<f64>,
    /// The orbit; where the period has a standard error, those of K and phase include it.
    pub orbit: CircularOrbit,
    /// Covariance of K (km/s), period over rotation period and phase (cycles); `None` on the edge of the search.
    pub covariance: Option<Matrix3<f64>>,
    /// Whether it is the first or last trial period, ln L still rising beyond it.
    pub on_edge: bool,
    /// How it is an alias of the highest peak.
    pub alias: Option<Alias>,
    /// The period of the star with which it is consistent: spots mimic orbits there.
    pub imitation: Option<Imitation>,
}

impl Peak {
    /// The orbit for a verdict.
    pub fn signal(&self, rotation_period_d: f64) -> Signal {
        Signal {
            period_d: rotation_period_d * self.porb_over_prot,
            sigma_period_d: self.sigma_porb_over_prot.map(|sigma| rotation_period_d * sigma),
            k_kms: self.orbit.k_kms,
            sigma_k_kms: self.orbit.sigma_k_kms,
        }
    }
}

/// Posterior shares of the peaks relative to each other: heights times volumes of their Gaussians, under priors uniform
/// in K and phase and log-uniform in the period. A peak on the edge of the search has none.
pub fn posterior_shares(peaks: &[&Peak]) -> Vec<f64> {
    let highest = peaks.iter().map(|peak| peak.orbit.delta_ln_l).fold(f64::NEG_INFINITY, f64::max);
    let weight = |peak: &&Peak| {
        let volume = peak.covariance.map_or(0.0, |covariance| covariance.determinant().max(0.0).sqrt());
        (peak.orbit.delta_ln_l - highest).exp() * volume / peak.porb_over_prot
    };
    let weights: Vec<f64> = peaks.iter().map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| if sum > 0.0 { weight / sum } else { 0.0 }).collect()
}

/// Parameters (a, b, frequency) of a circular orbit.
pub(super) fn parameters(cycles: &[f64], peak: &Peak) -> DVector<f64> {
    let frequency = 1.0 / peak.porb_over_prot;
    let ab = amplitudes(cycles, frequency, peak.orbit.k_kms, peak.orbit.phi);
    DVector::from_vec(vec![ab.x, ab.y, frequency])
}

/// Steps in (a, b, frequency) for numerical derivatives of velocities.
pub(super) fn steps(k_kms: f64, time_base_cycles: f64) -> [f64; 3] {
    let step = 1e-3 * k_kms.max(1e-3);
    [step, step, 1e-3 / time_base_cycles]
}

/// The orbit (a, b, frequency) with its covariance.
pub(super) fn peak(cycles: &[f64], theta: Vector3<f64>, covariance: Option<Matrix3<f64>>, delta_ln_l: f64) -> Peak {
    let (ab, frequency) = (Vector2::new(theta.x, theta.y), theta.z);
    let k_kms = ab.norm();
    let sigma = |slope: Vector3<f64>| covariance.map_or(f64::NAN, |c| slope.dot(&(c * slope)).sqrt());
    let turn = 1.0 / (TAU * k_kms * k_kms);
    let orbit = CircularOrbit {
        k_kms,
        sigma_k_kms: sigma(Vector3::new(ab.x / k_kms, ab.y / k_kms, 0.0)),
        phi: phi(cycles, frequency, ab),
        sigma_phi: sigma(Vector3::new(-ab.y * turn, ab.x * turn, mid_cycle(cycles))).min(SIGMA_OF_UNKNOWN_PHASE),
        delta_ln_l,
    };
    let slopes = Matrix3::from_rows(&[
        Vector3::new(ab.x / k_kms, ab.y / k_kms, 0.0).transpose(),
        Vector3::new(0.0, 0.0, -1.0 / (frequency * frequency)).transpose(),
        Vector3::new(-ab.y * turn, ab.x * turn, mid_cycle(cycles)).transpose(),
    ]);
    Peak {
        covariance: covariance.map(|c| slopes * c * slopes.transpose()),
        porb_over_prot: 1.0 / frequency,
        sigma_porb_over_prot: covariance.map(|c| c[(2, 2)].sqrt() / (frequency * frequency)),
        orbit,
        on_edge: false,
        alias: None,
        imitation: None,
    }
}

/// The highest orbit near the one of `start`, its period free within the search.
pub fn refined(quadratic: &VelocityQuadratic, frequencies: &Frequencies, start: &Peak) -> Peak {
    let cycles = &quadratic.cycles;
    let (lo, hi) = frequencies.range();
    let orbit = |theta: &DVector<f64>| {
        let inside = theta[2] > lo - frequencies.step() && theta[2] < hi + frequencies.step();
        inside.then(|| velocities(cycles, theta[2], Vector2::new(theta[0], theta[1])))
    };
    let steps = DVector::from_row_slice(&steps(start.orbit.k_kms, frequencies.time_base_cycles));
    let model = Model { velocities: &orbit, steps };
    match model.climb(quadratic, parameters(cycles, start)) {
        Some(Maximum { theta, delta_ln_l, covariance: Some(covariance) }) => {
            let theta = Vector3::new(theta[0], theta[1], theta[2]);
            peak(cycles, theta, Some(covariance.fixed_view::<3, 3>(0, 0).into_owned()), delta_ln_l)
        }
        // ln L has no maximum here, or none that bounds the period
        _ => *start,
    }
}

/// The peaks, from high to low.
pub(super) fn peaks(
    jitters: &Jitters,
    frequencies: &Frequencies,
    trials: &[BestTrial],
    rotation: &RotationPeriods,
) -> Vec<Peak> {
    let height = |k: usize| trials[k].delta_ln_l;
    let last = trials.len() - 1;
    let is_peak = |k: &usize| {
        let (before, after) = (if *k > 0 { height(k - 1) } else { f64::NEG_INFINITY }, height((k + 1).min(last)));
        height(*k) > before && (*k == last || height(*k) >= after)
    };
    let mut found: Vec<usize> = (0..trials.len()).filter(is_peak).collect();
    found.sort_by(|a, b| height(*b).total_cmp(&height(*a)));
    let Some(best) = found.first().map(|k| height(*k)) else { return Vec::new() };
    let kept = |(rank, k): &(usize, usize)| *rank < KEPT.0 || height(*k) > best - KEPT_BELOW;
    let mut peaks: Vec<Peak> = Vec::new();
    for (_, k) in found.into_iter().enumerate().filter(kept).take(KEPT.1) {
        let Trial { frequency, orbit: Some(orbit), .. } = trials[k].trial else { continue };
        let level = &jitters.levels[trials[k].level];
        let on_edge = k == 0 || k == last;
        let porb_over_prot = 1.0 / frequency;
        let start = Peak {
            porb_over_prot,
            sigma_porb_over_prot: None,
            covariance: None,
            orbit,
            on_edge,
            alias: None,
            imitation: None,
        };
        let mut peak = if on_edge { start } else { refined(&level.quadratic, frequencies, &start) };
        peak.orbit.delta_ln_l += level.ln_l;
        let near = |other: &Peak| {
            let apart = (1.0 / other.porb_over_prot - 1.0 / peak.porb_over_prot).abs();
            apart * frequencies.time_base_cycles < SAME_PEAK
        };
        if !peaks.iter().any(near) {
            peaks.push(peak);
        }
    }
    peaks.sort_by(|a, b| b.orbit.delta_ln_l.total_cmp(&a.orbit.delta_ln_l));
    let best = 1.0 / peaks[0].porb_over_prot;
    for peak in &mut peaks[1..] {
        let within = SAME / frequencies.time_base_cycles;
        peak.alias = alias(1.0 / peak.porb_over_prot, best, &rotation.window, within);
    }
    for peak in &mut peaks {
        peak.imitation = rotation.imitated(peak.porb_over_prot, peak.sigma_porb_over_prot);
    }
    peaks
}

#[cfg(test)]
mod tests {
    use super::super::frequencies::FrequencySettings;
    use super::super::sample::{self, uneven};
    use super::super::window::window_peaks;
    use super::*;

    fn search(quadratic: &VelocityQuadratic, settings: FrequencySettings) -> Vec<Peak> {
        let frequencies = Frequencies::new(&quadratic.cycles, 1.0, settings).unwrap();
        let jitters = Jitters::none(quadratic);
        let trials = jitters.scan(&frequencies.per_cycle);
        let window = window_peaks(&quadratic.cycles, &frequencies);
        let rotation = RotationPeriods::new(&quadratic.cycles, 1.0, &window, frequencies.time_base_cycles);
        peaks(&jitters, &frequencies, &trials, &rotation)
    }

    #[test]
    fn an_orbit_without_noise_is_given_back() {
        let cycles = uneven(40, 5.0);
        for (k, period, phi) in [(0.1, 1.7, 0.3), (0.02, 0.613, 0.99), (1.0, 3.4, 0.0)] {
            let quadratic = sample::correlated(&cycles, &sample::orbit(&cycles, k, period, phi), 2);
            let best = search(&quadratic, FrequencySettings::default())[0];
            assert!((best.porb_over_prot - period).abs() < 1e-6 * period, "{best:?}");
            assert!((best.orbit.k_kms - k).abs() < 1e-7, "{best:?}");
            let turned = (best.orbit.phi - phi).rem_euclid(1.0);
            assert!(turned.min(1.0 - turned) < 1e-6, "{best:?}");
        }
    }

    /// The standard errors equal the standard deviation of the best orbit over realisations of the noise.
    #[test]
    fn errors_are_the_scatter_of_the_estimates() {
        let cycles = uneven(40, 5.0);
        let mut pulls = [0.0; 3];
        let n = 300;
        for seed in 0..n {
            let noise = 0.05 * sample::normal(40, seed);
            let rv = sample::orbit(&cycles, 0.1, 1.7, 0.3) + noise;
            let quadratic = sample::independent(&cycles, &rv, &DVector::from_element(40, 0.05));
            let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
            let orbit = super::super::orbits::at(&quadratic, 1.0 / 1.7).orbit.unwrap();
            let start = Peak {
                porb_over_prot: 1.7,
                sigma_porb_over_prot: None,
                covariance: None,
                orbit,
                on_edge: false,
                alias: None,
                imitation: None,
            };
            let found = refined(&quadratic, &frequencies, &start);
            pulls[0] += ((found.orbit.k_kms - 0.1) / found.orbit.sigma_k_kms).powi(2) / n as f64;
            pulls[1] += ((found.porb_over_prot - 1.7) / found.sigma_porb_over_prot.unwrap()).powi(2) / n as f64;
            pulls[2] += ((found.orbit.phi - 0.3) / found.orbit.sigma_phi).powi(2) / n as f64;
        }
        // a mean square of 300 has an error of 0.08; the curvature is right to first order
        assert!(pulls.iter().all(|p| (p - 1.0).abs() < 0.3), "{pulls:?}");
    }

    #[test]
    fn aliases_of_daily_sampling_are_named() {
        let cycles: Vec<f64> = (0..30).map(|k| k as f64 + 0.05 * (k as f64 * 1.7).sin()).collect();
        let rv = sample::orbit(&cycles, 0.1, 1.0 / 0.3, 0.3);
        let quadratic = sample::independent(&cycles, &rv, &DVector::from_element(30, 0.05));
        let settings = FrequencySettings { min_period_d: Some(0.7), ..FrequencySettings::default() };
        let found = search(&quadratic, settings);
        assert!((1.0 / found[0].porb_over_prot - 0.3).abs() < 1e-6);
        let alias = |f: f64| found.iter().find(|p| (1.0 / p.porb_over_prot - f).abs() < 0.01).unwrap().alias;
        assert!(alias(0.7).is_some_and(|a| a.mirrored && (a.window.frequency - 1.0).abs() < 0.01));
        assert!(alias(1.3).is_some_and(|a| !a.mirrored));
    }
}
