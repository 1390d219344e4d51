//! The verdict on a planet: all thresholds, and the one sentence that heads every result.
//!
//! One number is compared with the thresholds: the false-alarm probability of the highest peak over the whole blind
//! search. A detection must also have no caveats; otherwise it is a candidate, and the sentence names them. Convergence
//! of a chain does not enter.

use super::speeds::Speeds;
use crate::numerics::normal;
use serde::{Deserialize, Serialize};

/// Above this false-alarm probability there is no significant signal.
pub const CANDIDATE_FAP: f64 = 0.01;

/// Below this false-alarm probability a candidate without caveats is a detection.
pub const DETECTION_FAP: f64 = 1e-3;

/// A period with a smaller posterior share than this is ambiguous: odds of 20 to 1.
pub const UNAMBIGUOUS: f64 = 0.95;

/// Periods of a smaller share are not reported.
pub const LEAST_SHARE: f64 = 0.02;
const MOST_PERIODS: usize = 4;

/// The conclusion on a planet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Finding {
    /// The false-alarm probability is too high.
    NoPlanetNeeded,
    /// A low false-alarm probability, but not low enough for a detection, or with caveats.
    Candidate,
    /// A very low false-alarm probability, and no caveats.
    Detection,
    /// No verdict is possible.
    NotJudged,
}

impl Finding {
    /// Whether the signal has a low false-alarm probability.
    pub fn is_signal(self) -> bool {
        matches!(self, Finding::Candidate | Finding::Detection)
    }
}

/// A remark on a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Remark {
    /// A caveat in a few words for the verdict; `None` for mere information.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub against: Option<String>,
    /// The full sentence.
    pub text: String,
}

impl Remark {
    /// A caveat in a few words, and the full sentence.
    pub fn against(short: impl Into<String>, text: impl Into<String>) -> Self {
        Remark { against: Some(short.into()), text: text.into() }
    }

    /// Mere information.
    pub fn note(text: impl Into<String>) -> Self {
        Remark { against: None, text: text.into() }
    }
}

/// A period with its share of the posterior.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PeriodShare {
    /// Period (d).
    pub period_d: f64,
    /// Its share, from 0 to 1.
    pub share: f64,
}

/// The orbit of the verdict.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Signal {
    /// Period (d).
    pub period_d: f64,
    /// Its standard error (d); null on the edge of the search, or where the period is given.
    #[serde(default)]
    pub sigma_period_d: Option<f64>,
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Its standard error (km/s).
    pub sigma_k_kms: f64,
}

impl Signal {
    /// The period with its uncertainty.
    pub fn period(&self) -> String {
        match self.sigma_period_d {
            Some(sigma) => format!("{:.2$} ± {:.2$} d", self.period_d, sigma, decimals(sigma)),
            None => format!("{:.4} d", self.period_d),
        }
    }

    /// Period and K with their uncertainties; K in m/s below 1 km/s.
    pub fn words(&self) -> String {
        let Speeds { factor, name } = Speeds::of(&[self.k_kms]);
        let [k, sigma] = [self.k_kms, self.sigma_k_kms].map(|kms| factor * kms);
        let digits = decimals(sigma);
        format!("P = {}, K = {k:.digits$} ± {sigma:.digits$} {name}", self.period())
    }
}

/// Decimals that show two digits of a standard error.
pub fn decimals(sigma: f64) -> usize {
    if sigma > 0.0 && sigma.is_finite() { (1.0 - sigma.log10().floor()).clamp(0.0, 12.0) as usize } else { 4 }
}

