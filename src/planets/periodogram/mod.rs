//! The Doppler-imaging periodogram: orbits blindly searched in the velocities of the profiles, spots marginalised out
//! (`docs/method.md` section 4).
//!
//! All of it follows from one quadratic in the velocities. Periods are in rotation cycles, `Porb/Prot`; days only where
//! the user states what to search (`frequencies`).

mod draws;
pub mod eccentric;
pub mod false_alarm;
pub mod frequencies;
pub mod injections;
mod jitter;
pub mod limits;
pub mod nights;
pub mod offset;
pub mod orbits;
pub mod peaks;
mod refine;
pub mod rotation;
#[cfg(test)]
pub mod sample;
pub mod two_planets;
pub mod window;

pub use eccentric::KeplerianOrbit;
pub use false_alarm::FalseAlarm;
pub use frequencies::{Frequencies, FrequencyError, FrequencySettings};
pub use injections::{Injections, Jitter, OfField};
pub use jitter::{Jitters, Scatter, USUAL_STABILITY_KMS, ln_prior};
pub use nights::most_offset_kms;
pub use orbits::{CircularOrbit, Trial};
pub use peaks::Peak;
pub use rotation::{Imitation, RotationPeriods};
pub use two_planets::TwoOrbits;

use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::CANDIDATE_FAP;
use jitter::BestTrial;
use limits::{detection_limit_kms, upper_limit_kms};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use window::{window, window_peaks};

/// Probability of the upper limit on K.
const CREDENCE: f64 = 0.95;

/// Settings of the false-alarm probability.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchSettings {
    /// Number of draws without a planet.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl SearchSettings {
    /// Default number of draws.
    pub const DRAWS: usize = 10_000;
}

impl Default for SearchSettings {
    fn default() -> Self {
        SearchSettings { draws: SearchSettings::DRAWS, seed: 1 }
    }
}

/// One trial period with its limits and window function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// The trial.
    pub trial: Trial,
    /// 95 % upper limit on K at this period (km/s).
    pub k_upper95_kms: Option<f64>,
    /// The window function at this frequency.
    pub window: f64,
    /// The K (km/s) that makes a candidate ([`CANDIDATE_FAP`]) with a chance of 50 %.
    pub k_limit50_kms: Option<f64>,
    /// The same with a chance of 95 %.
    pub k_limit95_kms: Option<f64>,
}

/// A blind search: every trial period, the peaks, and the distribution for their false-alarm probabilities.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// The trial periods, from long to short.
    pub rows: Vec<Row>,
    /// The peaks, from high to low; there is one at least.
    pub peaks: Vec<Peak>,
    /// The star's own periods, where spots mimic orbits.
    pub rotation: RotationPeriods,
    /// Gives the false-alarm probability of peaks.
    pub false_alarm: FalseAlarm,
}

/// No trial period at which the data bound an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the profiles do not bound the velocities of an orbit at any of the trial periods")]
pub struct Unbounded;

impl Search {
    /// Searches `quadratic` at the `frequencies`.
    ///
    /// # Errors
    /// [`Unbounded`].
    pub fn new(
        quadratic: &VelocityQuadratic,
        frequencies: &Frequencies,
        settings: SearchSettings,
    ) -> Result<Self, Unbounded> {
        Search::with_jitter(&Jitters::none(quadratic), frequencies, settings)
    }

    /// The same with an RV jitter of unknown size.
    ///
    /// # Errors
    /// [`Unbounded`].
    pub fn with_jitter(
        jitters: &Jitters,
        frequencies: &Frequencies,
        settings: SearchSettings,
    ) -> Result<Self, Unbounded> {
        let trials = jitters.scan(&frequencies.per_cycle);
        let quadratic = &jitters.as_found().quadratic;
        let Frequencies { time_base_cycles, rotation_period_d, .. } = *frequencies;
        let window_peaks = window_peaks(&quadratic.cycles, frequencies);
        let rotation = RotationPeriods::new(&quadratic.cycles, rotation_period_d, &window_peaks, time_base_cycles);
        let peaks = peaks::peaks(jitters, frequencies, &trials, &rotation);
        if peaks.is_empty() {
            return Err(Unbounded);
        }
        let false_alarm = FalseAlarm::draw(jitters, &frequencies.per_cycle, settings.draws, settings.seed);
        let level = false_alarm.level(CANDIDATE_FAP);
        // detection limits use the jitter of the observed star
        let as_found = orbits::scan(quadratic, &frequencies.per_cycle);
        let row = |(best, as_found): (&BestTrial, &Trial)| Row {
            trial: best.trial_above_no_planet(),
            k_upper95_kms: upper_limit_kms(&best.trial, CREDENCE),
            window: window(&quadratic.cycles, as_found.frequency),
            k_limit50_kms: detection_limit_kms(as_found, level, 0.5),
            k_limit95_kms: detection_limit_kms(as_found, level, 0.95),
        };
        let rows = trials.par_iter().zip(&as_found).map(row).collect();
        Ok(Search { rows, peaks, rotation, false_alarm })
    }

    /// The same where spots mimic no orbits of several rotations.
    #[must_use]
    pub fn without_multiples(mut self) -> Self {
        self.rotation = self.rotation.without_multiples();
        for peak in &mut self.peaks {
            peak.imitation = self.rotation.imitated(peak.porb_over_prot, peak.sigma_porb_over_prot);
        }
        self
    }

    /// The highest peak.
    pub fn best(&self) -> &Peak {
        &self.peaks[0]
    }
}

/// sigma_K at `Porb = Prot` over its median over trial periods away from it: how much worse an orbit is bounded where
/// the star's spots imitate one. `None` where the data bound none there.
pub fn co_rotation_penalty(jitters: &Jitters, rows: &[Row], frequencies: &Frequencies) -> Option<f64> {
    let here = jitters.orbit_at(1.0)?.sigma_k_kms;
    let off = |row: &Row| (row.trial.frequency - 1.0).abs() * frequencies.time_base_cycles;
    let away = rows.iter().filter(|row| off(row) > 1.0);
    let mut others: Vec<f64> = away.filter_map(|row| Some(row.trial.orbit?.sigma_k_kms)).collect();
    others.sort_by(f64::total_cmp);
    others.get(others.len() / 2).map(|median| here / median)
}
