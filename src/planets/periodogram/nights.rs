//! RV offsets that all profiles of a night share, of unknown size: whether a planet is significant beside them.
//!
//! A spectrograph whose zero point changes from night to night looks like a planet of several days. A jitter s of each
//! profile and offsets t of the nights have the covariance `J = L L'` with `L = [s 1 | t N]`, N telling which profile
//! is of which night. Beside it ln L of information I and gradient g has the information `I - I M I` and the gradient
//! `(1 - I M) g`, `M = L A^-1 L'` and `A = 1 + L' I L`, and is higher at velocities 0 by `(g M g - ln det A) / 2`. As
//! beside a jitter alone (`jitter`), s and t are those that suit best, without an orbit and with each orbit. Stars
//! without a planet, with the offsets that are the most likely without one, say how often a peak is as high, or K of a
//! known planet.

use super::draws::amplitudes;
use super::jitter::{Jitters, Level, ln_prior, root};
use super::{FalseAlarm, Frequencies, SearchSettings};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Sizes of the jitter of which the most likely is sought, of the one found without offsets.
const JITTERS: [f64; 4] = [0.0, 0.35, 0.7, 1.0];

/// Offsets of which the most likely is sought, of the scatter of the velocities: from the first to the last, each
/// larger by a factor.
const OFFSETS: (f64, f64, f64) = (0.1, 2.0, 1.25);

/// Jitters and offsets that are tried with each orbit, of the most likely ones.
const PARTS: ([f64; 4], [f64; 5]) = ([0.0, 0.5, 1.0, std::f64::consts::SQRT_2], [0.0, 0.35, 0.7, 1.0, 1.4]);

/// Scale of the prior of the offsets of a spectrograph of unknown stability (km/s): that of ESPaDOnS and Narval.
const USUAL_KMS: f64 = 0.03;

/// Nights of two profiles at least: fewer do not tell offsets from a jitter.
const NIGHTS: usize = 3;

/// Stars that are drawn: the probability is compared with 1 %.
const DRAWS: usize = 2_000;

/// What offsets of nights make of a planet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NightOffsets {
    /// Their most likely standard deviation without a planet (km/s).
    pub sigma_kms: f64,
    /// By how much they raise ln L of a star without a planet, their prior counted.
    pub gain: f64,
    /// How often stars without it, with such offsets, show a peak as high, or of a known planet such a K.
    pub false_alarm_probability: f64,
}

/// A planet that is compared with offsets.
#[derive(Clone, Copy, Debug)]
pub enum Compared<'a> {
    /// The peak at one of the frequencies (orbits a rotation cycle).
    Peak(f64, &'a Frequencies),
    /// One of which K alone is unknown: its velocities for a K of 1.
    Known(&'a DVector<f64>),
}

/// What offsets of `nights` make of a planet, beside a jitter which is `found_kms` in a star without it and has a prior
/// of that scale; the offsets have the same prior, or that of 30 m/s. `None` where the profiles do not tell the offsets
/// from a jitter, show none, or no orbit is bounded.
pub fn night_offsets(
    without: &VelocityQuadratic,
    nights: &[Vec<usize>],
    (found_kms, scale_kms): (f64, Option<f64>),
    planet: Compared,
    settings: SearchSettings,
) -> Option<NightOffsets> {
    if nights.iter().filter(|night| night.len() > 1).count() < NIGHTS {
        return None;
    }
    let mut of_night = DMatrix::zeros(without.len(), nights.len());
    for (night, profiles) in nights.iter().enumerate() {
        profiles.iter().for_each(|k| of_night[(*k, night)] = 1.0);
    }
    let beside = |scatter: Scatter| Beside::new(without, &of_night, scatter, scale_kms);
    let error_kms = (without.len() as f64 / without.information.trace()).sqrt();
    let (first, last, factor) = OFFSETS;
    let mut sizes = vec![0.0];
    let mut size = first;
    while size <= last {
        sizes.push(size * found_kms.max(error_kms));
        size *= factor;
    }
    let tried = scatters(JITTERS.map(|part| part * found_kms), &sizes);
    let heights: Vec<f64> =
        tried.par_iter().map(|one| beside(*one).map_or(f64::NEG_INFINITY, |beside| beside.height)).collect();
    let highest = |with: bool| {
        let among = (0..tried.len()).filter(|k| with || tried[*k].night_kms == 0.0);
        among.max_by(|a, b| heights[*a].total_cmp(&heights[*b]))
    };
    let (plain, best) = (highest(false)?, highest(true)?);
    let null = tried[best];
    if null.night_kms == 0.0 {
        return None;
    }
    let (jitters, offsets) = PARTS;
    let mut parts = scatters(jitters.map(|part| part * null.jitter_kms), &offsets.map(|part| part * null.night_kms));
    parts.push(Scatter { jitter_kms: found_kms, night_kms: 0.0 });
    let all = of_scatters(without, beside(null)?, parts.into_par_iter().filter_map(beside).collect());
    let (draws, seed) = (DRAWS.min(settings.draws), settings.seed);
    let false_alarm_probability = match planet {
        Compared::Peak(frequency, frequencies) => {
            let height = all.orbit_at(frequency)?.delta_ln_l;
            FalseAlarm::draw(&all, &frequencies.per_cycle, draws, seed).probability(height).value()
        }
        Compared::Known(unit) => {
            let height = all.height_above_zero(unit);
            let above = amplitudes(&all, unit, draws, seed).into_iter().filter(|drawn| *drawn >= height).count();
            (1 + above) as f64 / (1 + draws) as f64
        }
    };
    Some(NightOffsets { sigma_kms: null.night_kms, gain: heights[best] - heights[plain], false_alarm_probability })
}

/// Standard deviations of jitter and offsets.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scatter {
    jitter_kms: f64,
    night_kms: f64,
}