/// The verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The conclusion.
    pub finding: Finding,
    /// The sentence that heads the result.
    pub sentence: String,
    /// The number that was compared with the thresholds; null where there is none.
    pub false_alarm_probability: Option<f64>,
    /// Number of simulations without a planet that it comes from; absent for a planet of known ephemeris.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub draws: Option<usize>,
    /// The best orbit; null where there is none.
    pub signal: Option<Signal>,
    /// Caveats, in a few words each.
    pub against: Vec<String>,
    /// Periods with their posterior shares, the largest first, where none has 95 %: aliases of each other by the
    /// sampling, or periods that the profiles do not resolve. Empty where the period is unambiguous.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub periods: Vec<PeriodShare>,
    /// The result for a planet of known ephemeris, for which no other period is searched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub known: Option<Known>,
}

/// A planet whose period and conjunction are known: only K is unknown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// K over its standard error, where K may have either sign.
    pub significance: f64,
    /// 95 % upper limit on K (km/s), for K of 0 or more.
    pub k_upper95_kms: f64,
    /// Number of the planet (from 1), where several are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planet: Option<usize>,
}

/// Why a planet of known ephemeris has no verdict.
pub const UNBOUNDED: &str = "the profiles do not bound K at this ephemeris";

/// The probability that a standard normal deviate exceeds `z`.
pub fn one_sided(z: f64) -> f64 {
    normal::cumulative(-z)
}

impl Verdict {
    /// The verdict on a planet of known ephemeris, with its number (from 1) where there are several: `alone` is K with
    /// its standard error where it is not in the model, `signal` where it is, and its 95 % upper limit. The false-alarm
    /// probability is that of one period, one-sided.
    pub fn of_known(
        planet: Option<usize>,
        alone: [f64; 2],
        signal: Signal,
        k_upper95_kms: f64,
        remarks: &[Remark],
    ) -> Self {
        let significance = alone[0] / alone[1];
        if !significance.is_finite() {
            return Verdict::not_judged(UNBOUNDED);
        }
        let known = Known { significance, k_upper95_kms, planet };
        Verdict::judged((one_sided(significance), None), signal, remarks, Some(known))
    }

    /// Of a signal with that false-alarm probability, from that many simulations.
    pub fn new(false_alarm_probability: f64, draws: usize, signal: Signal, remarks: &[Remark]) -> Self {
        Verdict::judged((false_alarm_probability, Some(draws)), signal, remarks, None)
    }

    fn judged(
        (false_alarm_probability, draws): (f64, Option<usize>),
        signal: Signal,
        remarks: &[Remark],
        known: Option<Known>,
    ) -> Self {
        if false_alarm_probability.is_nan() {
            return Verdict::not_judged("there is no false-alarm probability");
        }
        let mut against: Vec<String> = Vec::new();
        for short in remarks.iter().filter_map(|remark| remark.against.as_ref()) {
            if !against.contains(short) {
                against.push(short.clone());
            }
        }
        let finding = match false_alarm_probability {
            p if p < DETECTION_FAP && against.is_empty() => Finding::Detection,
            p if p < CANDIDATE_FAP => Finding::Candidate,
            _ => Finding::NoPlanetNeeded,
        };
        let sentence = match known {
            Some(known) => sentence_of_known(finding, false_alarm_probability, &signal, &known, &against),
            None => sentence(finding, &chance(false_alarm_probability, draws), &signal, &against, &[]),
        };
        Verdict {
            finding,
            sentence,
            false_alarm_probability: Some(false_alarm_probability),
            draws,
            signal: Some(signal),
            against,
            periods: Vec::new(),
            known,
        }
    }

    /// The same with these posterior shares of periods (in any order, summing to 1 or less) in place of the former: a
    /// planet may be detected while its period is ambiguous.
    pub fn with_periods(mut self, mut shares: Vec<PeriodShare>) -> Self {
        let (Some(probability), Some(signal)) = (self.false_alarm_probability, self.signal) else { return self };
        if self.known.is_some() {
            return self;
        }
        shares.sort_by(|a, b| b.share.total_cmp(&a.share));
        let is_clear = shares.first().is_none_or(|first| first.share > UNAMBIGUOUS);
        shares.retain(|of| of.share >= LEAST_SHARE);
        shares.truncate(MOST_PERIODS);
        self.periods = if is_clear || shares.len() < 2 { Vec::new() } else { shares };
        self.sentence = sentence(self.finding, &chance(probability, self.draws), &signal, &self.against, &self.periods);
        self
    }

