//! Periods at which spots mimic orbits: the rotation period, its multiples and fractions, and their aliases by the
//! sampling and by the day.
//!
//! Spots return with the rotation and distort each line several times as they cross the disc, which gives signals at
//! `Prot/n`; where they evolve, or only every other rotation is sampled, at multiples as well. Profiles from one site
//! are taken once a day, so that each of these has reflections at one and two a day (Dawson & Fabrycky 2010), however
//! weak the window function is there.

use super::window::{Alias, SAME, WindowPeak, alias, is_same_frequency, window};
use serde::{Deserialize, Serialize};

/// Fractions and multiples of the rotation period that are considered.
const FRACTIONS: u32 = 4;

fn usual_multiples() -> u32 {
    4
}

/// Two periods are distinguished if their frequencies differ by more than this many standard errors, and by more than
/// the second number (in inverse time bases): evolving or differentially rotating spots do not keep their period.
const TOLD_APART: (f64, f64) = (3.0, 0.2);

/// The sampling has daily aliases where its window function is at least this high at one or two a day.
const DAILY: f64 = 0.1;

/// A period of the star, `numerator / denominator` rotations, and perhaps an alias of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Imitation {
    /// Rotations in so many periods.
    pub numerator: u32,
    /// Periods in so many rotations.
    pub denominator: u32,
    /// The peak of the window function that joins the two, for an alias; frequencies are a cycle of rotation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alias: Option<Alias>,
}

impl Imitation {
    /// `P_rot`, `P_rot/3`, `2 P_rot`.
    pub fn period(&self) -> String {
        match (self.numerator, self.denominator) {
            (1, 1) => "P_rot".to_owned(),
            (1, n) => format!("P_rot/{n}"),
            (n, _) => format!("{n} P_rot"),
        }
    }

    /// Whether spots are likely to produce a signal there: at the rotation period, its fractions and multiples, and at
    /// aliases of the first two, where most of their power is. Aliases of all others cover a large fraction of all
    /// periods.
    pub fn is_likely(&self) -> bool {
        self.alias.is_none() || self.numerator == 1 && self.denominator <= 2
    }

    /// In a few words: `consistent with 2 P_rot`, `alias of P_rot/3 by sampling at 1.003/d`.
    pub fn words(&self, rotation_period_d: f64) -> String {
        match &self.alias {
            None => format!("consistent with {}", self.period()),
            Some(alias) => {
                format!("alias of {} by sampling at {:.3}/d", self.period(), alias.window.frequency / rotation_period_d)
            }
        }
    }
}

/// The star's own periods under a sampling.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RotationPeriods {
    /// Frequencies that cause aliases: strong peaks of the window function, and the day where the sampling has daily
    /// aliases.
    pub window: Vec<WindowPeak>,
    /// Time base in rotation cycles.
    pub time_base_cycles: f64,
    /// The largest multiple of the rotation period considered. It is 1 for evolving spots: the field describes their
    /// return with each rotation and their lifetime.
    #[serde(default = "usual_multiples")]
    pub multiples: u32,
}

impl RotationPeriods {
    /// For profiles at `cycles` of a star with that rotation period, whose window function has these strong `peaks`.
    pub fn new(cycles: &[f64], rotation_period_d: f64, peaks: &[WindowPeak], time_base_cycles: f64) -> Self {
        let mut all = peaks.to_vec();
        for days in [1.0, 2.0] {
            let frequency = days * rotation_period_d;
            let near = |peak: &WindowPeak| is_same_frequency(peak.frequency, frequency, time_base_cycles);
            let height = window(cycles, frequency);
            if !all.iter().any(near) && height >= DAILY {
                all.push(WindowPeak { frequency, height });
            }
        }
        RotationPeriods { window: all, time_base_cycles, multiples: usual_multiples() }
    }

    /// The same for evolving spots: no multiples of the rotation period are considered.
    #[must_use]
    pub fn without_multiples(self) -> Self {
        RotationPeriods { multiples: 1, ..self }
    }

