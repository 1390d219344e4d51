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
mod tests;