    /// The same with additional caveats: a detection becomes a candidate.
    pub fn with(self, remarks: &[Remark]) -> Self {
        let Verdict { false_alarm_probability: Some(probability), signal: Some(signal), .. } = self else {
            return self;
        };
        let mut all: Vec<Remark> = self.against.iter().map(|short| Remark::against(short, "")).collect();
        all.extend_from_slice(remarks);
        Verdict::judged((probability, self.draws), signal, &all, self.known).with_periods(self.periods)
    }

    /// No verdict, with the reason.
    pub fn not_judged(why: impl std::fmt::Display) -> Self {
        Verdict {
            finding: Finding::NotJudged,
            sentence: format!("No verdict: {why}."),
            false_alarm_probability: None,
            draws: None,
            signal: None,
            against: Vec::new(),
            periods: Vec::new(),
            known: None,
        }
    }
}

fn sentence_of_known(finding: Finding, chance: f64, signal: &Signal, known: &Known, against: &[String]) -> String {
    let Known { significance, k_upper95_kms, planet } = *known;
    let planet = planet.map_or_else(String::new, |number| format!(" {number}"));
    let head = match finding {
        Finding::NoPlanetNeeded => "not detected",
        Finding::Candidate if against.is_empty() => "marginal (FAP < 1 %)",
        Finding::Candidate => "marginal",
        Finding::Detection => "detected (FAP < 0.1 %)",
        Finding::NotJudged => return String::new(),
    };
    format!(
        "Known planet{planet}: {head}. {}; K > 0 at {significance:.1}σ (one-sided p = {}); K < {} (95 % upper \
        limit).{}",
        signal.words(),
        probability(chance),
        speed(k_upper95_kms, signal.sigma_k_kms),
        caveats(against)
    )
}

fn sentence(finding: Finding, chance: &str, signal: &Signal, against: &[String], periods: &[PeriodShare]) -> String {
    let ambiguous = match (finding.is_signal(), periods) {
        (false, _) | (true, []) => String::new(),
        (true, periods) => {
            let of = |PeriodShare { period_d, share }: &PeriodShare| {
                format!("{period_d:.0$} d ({1:.0} %)", if *period_d < 1.0 { 3 } else { 2 }, 100.0 * share)
            };
            format!(", period ambiguous: {}", periods.iter().map(of).collect::<Vec<_>>().join(", "))
        }
    };
    let orbit_head = if ambiguous.is_empty() { ": " } else { ". Highest peak: " };
    let orbit = signal.words();
    let percent = |share: f64| 100.0 * share;
    match finding {
        Finding::NoPlanetNeeded => {
            let threshold = percent(CANDIDATE_FAP);
            format!("No significant signal. Highest peak: {orbit}, {chance} (threshold {threshold} %).")
        }
        Finding::Candidate if against.is_empty() => {
            let threshold = percent(DETECTION_FAP);
            format!("Candidate{ambiguous}{orbit_head}{orbit}, {chance} (a detection requires < {threshold} %).")
        }
        Finding::Candidate => format!("Candidate{ambiguous}{orbit_head}{orbit}, {chance}.{}", caveats(against)),
        Finding::Detection if ambiguous.is_empty() => {
            format!("Detection: {orbit}, {chance}; all diagnostics passed.")
        }
        Finding::Detection => format!("Detection{ambiguous}{orbit_head}{orbit}, {chance}."),
        Finding::NotJudged => String::new(),
    }
}

fn caveats(against: &[String]) -> String {
    if against.is_empty() { String::new() } else { format!(" Caveats: {}.", against.join("; ")) }
}

/// Simulations of a search whose file does not have their number: what was usual before files had it.
pub fn usual_draws() -> usize {
    10_000
}