/// Each of the jitters with each of the offsets, once.
fn scatters<const N: usize>(mut jitters_kms: [f64; N], nights_kms: &[f64]) -> Vec<Scatter> {
    jitters_kms.sort_by(f64::total_cmp);
    let mut jitters = jitters_kms.to_vec();
    jitters.dedup();
    let with = |night_kms: f64| jitters.iter().map(move |kms| Scatter { jitter_kms: *kms, night_kms });
    nights_kms.iter().copied().flat_map(with).collect()
}

/// The velocities beside a jitter and offsets.
struct Beside {
    scatter: Scatter,
    /// L.
    columns: DMatrix<f64>,
    /// `C^-1 L'`, `A = C C'`: M is its square.
    solved: DMatrix<f64>,
    /// `-ln det A / 2`, the prior counted.
    constant: f64,
    /// ln L at velocities 0, the prior counted, above that without jitter and offsets.
    height: f64,
}

impl Beside {
    fn new(
        without: &VelocityQuadratic,
        of_night: &DMatrix<f64>,
        scatter: Scatter,
        scale_kms: Option<f64>,
    ) -> Option<Self> {
        let Scatter { jitter_kms, night_kms } = scatter;
        let n = without.len();
        let jitter = if jitter_kms > 0.0 { n } else { 0 };
        let nights = if night_kms > 0.0 { of_night.ncols() } else { 0 };
        let mut columns = DMatrix::zeros(n, jitter + nights);
        (0..jitter).for_each(|k| columns[(k, k)] = jitter_kms);
        columns.columns_mut(jitter, nights).copy_from(&(of_night.columns(0, nights) * night_kms));
        let inner = columns.tr_mul(&(&without.information * &columns));
        let inner = DMatrix::identity(jitter + nights, jitter + nights) + 0.5 * (&inner + inner.transpose());
        let factor = inner.cholesky()?.unpack();
        let solved = factor.solve_lower_triangular(&columns.transpose())?;
        let prior = ln_prior(jitter_kms, scale_kms) + ln_prior(night_kms, scale_kms.or(Some(USUAL_KMS)));
        let constant = prior - factor.diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let height = constant + 0.5 * (&solved * &without.gradient).norm_squared();
        Some(Beside { scatter, columns, solved, constant, height })
    }

    /// The likelihood of the velocities beside it, where gradients of stars without a planet have that `root`.
    fn level(&self, without: &VelocityQuadratic, root: &DMatrix<f64>, best: f64) -> Level {
        let n = without.len();
        let kept = DMatrix::identity(n, n) - &without.information * self.solved.tr_mul(&self.solved);
        let information = &kept * &without.information;
        Level {
            size_kms: self.scatter.jitter_kms,
            quadratic: VelocityQuadratic {
                cycles: without.cycles.clone(),
                gradient: &kept * &without.gradient,
                information: 0.5 * (&information + information.transpose()),
            },
            ln_l: self.height - best,
            root: root * kept.transpose(),
            constant: self.constant,
            squares: DVector::from_element(self.solved.nrows(), 0.5),
            rotation: &self.solved * root,
        }
    }
}

/// The likelihood beside `all` of these, stars without a planet being those of `null`.
fn of_scatters(without: &VelocityQuadratic, null: Beside, all: Vec<Beside>) -> Jitters {
    let moved = &without.information * &null.columns;
    let root = root(&(&without.information + &moved * moved.transpose()));
    let best = all.iter().map(|beside| beside.height).fold(f64::NEG_INFINITY, f64::max);
    let levels = all.iter().map(|beside| beside.level(without, &root, best)).collect();
    Jitters { levels }
}

