//! RV offsets that all profiles of a night share, of unknown size, beside the orbit and a jitter of each profile.
//!
//! A spectrograph whose RV offset changes from night to night mimics a planet of several days. A jitter s of each
//! profile and offsets t of the nights have the covariance `J = L L'` with `L = [s 1 | t N]`, N assigning profiles to
//! nights. With it ln L of information I and gradient g has the information `I - I M I` and the gradient `(1 - I M) g`,
//! `M = L A^-1 L'` and `A = 1 + L' I L`, and is higher at velocities 0 by `(g M g - ln det A) / 2`. As for a jitter
//! alone (`jitter`), s and t are fitted without an orbit and with each orbit, t with the prior of a jitter. Simulated
//! stars without a planet have the values that are the most likely without one, and are searched in the same way, also
//! where these are 0.

use super::draws::amplitudes;
use super::jitter::{Jitters, Level, SIZES, Scatter, by_chance_kms, ln_prior, ln_shares};
use super::{FalseAlarm, Frequencies, SearchSettings};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Trial jitters for the most likely one, in units of the one found without offsets.
const JITTERS: [f64; 4] = [0.0, 0.35, 0.7, 1.0];

/// Trial offsets for the most likely one, in units of the rms of the velocities: first, last, and ratio, within the
/// largest that are allowed.
const OFFSETS: (f64, f64, f64) = (0.1, 2.0, 1.25);

/// Trial offsets with each orbit, in units of those found without one, or that chance mimics; jitters are as without
/// offsets.
const PARTS: [f64; 4] = [0.0, 0.5, 1.0, 1.4];

/// Largest offsets in a search, in units of the stability.
const MOST: f64 = 2.0;

/// Simulated stars for a comparison with 1 %.
pub const DRAWS: usize = 2_000;

/// Nights of two profiles at least: fewer do not distinguish offsets from a jitter.
const NIGHTS: usize = 3;

/// Effect of nightly offsets on a planet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NightOffsets {
    /// Their most likely standard deviation without a planet (km/s).
    pub sigma_kms: f64,
    /// By how much they raise ln L of a star without a planet, including their prior.
    pub gain: f64,
    /// False-alarm probability of the peak, or of K of a known planet, by stars without it that have such offsets.
    pub false_alarm_probability: f64,
}

/// Assignment of profiles to nights.
#[derive(Clone, Debug, PartialEq)]
pub struct Nights(DMatrix<f64>);

impl Nights {
    /// The profiles of each night. `None` where they do not distinguish offsets from a jitter.
    pub fn new(profiles: usize, nights: &[Vec<usize>]) -> Option<Self> {
        if nights.iter().filter(|night| night.len() > 1).count() < NIGHTS {
            return None;
        }
        let mut of_night = DMatrix::zeros(profiles, nights.len());
        for (night, profiles) in nights.iter().enumerate() {
            profiles.iter().for_each(|k| of_night[(*k, night)] = 1.0);
        }
        Some(Nights(of_night))
    }

    /// No nights.
    pub(super) fn none(profiles: usize) -> Self {
        Nights(DMatrix::zeros(profiles, 0))
    }

    /// Units of trial sizes beside orbits, where the jitter is `found_kms` without offsets and stars without a planet
    /// have the noise `null`: that, or what chance mimics; offsets go up to `most_kms`.
    pub(super) fn units(
        &self,
        without: &VelocityQuadratic,
        null: Scatter,
        (found_kms, most_kms): (f64, f64),
    ) -> Scatter {
        let of_nights = self.0.tr_mul(&(&without.information * &self.0));
        Scatter {
            jitter_kms: found_kms.max(by_chance_kms(&without.information)),
            night_kms: null.night_kms.max(by_chance_kms(&of_nights)).min(most_kms / PARTS[PARTS.len() - 1]),
        }
    }

    /// The nights of a subset of `all` profiles, matched by their rotation cycles, both in the same order.
    #[must_use]
    pub fn of(&self, left: &[f64], all: &[f64]) -> Self {
        let mut left = left.iter().peekable();
        let kept: Vec<usize> = (0..all.len()).filter(|k| left.next_if(|cycle| **cycle == all[*k]).is_some()).collect();
        Nights(self.0.select_rows(&kept))
    }
}

/// Offsets of nights in a star without a planet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offsets {
    /// Their most likely standard deviation (km/s).
    pub sigma_kms: f64,
    /// By how much they raise ln L, including their prior.
    pub gain: f64,
}

/// The likelihood of the velocities with a jitter, found to be `found_kms` without a planet, and with offsets of
/// `nights`, at most twice the stability of the spectrograph, both with the prior of that (`jitter::ln_prior`).
pub fn beside_offsets(without: &VelocityQuadratic, nights: &Nights, jitter: (f64, f64)) -> Option<(Jitters, Offsets)> {
    beside_up_to(most_offset_kms(jitter.1), without, nights, jitter)
}