    /// The star's period with which `porb_over_prot`, known to `sigma`, is consistent, if any: a period rather than an
    /// alias, and fractions rather than multiples.
    pub fn imitated(&self, porb_over_prot: f64, sigma: Option<f64>) -> Option<Imitation> {
        let frequency = 1.0 / porb_over_prot;
        let sigma = sigma.filter(|s| s.is_finite()).unwrap_or(f64::INFINITY) * frequency * frequency;
        let wide = SAME / self.time_base_cycles;
        let tight = (TOLD_APART.0 * sigma).max(TOLD_APART.1 / self.time_base_cycles).min(wide);
        let own = || (1..=FRACTIONS).map(|n| (1, n)).chain((2..=self.multiples).map(|n| (n, 1)));
        let of = |(n, d): (u32, u32)| f64::from(d) / f64::from(n);
        let direct = own().find(|&pair| {
            let within = if pair.0 == 1 { wide } else { tight };
            (frequency - of(pair)).abs() < within
        });
        if let Some((numerator, denominator)) = direct {
            return Some(Imitation { numerator, denominator, alias: None });
        }
        let joined = |(numerator, denominator): (u32, u32)| {
            let alias = alias(frequency, of((numerator, denominator)), &self.window, tight)?;
            Some(Imitation { numerator, denominator, alias: Some(alias) })
        };
        own().find_map(joined)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// LO Peg's rotation, nights and the peaks due to its spots: 1.985 rotations, and 0.7308 d, which is 2.363/d less
    /// 1/d.
    #[test]
    fn multiples_and_daily_aliases_are_named() {
        let rotation_period_d = 0.4232;
        let days = [0.0, 3.07, 3.09, 3.12, 3.98, 4.02, 6.98, 7.08, 8.96, 9.0, 9.05, 10.97, 11.05, 14.96, 15.02, 15.21];
        let cycles: Vec<f64> = days.iter().map(|d| d / rotation_period_d).collect();
        let base = 15.21 / rotation_period_d;
        let periods = RotationPeriods::new(&cycles, rotation_period_d, &[], base);
        assert!(periods.window.iter().any(|peak| (peak.frequency - rotation_period_d).abs() < 1e-12), "{periods:?}");
        let words = |period: f64, sigma: f64| periods.imitated(period, Some(sigma)).map(|i| i.words(rotation_period_d));
        assert_eq!(words(1.985, 0.007).as_deref(), Some("consistent with 2 P_rot"));
        assert_eq!(words(0.7308 / rotation_period_d, 0.006).as_deref(), Some("alias of P_rot by sampling at 1.000/d"));
        assert_eq!(words(0.501, 0.0003).as_deref(), Some("consistent with P_rot/2"));
        assert_eq!(words(1.45, 0.004), None);
    }

    #[test]
    fn without_multiples_two_rotations_are_a_period_like_others() {
        let cycles: Vec<f64> = (0..50).map(|k| 0.6 * f64::from(k)).collect();
        let all = RotationPeriods::new(&cycles, 3.0, &[], 29.4);
        let own = all.clone().without_multiples();
        assert!(all.imitated(2.0, Some(0.01)).is_some() && own.imitated(2.0, Some(0.01)).is_none());
        assert_eq!(all.imitated(1.0, Some(0.01)), own.imitated(1.0, Some(0.01)));
    }

    /// A period five standard errors away from two rotations is distinguished from it, however few rotations were
    /// observed.
    #[test]
    fn what_is_told_apart_is_not_flagged() {
        let cycles: Vec<f64> = (0..50).map(|k| 0.06 * f64::from(k)).collect();
        let periods = RotationPeriods::new(&cycles, 3.0, &[], 2.94);
        assert_eq!(periods.imitated(1.69, Some(0.058)), None);
        assert!(periods.imitated(1.9, Some(0.058)).is_some());
        assert!(periods.imitated(1.69, None).is_some(), "nobody knows how well it is known");
    }
}