#[cfg(test)]
mod tests {
    use super::super::FrequencySettings;
    use super::super::sample;
    use super::*;

    const ERROR_KMS: f64 = 0.03;

    /// Twelve nights of three profiles, seen by themselves.
    fn of(jitter_kms: f64, night_kms: f64, k_kms: f64, seed: u64) -> (VelocityQuadratic, Vec<Vec<usize>>) {
        let cycles: Vec<f64> = (0..36).map(|k| 0.37 * (k / 3) as f64 + 0.03 * (k % 3) as f64).collect();
        let nights: Vec<Vec<usize>> = (0..12).map(|night| (3 * night..3 * night + 3).collect()).collect();
        let offsets = night_kms * sample::normal(12, seed);
        let rv = sample::orbit(&cycles, k_kms, 1.7, 0.3)
            + ERROR_KMS * sample::normal(36, 1000 + seed)
            + jitter_kms * sample::normal(36, 2000 + seed)
            + DVector::from_fn(36, |k, _| offsets[k / 3]);
        (sample::independent(&cycles, &rv, &DVector::from_element(36, ERROR_KMS)), nights)
    }

    /// Of the highest peak, the scatter that it has without a planet being its jitter.
    fn found(jitter_kms: f64, night_kms: f64, k_kms: f64, seed: u64) -> Option<NightOffsets> {
        let (velocities, nights) = of(jitter_kms, night_kms, k_kms, seed);
        let frequencies = Frequencies::new(&velocities.cycles, 1.0, FrequencySettings::default()).unwrap();
        let found_kms = jitter_kms.hypot(night_kms).hypot(k_kms / std::f64::consts::SQRT_2);
        let settings = SearchSettings { draws: 1000, seed: 1 };
        let jitters = Jitters::new(&velocities, found_kms, None);
        let heights = jitters.scan(&frequencies.per_cycle);
        let highest = heights.iter().max_by(|a, b| a.delta_ln_l.total_cmp(&b.delta_ln_l)).unwrap();
        let peak = Compared::Peak(highest.trial.frequency, &frequencies);
        night_offsets(&velocities, &nights, (found_kms, None), peak, settings)
    }

    /// By the covariance of the velocities.
    #[test]
    fn the_offsets_add_to_the_covariance() {
        let (velocities, nights) = of(0.0, 0.08, 0.0, 3);
        let of_night = DMatrix::from_fn(36, 12, |k, night| f64::from(u8::from(nights[night].contains(&k))));
        let (rv, noise) = velocities.radial_velocities().unwrap();
        let density = |scatter: Scatter| {
            let Scatter { jitter_kms, night_kms } = scatter;
            let nights = &of_night * of_night.transpose() * night_kms.powi(2);
            let c = &noise + DMatrix::identity(36, 36) * jitter_kms.powi(2) + nights;
            let inverse = c.clone().try_inverse().unwrap();
            (-0.5 * (rv.dot(&(&inverse * &rv)) + c.determinant().ln()), inverse, c)
        };
        let alone = density(Scatter { jitter_kms: 0.0, night_kms: 0.0 }).0;
        let all = scatters([0.02, 0.0], &[0.07, 0.0]);
        assert_eq!(all.len(), 4);
        let beside = |scatter: &Scatter| Beside::new(&velocities, &of_night, *scatter, None).unwrap();
        let jitters = of_scatters(&velocities, beside(&all[1]), all.iter().map(beside).collect());
        let null = density(all[1]).2;
        for (scatter, level) in all.iter().zip(jitters.levels()) {
            let (ln_l, inverse, _) = density(*scatter);
            let above = ln_l - alone + ln_prior(scatter.night_kms, Some(USUAL_KMS));
            assert!((beside(scatter).height - above).abs() < 1e-8, "{scatter:?}");
            assert!((&level.quadratic.information - &inverse).norm() < 1e-8 * inverse.norm(), "{scatter:?}");
            assert!(
                (&level.quadratic.gradient - &inverse * &rv).norm() < 1e-8 * (&inverse * &rv).norm(),
                "{scatter:?}"
            );
            // gradients of a star of the null
            let expected = &inverse * &null * &inverse;
            assert!((level.root.tr_mul(&level.root) - &expected).norm() < 1e-8 * expected.norm(), "{scatter:?}");
        }
    }