/// The same with offsets of at most `most_kms`.
fn beside_up_to(
    most_kms: f64,
    without: &VelocityQuadratic,
    nights: &Nights,
    jitter @ (found_kms, stability_kms): (f64, f64),
) -> Option<(Jitters, Offsets)> {
    let (null, gain) = likeliest(most_kms, without, nights, jitter)?;
    let units = nights.units(without, null, (found_kms, most_kms));
    let all = beside(without, nights, (null, units), stability_kms)?;
    Some((all, Offsets { sigma_kms: null.night_kms, gain }))
}

/// The most likely jitter and offsets where these velocities are 0; arguments as in [`beside_offsets`].
pub fn most_likely(without: &VelocityQuadratic, nights: &Nights, jitter: (f64, f64)) -> Option<Scatter> {
    likeliest(most_offset_kms(jitter.1), without, nights, jitter).map(|(scatter, _)| scatter)
}

/// The same with offsets of at most `most_kms`, and by how much these raise ln L, including their prior.
fn likeliest(
    most_kms: f64,
    without: &VelocityQuadratic,
    nights: &Nights,
    (found_kms, stability_kms): (f64, f64),
) -> Option<(Scatter, f64)> {
    let error_kms = (without.len() as f64 / without.information.trace()).sqrt();
    let (first, last, factor) = OFFSETS;
    let mut sizes = vec![0.0];
    let mut size = first;
    while size <= last {
        sizes.push(size * found_kms.max(error_kms));
        size *= factor;
    }
    let sizes = clipped(&sizes, most_kms);
    let jitters = if found_kms > 0.0 { JITTERS.map(|part| part * found_kms).to_vec() } else { vec![0.0] };
    let tried = scatters(&jitters, &sizes);
    let of = |one: &Scatter| Beside::new(without, nights, *one, stability_kms);
    let height = |one: &Scatter| of(one).map_or(f64::NEG_INFINITY, |of| of.height);
    let heights: Vec<f64> = tried.par_iter().map(height).collect();
    let highest = |with: bool| {
        let among = (0..tried.len()).filter(|k| with || tried[*k].night_kms == 0.0);
        among.max_by(|a, b| heights[*a].total_cmp(&heights[*b]))
    };
    let (plain, best) = (highest(false)?, highest(true)?);
    Some((tried[best], heights[best] - heights[plain]))
}

/// The same with the offsets found in `of_all` profiles, of which these are a subset.
pub fn beside_offsets_of(
    of_all: &Jitters,
    without: &VelocityQuadratic,
    nights: &Nights,
    stability_kms: f64,
) -> Option<Jitters> {
    beside(without, nights, (of_all.null?, of_all.units), stability_kms)
}

/// The same where `null` has the jitter and offsets of stars without a planet; trial sizes are in these units.
pub(super) fn beside(
    without: &VelocityQuadratic,
    nights: &Nights,
    (null, units): (Scatter, Scatter),
    stability_kms: f64,
) -> Option<Jitters> {
    let jitters = SIZES.map(|size| size * units.jitter_kms);
    let mut offsets = PARTS.map(|part| part * units.night_kms).to_vec();
    offsets.dedup();
    let of = |one: Scatter| Beside::new(without, nights, one, stability_kms);
    let all: Option<Vec<Beside>> = scatters(&jitters, &offsets).into_par_iter().map(of).collect();
    let of_jitter = ln_shares(&SIZES);
    let shares = ln_shares(&offsets).into_iter().flat_map(|night| of_jitter.iter().map(move |jitter| jitter + night));
    let (levels, covariance) = levels(without, &of(null)?, all?);
    Some(Jitters { levels, ln_shares: shares.collect(), null: Some(null), units, covariance })
}

/// The likelihood of the velocities with this noise, a jitter and offsets of `nights`.
pub fn with_noise(without: &VelocityQuadratic, nights: &Nights, noise: Scatter) -> Option<VelocityQuadratic> {
    Some(Beside::new(without, nights, noise, f64::INFINITY)?.likelihood(without))
}

/// As [`beside_offsets`], of any size. `None` where zero offsets are the most likely without a planet.
fn beside_needed(without: &VelocityQuadratic, nights: &Nights, jitter: (f64, f64)) -> Option<(Jitters, Offsets)> {
    beside_up_to(f64::INFINITY, without, nights, jitter).filter(|(_, offsets)| offsets.sigma_kms > 0.0)
}

/// Effect of nightly offsets of any size on the highest peak, at one of the frequencies (orbits a rotation cycle).
/// `None` where zero offsets are the most likely without a planet.
pub fn peak_beside_offsets(
    without: &VelocityQuadratic,
    nights: &Nights,
    jitter: (f64, f64),
    (frequency, frequencies): (f64, &Frequencies),
    SearchSettings { draws, seed }: SearchSettings,
) -> Option<NightOffsets> {
    let (all, Offsets { sigma_kms, gain }) = beside_needed(without, nights, jitter)?;
    let height = all.orbit_at(frequency)?.delta_ln_l;
    let alarm = FalseAlarm::draw(&all, &frequencies.per_cycle, DRAWS.min(draws), seed);
    Some(NightOffsets { sigma_kms, gain, false_alarm_probability: alarm.probability(height).value() })
}

