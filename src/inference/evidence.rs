//! The evidence for planets under the priors of a config: reported with a blind search.

use crate::model::{Clock, Elements, FreeParameter, Parameter, Prior, period_prior};
use crate::planets::evidence::{Density, Evidence, Inclusion, LnBayes, PlanetPrior, evidence};
use crate::planets::periodogram::Jitters;
use crate::planets::periodogram::eccentric::LARGEST_ECCENTRICITY;
use crate::planets::speeds::Speeds;
use crate::planets::verdict::{decimals, probability};
use serde::{Deserialize, Serialize};

/// A prior of K counts as wide if it reaches this many times farther than the standard error of K.
const WIDE: f64 = 100.0;

/// A normal prior is cut at this many standard deviations.
const FOLLOWED: f64 = 8.0;

/// A prior of the period that includes 0 is cut at this fraction of the longest.
const SHORTEST: f64 = 0.01;

/// Evidence for no, one and two planets, with spots as fitted without a planet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvidenceRecord {
    /// ln of the Bayes factor of one planet on a circular orbit relative to none.
    pub circle: LnBayes,
    /// The same on a Keplerian orbit.
    pub ellipse: LnBayes,
    /// The same for two planets on circular orbits.
    pub two_circles: LnBayes,
    /// Intervals of frequency, one over the time base wide, of least false inclusion probability.
    pub inclusion: Vec<InclusionRecord>,
    /// The priors, in words.
    pub priors: String,
    /// A summary sentence.
    pub sentence: String,
}

/// An interval of frequencies.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InclusionRecord {
    /// Period in its middle (d).
    pub period_d: f64,
    /// Probability that no planet has its frequency there.
    pub false_inclusion_probability: f64,
}

/// The priors of a planet.
#[derive(Clone, Copy)]
struct Assumed {
    k: (Prior, [f64; 2]),
    period: (Prior, [f64; 2]),
    largest_e: f64,
}

impl EvidenceRecord {
    /// Under the priors of `free` parameters, from the velocities of a star without a planet, with `jitters`. `None`
    /// where K or the period of the planet has no prior, or no orbit is bounded.
    pub fn of(free: &[FreeParameter], clock: Clock, seed: u64, jitters: &Jitters) -> Option<Self> {
        let [first, second] = &Elements::PLANETS;
        let one = Assumed::of(free, first, clock)?;
        // a second planet has the same priors unless the config gives others
        let two = Assumed::of(free, second, clock).unwrap_or(one);
        let found = one.with(|one| two.with(|two| evidence(jitters, [one, two], seed)))?;
        let error_kms = jitters.as_found().quadratic.information.trace().sqrt().recip() * 2f64.sqrt();
        Some(EvidenceRecord::new(found, [one, two], (error_kms, jitters), clock.rotation_period_d))
    }

    fn new(
        found: Evidence,
        [one, two]: [Assumed; 2],
        (error_kms, jitters): (f64, &Jitters),
        rotation_period_d: f64,
    ) -> Self {
        let record = |inclusion: &Inclusion| InclusionRecord {
            period_d: rotation_period_d * inclusion.porb_over_prot,
            false_inclusion_probability: inclusion.false_inclusion_probability,
        };
        let inclusion: Vec<InclusionRecord> = found.inclusion.iter().map(record).collect();
        let same = one.words(rotation_period_d) == two.words(rotation_period_d);
        let second = if same { String::new() } else { format!("; second planet: {}", two.words(rotation_period_d)) };
        let priors = format!("{}{second}", one.words(rotation_period_d));
        let number = |bayes: &LnBayes| match bayes.sd {
            Some(sd) => format!("{:.2} ± {sd:.2}", bayes.ln_bayes),
            None => format!("{:.2}", bayes.ln_bayes),
        };
        let Evidence { circle, ellipse, two_circles, .. } = found;
        let at = inclusion.first().map(|best| {
            let chance = probability(best.false_inclusion_probability);
            // half of the interval
            let cycles = &jitters.as_found().quadratic.cycles;
            let ends = cycles.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(*x), b.max(*x)]);
            let time_base_d = rotation_period_d * (ends[1] - ends[0]);
            let digits = decimals(0.5 * best.period_d.powi(2) / time_base_d);
            format!("; false inclusion probability {chance} at P = {:.digits$} d", best.period_d)
        });
        let wide = (one.k.1[1] > WIDE * error_kms)
            .then_some(" The prior of K is far wider than σ_K, which lowers all ln Bayes factors: narrow it.");
        let sentence = format!(
            "ln Bayes factor relative to no planet: 1 circular {}, 1 Keplerian {}, 2 circular {}{} (not used in the \
            verdict). Priors: {priors}.{}",
            number(&circle),
            number(&ellipse),
            number(&two_circles),
            at.unwrap_or_default(),
            wide.unwrap_or_default()
        );
        EvidenceRecord { circle, ellipse, two_circles, inclusion, priors, sentence }
    }
}

