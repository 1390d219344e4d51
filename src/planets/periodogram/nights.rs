//! RV offsets that all profiles of a night share, of unknown size: whether they explain the highest peak as well.
//!
//! A spectrograph whose zero point changes from night to night looks like a planet of several days. Beside a jitter s of
//! each profile, offsets t of the nights have the covariance `J = s^2 1 + t^2 N N'`, N telling which profile is of which
//! night. With `J = L L'` this is a jitter of size 1 of velocities in units of L, of information `L' I L` and gradient
//! `L' g`, and is treated as one (`jitter`): s and t are those most likely without an orbit, and with each orbit a part
//! of them. Stars without a planet, whose nights are offset by as much, say how often a peak is as high.

use super::jitter::{Jitters, Level, ln_prior};
use super::{Frequencies, Search, SearchSettings};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{Cholesky, DMatrix, Dyn};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Sizes of the jitter that are tried beside the nights, of the one found without these.
const JITTERS: [f64; 4] = [0.1, 0.35, 0.7, 1.0];

/// Offsets that are tried, of the scatter of the velocities: from the first to the last, each larger by a factor.
const OFFSETS: (f64, f64, f64) = (0.1, 2.0, 1.25);

/// Scale of the prior of the offsets of a spectrograph of unknown stability (km/s): that of ESPaDOnS and Narval.
const USUAL_KMS: f64 = 0.03;

/// A jitter is this part of the error of a velocity at least, so that J has an inverse.
const LEAST: f64 = 0.01;

/// What offsets of nights make of the highest peak.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NightOffsets {
    /// Their most likely standard deviation without a planet (km/s).
    pub sigma_kms: f64,
    /// By how much they raise ln L of a star without a planet, their prior counted.
    pub gain: f64,
    /// How often stars without a planet, with such offsets, show a peak as high.
    pub false_alarm_probability: f64,
}

/// What offsets of `nights` make of a search beside a jitter, which is `found_kms` without a planet and has a prior of
/// that scale; the offsets have the same prior, or that of [`USUAL_KMS`]. `None` where each night has one profile, whose offset is a jitter, or
/// the search has no bounded orbit.
pub fn night_offsets(
    without: &VelocityQuadratic,
    nights: &[Vec<usize>],
    (found_kms, scale_kms): (f64, Option<f64>),
    frequencies: &Frequencies,
    settings: SearchSettings,
) -> Option<NightOffsets> {
    if nights.iter().all(|night| night.len() < 2) {
        return None;
    }
    let mut same = DMatrix::zeros(without.len(), without.len());
    for night in nights {
        night.iter().for_each(|i| night.iter().for_each(|j| same[(*i, *j)] = 1.0));
    }
    let error_kms = (without.len() as f64 / without.information.trace()).sqrt();
    let (least, scatter_kms) = (LEAST * error_kms, found_kms.max(error_kms));
    let alone = |kms: f64| Tried { jitter_kms: kms.max(least), night_kms: 0.0 };
    let mut tried: Vec<Tried> = JITTERS.map(|size| alone(size * found_kms)).to_vec();
    tried.dedup();
    let (first, last, factor) = OFFSETS;
    let mut size = first;
    let jitters = tried.clone();
    while size <= last {
        let night_kms = size * scatter_kms;
        tried.extend(jitters.iter().map(|jitter| Tried { night_kms, ..*jitter }));
        size *= factor;
    }
    let heights: Vec<f64> = tried
        .par_iter()
        .map(|tried| Some(tried.shape(&same)?.height(without)? + tried.ln_prior(scale_kms)))
        .map(|height| height.unwrap_or(f64::NEG_INFINITY))
        .collect();
    let highest = |among: std::ops::Range<usize>| among.max_by(|a, b| heights[*a].total_cmp(&heights[*b]));
    let (plain, best) = (highest(0..jitters.len())?, highest(0..tried.len())?);
    let beside = tried[best].shape(&same)?.jitters(without, tried[best], scale_kms);
    let search = Search::with_jitter(&beside, frequencies, settings).ok()?;
    let height = search.best().orbit.delta_ln_l;
    Some(NightOffsets {
        sigma_kms: tried[best].night_kms,
        gain: heights[best] - heights[plain],
        false_alarm_probability: search.false_alarm.probability(height).value(),
    })
}

/// Standard deviations of both.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tried {
    jitter_kms: f64,
    night_kms: f64,
}

