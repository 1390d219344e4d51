//! Uncertainties of K, and the K that is detected, for profiles with known information.

use super::PlanSettings;
use crate::planets::periodogram::limits::detection_limit_kms;
use crate::planets::periodogram::orbits::{Trial, scan};
use crate::planets::periodogram::window::{WindowPeak, window_peaks};
use crate::planets::periodogram::{FalseAlarm, Frequencies, Jitters, RotationPeriods};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::CANDIDATE_FAP;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The constraints of profiles after some nights.
#[derive(Clone, Debug)]
pub struct Outlook {
    /// Planned nights that have passed.
    pub nights: usize,
    /// Profiles, including those taken before.
    pub profiles: usize,
    /// Trial periods of the search.
    pub frequencies: Frequencies,
    /// Delta ln L of a false-alarm probability of [`CANDIDATE_FAP`].
    pub level: f64,
    /// Peaks of the window function, which cause aliases.
    pub window: Vec<WindowPeak>,
    /// The star's own periods.
    pub rotation: RotationPeriods,
    /// One for each map.
    quadratics: Vec<VelocityQuadratic>,
}

/// The expectation at one period: medians over the maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Period over the rotation period.
    pub porb_over_prot: f64,
    /// Standard error of K (km/s), the square root of its variance averaged over phases; `None` where the profiles do
    /// not bound an orbit.
    pub sigma_k_kms: Option<f64>,
    /// The K (km/s) that is detected with a probability of 50 %.
    pub k50_kms: Option<f64>,
    /// The same with 95 %.
    pub k95_kms: Option<f64>,
}

impl Outlook {
    /// From the quadratics of some maps, at least one.
    pub(super) fn new(
        nights: usize,
        profiles: usize,
        quadratics: Vec<VelocityQuadratic>,
        frequencies: Frequencies,
        settings: &PlanSettings,
    ) -> Self {
        let mean = mean(&quadratics);
        let alone = Jitters::none(&mean);
        let false_alarm = FalseAlarm::draw(&alone, &frequencies.per_cycle, settings.draws, settings.seed);
        let level = false_alarm.level(CANDIDATE_FAP);
        let window = window_peaks(&mean.cycles, &frequencies);
        let Frequencies { rotation_period_d, time_base_cycles, .. } = frequencies;
        let rotation =
            RotationPeriods::new(&mean.cycles, rotation_period_d, &window, time_base_cycles).without_multiples();
        Outlook { nights, profiles, frequencies, level, window, rotation, quadratics }
    }

    /// The expectation at all trial periods.
    pub fn everywhere(&self) -> Vec<Expected> {
        let per_cycle: Vec<f64> = self.frequencies.per_cycle.iter().rev().copied().collect();
        self.at(&per_cycle)
    }

    /// The same at some frequencies (orbits per rotation cycle).
    pub fn at(&self, frequencies: &[f64]) -> Vec<Expected> {
        let of_maps: Vec<Vec<[Option<f64>; 3]>> = self
            .quadratics
            .iter()
            .map(|quadratic| scan(quadratic, frequencies).par_iter().map(|trial| self.of_trial(trial)).collect())
            .collect();
        let expected = |(k, frequency): (usize, &f64)| {
            let [sigma_k_kms, k50_kms, k95_kms] =
                [0, 1, 2].map(|number| median(of_maps.iter().map(|rows| rows[k][number]).collect()));
            Expected { porb_over_prot: 1.0 / frequency, sigma_k_kms, k50_kms, k95_kms }
        };
        frequencies.iter().enumerate().map(expected).collect()
    }

    /// Medians over periods (orbits per rotation cycle), with those at which no orbit is bounded counted as the worst.
    pub fn typical(&self, frequencies: &[f64]) -> Expected {
        let all = self.at(frequencies);
        let over = |number: fn(&Expected) -> Option<f64>| median(all.iter().map(number).collect());
        Expected {
            porb_over_prot: f64::NAN,
            sigma_k_kms: over(|e| e.sigma_k_kms),
            k50_kms: over(|e| e.k50_kms),
            k95_kms: over(|e| e.k95_kms),
        }
    }

    fn of_trial(&self, trial: &Trial) -> [Option<f64>; 3] {
        let bounded = trial.orbit.and_then(|_| trial.information.try_inverse());
        let sigma = bounded.map(|covariance| (0.5 * covariance.trace()).sqrt());
        let limit = |probability| detection_limit_kms(trial, self.level, probability);
        [sigma, limit(0.5), limit(0.95)]
    }
}

/// Mean information.
fn mean(quadratics: &[VelocityQuadratic]) -> VelocityQuadratic {
    let n = quadratics[0].len();
    let mut information = DMatrix::zeros(n, n);
    for quadratic in quadratics {
        information += &quadratic.information / quadratics.len() as f64;
    }
    VelocityQuadratic { cycles: quadratics[0].cycles.clone(), gradient: DVector::zeros(n), information }
}

/// Missing values count as larger than all others.
fn median(values: Vec<Option<f64>>) -> Option<f64> {
    let n = values.len();
    let mut known: Vec<f64> = values.into_iter().flatten().filter(|x| x.is_finite()).collect();
    known.sort_by(f64::total_cmp);
    match n % 2 {
        1 => known.get(n / 2).copied(),
        _ => known.get(n / 2).map(|upper| 0.5 * (known[n / 2 - 1] + upper)),
    }
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn what_is_missing_is_larger_than_all_else() {
        assert_eq!(median(vec![Some(3.0), None, Some(1.0)]), Some(3.0));
        assert_eq!(median(vec![Some(3.0), Some(1.0)]), Some(2.0));
        assert_eq!(median(vec![Some(3.0), None]), None);
    }
}