impl Assumed {
    fn of(free: &[FreeParameter], of: &Elements, clock: Clock) -> Option<Self> {
        let prior = |p: Parameter| free.iter().find(|f| f.parameter == p).map(|f| f.prior);
        // a known ephemeris has no choice of period
        prior(of.phi)?;
        let (k, period) = (prior(of.k)?, period_prior(free, of, clock)?);
        let largest_e = match prior(of.shape[0]) {
            Some(Prior::Disc { max_eccentricity }) => max_eccentricity,
            _ => LARGEST_ECCENTRICITY,
        };
        let [low, high] = followed(&period);
        let period = (period, [low.max(SHORTEST * high), high]);
        let [low, high] = followed(&k);
        Some(Assumed { k: (k, [low.max(0.0), high]), period, largest_e })
    }

    fn with<T>(&self, run: impl FnOnce(&PlanetPrior) -> T) -> T {
        let (k, period) = (self.k, self.period);
        let (ln_k, ln_period) = (move |x: f64| k.0.log_density(x), move |x: f64| period.0.log_density(x));
        let uniform = |prior: Prior| matches!(prior, Prior::Uniform { .. });
        run(&PlanetPrior {
            k: Density { ln: &ln_k, bounds: k.1, uniform: uniform(k.0) },
            period: Density { ln: &ln_period, bounds: period.1, uniform: uniform(period.0) },
            largest_e: self.largest_e,
        })
    }

    fn words(&self, rotation_period_d: f64) -> String {
        let days = self.period.0.in_units_of(rotation_period_d.recip());
        let unit = Speeds::of(&[self.k.1[1]]);
        let (k, period) = (words(&self.k.0, unit.factor), words(&days, 1.0));
        format!("K {k} {}, P {period} d, e uniform to {}", unit.name, self.largest_e)
    }
}

/// The bounds of a prior, or where it becomes negligible.
fn followed(prior: &Prior) -> [f64; 2] {
    let (low, high) = prior.bounds();
    match *prior {
        Prior::Normal { mean, sd, .. } => [low.max(mean - FOLLOWED * sd), high.min(mean + FOLLOWED * sd)],
        _ => [low, high],
    }
}

/// A prior of what is printed times `factor`.
fn words(prior: &Prior, factor: f64) -> String {
    let number = |x: f64| {
        let x = factor * x;
        if x != 0.0 && x.abs() < 1e-3 {
            return format!("{x:e}");
        }
        let digits = format!("{x:.4}");
        digits.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    match *prior {
        Prior::Uniform { min: 0.0, max } => format!("uniform to {}", number(max)),
        Prior::Uniform { min, max } => format!("uniform from {} to {}", number(min), number(max)),
        Prior::LogUniform { min, max } => format!("log-uniform from {} to {}", number(min), number(max)),
        Prior::Normal { mean, sd, .. } => format!("normal, {} ± {}", number(mean), number(sd)),
        Prior::Isotropic { .. } => "isotropic".to_owned(),
        Prior::Disc { .. } | Prior::Periodic => "uniform".to_owned(),
    }
}