impl Tried {
    /// ln of the prior.
    fn ln_prior(&self, scale_kms: Option<f64>) -> f64 {
        ln_prior(self.jitter_kms, scale_kms) + ln_prior(self.night_kms, scale_kms.or(Some(USUAL_KMS)))
    }

    /// The covariance of both, `same` being 1 for two profiles of one night.
    fn shape(&self, same: &DMatrix<f64>) -> Option<Shape> {
        let covariance = same * self.night_kms.powi(2);
        let with = DMatrix::from_diagonal_element(same.nrows(), same.nrows(), self.jitter_kms.powi(2)) + covariance;
        Some(Shape { root: with.cholesky()? })
    }
}

/// A covariance of velocities (km^2/s^2).
struct Shape {
    root: Cholesky<f64, Dyn>,
}

impl Shape {
    /// The velocities in units of the root.
    fn scaled(&self, velocities: &VelocityQuadratic) -> VelocityQuadratic {
        let root = self.root.l();
        let information = root.tr_mul(&(&velocities.information * &root));
        VelocityQuadratic {
            cycles: velocities.cycles.clone(),
            gradient: root.tr_mul(&velocities.gradient),
            information: 0.5 * (&information + information.transpose()),
        }
    }

    /// ln L of velocities 0 with it, above that without.
    fn height(&self, velocities: &VelocityQuadratic) -> Option<f64> {
        let VelocityQuadratic { gradient, information, .. } = self.scaled(velocities);
        let with = (information + DMatrix::identity(gradient.len(), gradient.len())).cholesky()?;
        let half_ln_determinant: f64 = with.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        Some(0.5 * gradient.dot(&with.solve(&gradient)) - half_ln_determinant)
    }

    /// The likelihood beside sizes of it, of which 1 is what was tried.
    fn jitters(&self, without: &VelocityQuadratic, tried: Tried, scale_kms: Option<f64>) -> Jitters {
        let size = without.len();
        let inverse =
            self.root.l().solve_lower_triangular(&DMatrix::identity(size, size)).expect("a positive diagonal");
        let scaled = Jitters::new(&self.scaled(without), 1.0, None);
        let in_kms = |level: &Level| {
            let part = level.size_kms;
            let prior = Tried { jitter_kms: part * tried.jitter_kms, night_kms: part * tried.night_kms };
            let ln_prior = prior.ln_prior(scale_kms);
            let information = inverse.tr_mul(&(&level.quadratic.information * &inverse));
            Level {
                size_kms: part * tried.night_kms,
                quadratic: VelocityQuadratic {
                    cycles: without.cycles.clone(),
                    gradient: inverse.tr_mul(&level.quadratic.gradient),
                    information: 0.5 * (&information + information.transpose()),
                },
                ln_l: level.ln_l + ln_prior,
                root: &level.root * &inverse,
                constant: level.constant + ln_prior,
                squares: level.squares.clone(),
            }
        };
        let mut levels: Vec<Level> = scaled.levels().iter().map(in_kms).collect();
        let best = levels.iter().map(|level| level.ln_l).fold(f64::NEG_INFINITY, f64::max);
        levels.iter_mut().for_each(|level| level.ln_l -= best);
        Jitters { levels, rotation: scaled.rotation }
    }
}

#[cfg(test)]
mod tests {
    use super::super::FrequencySettings;
    use super::super::sample;
    use super::*;
    use nalgebra::DVector;

    const ERROR_KMS: f64 = 0.03;

    /// Twelve nights of three profiles, seen by themselves.
    fn of(night_kms: f64, k_kms: f64, seed: u64) -> (VelocityQuadratic, Vec<Vec<usize>>) {
        let cycles: Vec<f64> = (0..36).map(|k| 0.37 * (k / 3) as f64 + 0.03 * (k % 3) as f64).collect();
        let nights: Vec<Vec<usize>> = (0..12).map(|night| (3 * night..3 * night + 3).collect()).collect();
        let offsets = night_kms * sample::normal(12, seed);
        let rv = sample::orbit(&cycles, k_kms, 1.7, 0.3)
            + ERROR_KMS * sample::normal(36, 1000 + seed)
            + DVector::from_fn(36, |k, _| offsets[k / 3]);
        (sample::independent(&cycles, &rv, &DVector::from_element(36, ERROR_KMS)), nights)
    }

