//! One star of a sample: its verdict, and the completeness of its search.

use super::boxes::PlanetBox;
use crate::numerics::normal;
use crate::planets::occurrence::{Completeness, InBox, Member, share_of_false_alarms};
use crate::planets::verdict::{Finding, Verdict};
use crate::runs::limits::{Limit, LimitsFile};
use crate::star::planet::minimum_mass;

/// A star with its search and its detection limits.
#[derive(Clone, Debug)]
pub struct Star {
    /// `star.name` of the config, else the name of its folder.
    pub name: String,
    /// Mass (solar masses), where the config has it.
    pub mass_msun: Option<f64>,
    /// The verdict of the search.
    pub verdict: Verdict,
    /// Its limits.
    pub limits: LimitsFile,
    /// Fraction recovered at every period and K.
    pub completeness: Completeness,
    /// Its group in the sample.
    pub group: Option<String>,
    /// Probability that its signal is a planet's, if not chance.
    pub planet: f64,
    /// Warnings on its results.
    pub warnings: Vec<String>,
}

/// Why a star does not count in rates.
const NOT_JUDGED: &str = "no verdict, the star is not counted";
const KNOWN: &str = "a planet of known ephemeris: the star is not counted";

impl Star {
    /// Why it does not constrain rates; `None` where it does.
    pub fn left_out(&self) -> Option<&'static str> {
        match (self.verdict.finding, &self.verdict.known) {
            (Finding::NotJudged, _) => Some(NOT_JUDGED),
            (_, Some(_)) => Some(KNOWN),
            _ => None,
        }
    }

    /// Shortest and longest period (d) that were searched.
    pub fn searched_d(&self) -> [f64; 2] {
        let periods = self.limits.limits.iter().map(|limit| limit.period_d);
        periods.fold([f64::INFINITY, 0.0], |[low, high], period| [low.min(period), high.max(period)])
    }

    /// K (km/s) recovered at 50 or 95 % of the phases, between the periods injected linear in the logarithms; `None`
    /// beyond the periods and K injected.
    pub fn limit_kms(&self, period_d: f64, of: impl Fn(&Limit) -> Option<f64>) -> Option<f64> {
        let around =
            self.limits.limits.windows(2).find(|two| (two[0].period_d..=two[1].period_d).contains(&period_d))?;
        let [low, high] = [&around[0], &around[1]];
        let along = (period_d / low.period_d).ln() / (high.period_d / low.period_d).ln();
        let (first, last) = (of(low)?, of(high)?);
        Some(first * (last / first).powf(along))
    }

    /// Minimum mass (Jupiter masses) of a semi-amplitude, where the star's mass is known.
    pub fn msini_mjup(&self, period_d: f64, k_kms: f64) -> Option<f64> {
        self.mass_msun.map(|mass| minimum_mass(k_kms, period_d, mass).mjup)
    }

    /// Its contribution to a box.
    pub fn member(&self, planets: &PlanetBox) -> Member {
        let (span, k_kms) = (planets.span(), |period: f64, size: f64| planets.k_kms(period, size, self.mass_msun));
        let just_detected = |period: f64| self.limit_kms(period, |limit| limit.k50_kms);
        let share = share_of_false_alarms(&span, self.searched_d(), just_detected, k_kms);
        let threshold = self.limits.false_alarm_probability;
        let member =
            Member { completeness: self.completeness.mean(&span, k_kms), false_alarm: threshold * share, signal: None };
        let share = self.planet * self.share_within(planets);
        let probability = self.verdict.false_alarm_probability.filter(|p| *p < threshold && share > 0.0);
        let level = (threshold, self.limits.level);
        let signal = probability.map(|p| InBox::new(share, p, level, &member, planets.sizes));
        Member { signal, ..member }
    }

    /// Probability that the orbit of its signal is in a box: by the probabilities of an ambiguous period, and by the
    /// uncertainty of the size.
    fn share_within(&self, planets: &PlanetBox) -> f64 {
        let Some(signal) = self.verdict.signal.filter(|_| self.verdict.finding.is_signal()) else { return 0.0 };
        let within = |period: f64| {
            if !(planets.periods_d[0]..=planets.periods_d[1]).contains(&period) {
                return 0.0;
            }
            let z = |size: f64| (planets.k_kms(period, size, self.mass_msun) - signal.k_kms) / signal.sigma_k_kms;
            let [low, high] = planets.sizes.map(|size| normal::cumulative(z(size)));
            let share = high - low;
            if share.is_finite() { share } else { 0.0 }
        };
        match &self.verdict.periods[..] {
            [] => within(signal.period_d),
            shares => {
                let whole: f64 = shares.iter().map(|of| of.share).sum();
                shares.iter().map(|of| of.share / whole * within(of.period_d)).sum()
            }
        }
    }

    /// Whether the search covers the periods of a box, all but a twentieth of their logarithm.
    pub fn covers_periods(&self, planets: &PlanetBox) -> bool {
        let ([shortest, longest], [first, last]) = (self.searched_d(), planets.periods_d);
        let covered = (longest.min(last) / shortest.max(first)).ln();
        covered > 0.95 * (last / first).ln()
    }

    /// Whether planets of a box that are smaller than those injected would be found: they count as missed.
    pub fn finds_smaller(&self, planets: &PlanetBox) -> bool {
        let smallest = self.limits.k_kms.first().copied().unwrap_or_default();
        let least = planets.k_kms(planets.periods_d[1], planets.sizes[0], self.mass_msun);
        least < smallest && self.completeness.at_smallest_k() > 0.05
    }
}