/// The same for a known planet, given its velocities for K = 1.
pub fn known_beside_offsets(
    without: &VelocityQuadratic,
    nights: &Nights,
    jitter: (f64, f64),
    unit: &DVector<f64>,
    SearchSettings { draws, seed }: SearchSettings,
) -> Option<NightOffsets> {
    let (all, Offsets { sigma_kms, gain }) = beside_needed(without, nights, jitter)?;
    let (height, draws) = (all.height_above_zero(unit), DRAWS.min(draws));
    let above = amplitudes(&all, unit, draws, seed).into_iter().filter(|drawn| *drawn >= height).count();
    Some(NightOffsets { sigma_kms, gain, false_alarm_probability: (1 + above) as f64 / (1 + draws) as f64 })
}

/// Largest standard deviation of offsets that a search counts (km/s), for a spectrograph of that stability (km/s).
pub fn most_offset_kms(stability_kms: f64) -> f64 {
    MOST * stability_kms
}

/// Those of the `sizes` (km/s) that are at most `most_kms`, and that, where some are larger.
pub(super) fn clipped(sizes: &[f64], most_kms: f64) -> Vec<f64> {
    let mut clipped: Vec<f64> = sizes.iter().map(|size| size.min(most_kms)).collect();
    clipped.dedup();
    clipped
}

/// Each of the jitters with each of the offsets.
pub(super) fn scatters(jitters_kms: &[f64], nights_kms: &[f64]) -> Vec<Scatter> {
    let with = |night_kms: f64| jitters_kms.iter().map(move |kms| Scatter { jitter_kms: *kms, night_kms });
    nights_kms.iter().copied().flat_map(with).collect()
}

/// The velocities with a jitter and offsets.
pub(super) struct Beside {
    /// L.
    columns: DMatrix<f64>,
    /// `C^-1 L'`, `A = C C'`: M is its square.
    pub solved: DMatrix<f64>,
    /// `I L C'^-1`.
    moved: DMatrix<f64>,
    /// `-ln det A / 2`, including the prior.
    pub constant: f64,
    /// ln L at velocities 0, including the prior, relative to that without jitter and offsets.
    pub height: f64,
}

impl Beside {
    pub fn new(
        without: &VelocityQuadratic,
        Nights(of_night): &Nights,
        scatter: Scatter,
        stability_kms: f64,
    ) -> Option<Self> {
        let Scatter { jitter_kms, night_kms } = scatter;
        let n = without.len();
        let jitter = if jitter_kms > 0.0 { n } else { 0 };
        let nights = if night_kms > 0.0 { of_night.ncols() } else { 0 };
        let mut columns = DMatrix::zeros(n, jitter + nights);
        (0..jitter).for_each(|k| columns[(k, k)] = jitter_kms);
        columns.columns_mut(jitter, nights).copy_from(&(of_night.columns(0, nights) * night_kms));
        let turned = columns.transpose();
        let inner = &turned * (&without.information * &columns);
        let inner = DMatrix::identity(jitter + nights, jitter + nights) + 0.5 * (&inner + inner.transpose());
        let factor = inner.cholesky()?.unpack();
        let solved = factor.solve_lower_triangular(&turned)?;
        let moved = &without.information * solved.transpose();
        let prior = ln_prior(jitter_kms, stability_kms) + ln_prior(night_kms, stability_kms);
        let constant = prior - factor.diagonal().iter().map(|x| x.ln()).sum::<f64>();
        let height = constant + 0.5 * (&solved * &without.gradient).norm_squared();
        Some(Beside { columns, solved, moved, constant, height })
    }

    /// From gradients without the noise to those with it.
    pub fn kept(&self) -> DMatrix<f64> {
        let n = self.moved.nrows();
        DMatrix::identity(n, n) - &self.moved * &self.solved
    }

    /// The likelihood of the velocities with this noise.
    pub fn likelihood(&self, without: &VelocityQuadratic) -> VelocityQuadratic {
        VelocityQuadratic {
            cycles: without.cycles.clone(),
            gradient: &without.gradient - &self.moved * (&self.solved * &without.gradient),
            information: &without.information - &self.moved * self.moved.transpose(),
        }
    }
}

/// The likelihood with `all` of these; stars without a planet are those of `null`.
fn levels(without: &VelocityQuadratic, null: &Beside, all: Vec<Beside>) -> (Vec<Level>, DMatrix<f64>) {
    let best = all.iter().map(|beside| beside.height).fold(f64::NEG_INFINITY, f64::max);
    let level = |beside: Beside| Level {
        quadratic: beside.likelihood(without),
        ln_l: beside.height - best,
        constant: beside.constant,
        kept: beside.kept(),
        solved: beside.solved,
    };
    let moved = &without.information * &null.columns;
    let covariance = &without.information + &moved * moved.transpose();
    (all.into_iter().map(level).collect(), covariance)
}

#[cfg(test)]
mod tests;