    fn found(night_kms: f64, k_kms: f64, seed: u64) -> NightOffsets {
        let (velocities, nights) = of(night_kms, k_kms, seed);
        let frequencies = Frequencies::new(&velocities.cycles, 1.0, FrequencySettings::default()).unwrap();
        let settings = SearchSettings { draws: 1000, seed: 1 };
        night_offsets(&velocities, &nights, (0.08, None), &frequencies, settings).unwrap()
    }

    /// ln L by the covariance of the velocities, and all levels by that of their shares.
    #[test]
    fn the_offsets_add_to_the_covariance() {
        let (velocities, nights) = of(0.08, 0.0, 3);
        let mut same = DMatrix::zeros(36, 36);
        nights.iter().for_each(|night| night.iter().for_each(|i| night.iter().for_each(|j| same[(*i, *j)] = 1.0)));
        let (rv, noise) = velocities.radial_velocities().unwrap();
        let density = |jitter: f64, night: f64| {
            let c = &noise + DMatrix::identity(36, 36) * jitter.powi(2) + &same * night.powi(2);
            let inverse = c.clone().try_inverse().unwrap();
            (-0.5 * (rv.dot(&(&inverse * &rv)) + c.determinant().ln()), inverse)
        };
        let tried = Tried { jitter_kms: 0.02, night_kms: 0.07 };
        let shape = tried.shape(&same).unwrap();
        let above = density(0.02, 0.07).0 - density(0.0, 0.0).0;
        assert!((shape.height(&velocities).unwrap() - above).abs() < 1e-8);
        let jitters = shape.jitters(&velocities, tried, None);
        let prior = |part: f64| ln_prior(part * 0.07, Some(USUAL_KMS));
        for level in jitters.levels() {
            let part = level.size_kms / 0.07;
            let (ln_l, inverse) = density(part * 0.02, part * 0.07);
            assert!((&level.quadratic.information - &inverse).norm() < 1e-8 * inverse.norm(), "{part}");
            assert!((&level.quadratic.gradient - &inverse * &rv).norm() < 1e-8 * (&inverse * &rv).norm(), "{part}");
            let above = ln_l + prior(part) - density(0.0, 0.0).0;
            assert!((level.ln_l - jitters.levels()[0].ln_l - above).abs() < 1e-8, "{part}");
            // gradients of a star with such nights
            let all = &noise + DMatrix::identity(36, 36) * 0.02f64.powi(2) + &same * 0.07f64.powi(2);
            let expected = &inverse * all * &inverse;
            assert!((level.root.tr_mul(&level.root) - &expected).norm() < 1e-8 * expected.norm(), "{part}");
        }
    }

    #[test]
    fn offsets_of_nights_are_no_planet() {
        let found: Vec<NightOffsets> = (0..40).map(|seed| found(0.08, 0.0, seed)).collect();
        let mut all: Vec<f64> = found.iter().map(|found| found.false_alarm_probability).collect();
        all.sort_by(f64::total_cmp);
        let apart = |(k, p): (usize, &f64)| (p - (k as f64 + 0.5) / 40.0).abs();
        let distance = all.iter().enumerate().map(apart).fold(0.0, f64::max);
        // exceeded once in a thousand by chance: 1.95 / sqrt(40)
        assert!(distance < 0.31 && all[0] > 1e-3, "{distance} {all:?}");
        let sizes = found.iter().map(|found| found.sigma_kms.powi(2)).sum::<f64>() / 40.0;
        assert!((sizes.sqrt() / 0.08 - 1.0).abs() < 0.15, "{sizes}");
    }

    #[test]
    fn a_planet_is_no_offset_of_nights() {
        let all: Vec<NightOffsets> = (0..6).map(|seed| found(0.0, 0.15, seed)).collect();
        assert!(all.iter().all(|found| found.false_alarm_probability < 1e-2), "{all:?}");
    }

    /// One profile a night tells nothing of nights.
    #[test]
    fn a_night_of_one_profile_has_a_jitter() {
        let (velocities, _) = of(0.0, 0.0, 1);
        let frequencies = Frequencies::new(&velocities.cycles, 1.0, FrequencySettings::default()).unwrap();
        let alone: Vec<Vec<usize>> = (0..36).map(|k| vec![k]).collect();
        let settings = SearchSettings { draws: 1000, seed: 1 };
        assert_eq!(night_offsets(&velocities, &alone, (0.08, None), &frequencies, settings), None);
    }
}