    #[test]
    fn offsets_of_nights_are_no_planet() {
        let found: Vec<NightOffsets> = (0..40).filter_map(|seed| found(0.0, 0.08, 0.0, seed)).collect();
        let mut all: Vec<f64> = found.iter().map(|found| found.false_alarm_probability).collect();
        all.sort_by(f64::total_cmp);
        // the peak may not be the highest beside offsets: probabilities are uniform or larger
        let below = |(k, p): (usize, &f64)| (k as f64 + 0.5) / all.len() as f64 - p;
        let distance = all.iter().enumerate().map(below).fold(0.0, f64::max);
        // exceeded once in a hundred by chance: 1.52 / sqrt(40)
        assert!(all.len() > 38 && distance < 0.24 && all[0] > 1e-3, "{distance} {all:?}");
        let sizes = found.iter().map(|found| found.sigma_kms.powi(2)).sum::<f64>() / found.len() as f64;
        assert!((sizes.sqrt() / 0.08 - 1.0).abs() < 0.15, "{sizes}");
    }

    /// Of a planet whose ephemeris is known.
    fn known(night_kms: f64, k_kms: f64, seed: u64) -> Option<NightOffsets> {
        let (velocities, nights) = of(0.0, night_kms, k_kms, seed);
        let unit = sample::orbit(&velocities.cycles, 1.0, 1.7, 0.3);
        let found_kms = night_kms.hypot(k_kms / std::f64::consts::SQRT_2);
        let settings = SearchSettings { draws: 2000, seed: 1 };
        night_offsets(&velocities, &nights, (found_kms, None), Compared::Known(&unit), settings)
    }

    /// K of such a planet is as improbable as it says.
    #[test]
    fn offsets_of_nights_are_no_known_planet() {
        let mut all: Vec<f64> = (0..200)
            .filter_map(|seed| known(0.08, 0.0, seed))
            .collect::<Vec<_>>()
            .iter()
            .map(|found| found.false_alarm_probability)
            .collect();
        all.sort_by(f64::total_cmp);
        let half = all.partition_point(|p| *p < 0.5);
        // half of the draws are below zero, and have 1; exceeded once in a hundred by chance: 1.63 / sqrt(200)
        let distance = |(k, p): (usize, &f64)| ((k as f64 + 0.5) / all.len() as f64 - p).abs();
        let distance = all[..half].iter().enumerate().map(distance).fold(0.0, f64::max);
        assert!(all.len() > 195 && distance < 0.115 && half.abs_diff(100) < 25, "{distance} {half}");
    }

    #[test]
    fn a_known_planet_is_no_offset_of_nights() {
        let all: Vec<NightOffsets> = (0..6).filter_map(|seed| known(0.0, 0.1, seed)).collect();
        assert!(all.len() == 6 && all.iter().all(|found| found.false_alarm_probability < 1e-2), "{all:?}");
    }

    /// Beside a jitter or none.
    #[test]
    fn a_planet_is_no_offset_of_nights() {
        for jitter_kms in [0.0, 0.06] {
            let all: Vec<NightOffsets> = (0..6).filter_map(|seed| found(jitter_kms, 0.0, 0.15, seed)).collect();
            let clear = all.iter().filter(|found| found.false_alarm_probability < 1e-2).count();
            assert_eq!(clear, all.len(), "{jitter_kms}: {all:?}");
        }
    }

    /// A jitter alone, and nights of one profile, have no offsets.
    #[test]
    fn a_jitter_is_no_offset_of_nights() {
        let with = (0..20).filter(|seed| found(0.06, 0.0, 0.0, *seed).is_some_and(|found| found.gain > 2.0)).count();
        assert!(with < 2, "{with}");
        let (velocities, _) = of(0.0, 0.0, 0.0, 1);
        let frequencies = Frequencies::new(&velocities.cycles, 1.0, FrequencySettings::default()).unwrap();
        let alone: Vec<Vec<usize>> = (0..36).map(|k| vec![k]).collect();
        let settings = SearchSettings { draws: 1000, seed: 1 };
        let peak = Compared::Peak(0.5, &frequencies);
        assert_eq!(night_offsets(&velocities, &alone, (0.08, None), peak, settings), None);
    }

    /// A velocity that all profiles have in common is open.
    #[test]
    fn an_open_velocity_is_no_obstacle() {
        let (velocities, nights) = of(0.0, 0.08, 0.0, 2);
        let open = velocities.beside(&DMatrix::from_element(36, 1, 1.0)).unwrap();
        let frequencies = Frequencies::new(&open.cycles, 1.0, FrequencySettings::default()).unwrap();
        let settings = SearchSettings { draws: 1000, seed: 1 };
        let peak = Compared::Peak(1.0 / 1.7, &frequencies);
        let found = night_offsets(&open, &nights, (0.08, None), peak, settings).unwrap();
        assert!((0.04..0.16).contains(&found.sigma_kms) && found.false_alarm_probability > 1e-3, "{found:?}");
    }
}