fn chance(p: f64, draws: Option<usize>) -> String {
    false_alarm(p, draws.unwrap_or_else(usual_draws))
}

/// The limit that so many simulations give, where `p` is extrapolated below it.
pub fn extrapolated(p: f64, draws: usize) -> Option<String> {
    let limit = 1.0 / draws.max(1) as f64;
    (p < limit).then(|| {
        // rounded up: it is a limit
        let digit = 10f64.powf(limit.log10().floor() - 1.0);
        format!("{:.1e}", (limit / digit - 1e-9).ceil() * digit).replace(".0e", "e")
    })
}

/// Extrapolated probabilities are not given below this: the tail of the fitted noise model is not known there.
const LEAST_EXTRAPOLATED: f64 = 1e-6;

/// A false-alarm probability in words; where it is extrapolated beyond the simulations, an upper limit with the
/// extrapolation, if that is another number.
pub fn false_alarm(p: f64, draws: usize) -> String {
    let Some(limit) = extrapolated(p, draws) else { return format!("FAP = {}", probability(p)) };
    let beyond = match p.max(LEAST_EXTRAPOLATED) {
        least if least * draws as f64 >= 1.0 => return format!("FAP < {limit}"),
        p if format!("{p:.0e}") == limit => return format!("FAP < {limit}"),
        LEAST_EXTRAPOLATED => "< 1e-6".to_owned(),
        p => format!("{p:.0e}"),
    };
    format!("FAP < {limit} (extrapolated: {beyond})")
}

/// A velocity (km/s) with as many digits as its uncertainty allows, in m/s below 1 km/s.
pub fn speed(kms: f64, sigma_kms: f64) -> String {
    let Speeds { factor, name } = Speeds::of(&[kms]);
    let digits = decimals(factor * sigma_kms);
    format!("{:.digits$} {name}", factor * kms)
}

/// The printed form of a probability.
pub fn probability(p: f64) -> String {
    match p {
        // smaller values underflow a double
        0.0 => "< 1e-300".to_owned(),
        p if p >= 0.1 => format!("{p:.2}"),
        p if p >= 1e-3 => format!("{p:.4}"),
        p => format!("{p:.1e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGNAL: Signal = Signal { period_d: 5.0692, sigma_period_d: Some(0.021), k_kms: 0.1034, sigma_k_kms: 0.0108 };

    /// A false-alarm probability below what the simulations resolve is a limit, rounded up.
    #[test]
    fn what_simulations_do_not_resolve_is_a_limit() {
        assert_eq!(false_alarm(3e-4, 1000), "FAP < 1e-3 (extrapolated: 3e-4)");
        assert_eq!(false_alarm(4.9e-4, 2000), "FAP < 5e-4");
        assert_eq!(false_alarm(3e-4, 10_000), "FAP = 3.0e-4");
        assert_eq!(false_alarm(5e-5, 1_000_000), "FAP = 5.0e-5");
        assert_eq!(extrapolated(1e-5, 3000).as_deref(), Some("3.4e-4"));
        assert_eq!(false_alarm(0.0, 10_000), "FAP < 1e-4 (extrapolated: < 1e-6)");
        assert_eq!(false_alarm(1e-9, 2_000_000), "FAP < 5e-7");
        let few = Verdict::new(3e-4, 1000, SIGNAL, &[]);
        assert!(few.sentence.contains("FAP < 1e-3 (extrapolated: 3e-4)"), "{}", few.sentence);
        // a file without their number has the usual one
        let mut old = serde_json::to_value(&few).unwrap();
        old.as_object_mut().unwrap().remove("draws");
        let old: Verdict = serde_json::from_value(old).unwrap();
        assert!(old.with(&[]).sentence.contains("FAP = 3.0e-4"));
    }

    #[test]
    fn a_known_planet_is_judged_by_its_own_period() {
        assert!((one_sided(1.6449) - 0.05).abs() < 1e-5);
        let verdict = Verdict::of_known(None, [0.1, 0.01], SIGNAL, 0.12, &[]);
        assert_eq!(verdict.finding, Finding::Detection);
        assert!(verdict.sentence.contains("K > 0 at 10.0σ"), "{}", verdict.sentence);
        let less = verdict.with(&[Remark::against("driven by a single night", "")]);
        assert_eq!(less.finding, Finding::Candidate);
        assert!(less.sentence.ends_with("Caveats: driven by a single night."), "{}", less.sentence);
        assert_eq!(Verdict::of_known(None, [0.01, 0.01], SIGNAL, 0.12, &[]).finding, Finding::NoPlanetNeeded);
        assert_eq!(Verdict::of_known(None, [0.0, 0.0], SIGNAL, 0.12, &[]).finding, Finding::NotJudged);
    }

    #[test]
    fn a_planet_may_be_detected_while_its_period_is_not() {
        let share = |period_d: f64, share: f64| PeriodShare { period_d, share };
        let of = |shares: Vec<PeriodShare>| Verdict::new(1e-5, 10_000, SIGNAL, &[]).with_periods(shares);
        let two = of(vec![share(4.93, 0.4), share(0.831, 0.58), share(1.2, 0.01)]);
        assert_eq!(two.finding, Finding::Detection);
        assert_eq!(two.periods, [share(0.831, 0.58), share(4.93, 0.4)]);
        let head = "Detection, period ambiguous: 0.831 d (58 %), 4.93 d (40 %). Highest peak: P = 5.069";
        assert!(two.sentence.starts_with(head), "{}", two.sentence);
        assert!(!two.sentence.contains("all diagnostics"), "{}", two.sentence);
        let less = two.with(&[Remark::against("driven by a single night", "")]);
        assert!(less.sentence.starts_with("Candidate, period ambiguous: 0.831 d (58 %)"), "{}", less.sentence);
        let clear = of(vec![share(4.93, 0.97), share(0.831, 0.03)]);
        assert!(clear.periods.is_empty() && clear.sentence.starts_with("Detection: "), "{}", clear.sentence);
        let settled = less.with_periods(vec![share(4.93, 0.97), share(0.831, 0.03)]);
        assert!(settled.periods.is_empty() && !settled.sentence.contains("ambiguous"), "{}", settled.sentence);
        let none = Verdict::new(0.5, 10_000, SIGNAL, &[]).with_periods(vec![share(4.93, 0.5), share(0.831, 0.5)]);
        assert!(!none.sentence.contains("ambiguous"), "{}", none.sentence);
    }

    #[test]
    fn one_number_and_what_speaks_against_it_decide() {
        let verdict = |p: f64, remarks: &[Remark]| Verdict::new(p, 10_000, SIGNAL, remarks);
        assert_eq!(verdict(1e-14, &[]).finding, Finding::Detection);
        assert_eq!(verdict(5e-3, &[]).finding, Finding::Candidate);
        assert_eq!(verdict(0.01, &[]).finding, Finding::NoPlanetNeeded);
        assert_eq!(verdict(f64::NAN, &[]).finding, Finding::NotJudged);
        assert_eq!(verdict(1e-14, &[Remark::note("few profiles")]).finding, Finding::Detection);
        let doubted = verdict(1e-14, &[Remark::against("P consistent with 2 P_rot", "long")]);
        assert_eq!(doubted.finding, Finding::Candidate);
        assert_eq!(
            doubted.sentence,
            "Candidate: P = 5.069 ± 0.021 d, K = 103 ± 11 m/s, FAP < 1e-4 (extrapolated: < 1e-6). Caveats: P \
            consistent with 2 P_rot."
        );
        assert_eq!(
            verdict(1e-14, &[]).with(&[Remark::against("driven by a single night", "")]).against,
            ["driven by a single night"]
        );
        assert!(
            verdict(0.71, &[]).sentence.starts_with("No significant signal. Highest peak: P = "),
            "{}",
            verdict(0.71, &[]).sentence
        );
    }
}
