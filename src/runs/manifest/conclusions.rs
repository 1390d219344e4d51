//! Conclusions from a chain, given its priors and the blind search: the constrained parameters, the modes of the
//! period, and the verdict.
//!
//! The verdict is that of the blind search. A chain assumes a planet, so that it can only weaken the verdict: where its
//! K is compatible with zero, or its period has several modes, a detection becomes a candidate.

use crate::data::config::Settings;
use crate::model::{Clock, Elements, FreeParameter, OrbitQuantity, Parameter, Prior, period_prior};
use crate::numerics::quantile::quantile;
use crate::numerics::text::aligned;
use crate::planets::modes::{PeriodMode, are_few, doubts, period_modes, shares};
use crate::planets::periodogram::RotationPeriods;
use crate::planets::verdict::{Remark, Verdict};
use crate::runs::blind_search::SearchSummary;
use crate::sampling::chain::{Chain, ParameterSummary, Summary, table};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A parameter whose 68 % interval is wider than this fraction of its prior's is not constrained.
const UNCONSTRAINED: f64 = 0.7;

/// Modes of the period that are shown.
const MODES_SHOWN: usize = 6;

/// Draws of a prior for its width, to 2 %.
const PRIOR_DRAWS: usize = 4001;

/// The summary of a run's chain, and its implications for a planet; serialised, it is `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunSummary {
    /// The summary of the chain.
    #[serde(flatten)]
    pub chain: Summary,
    /// The verdict on a planet; absent where no orbit was searched for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
    /// The modes of the period, by decreasing weight; empty where it was not sampled.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub period_modes: Vec<PeriodMode>,
    /// Remarks beside the verdict.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// Access to the summary of the chain alone.
impl std::ops::Deref for RunSummary {
    type Target = Summary;

    fn deref(&self) -> &Summary {
        &self.chain
    }
}

/// The table that `dimcmc analyse` prints.
impl std::fmt::Display for RunSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.table(None).trim_end())
    }
}

impl RunSummary {
    /// The verdict above the table of the chain. With `truth` (injected values by name) there is a column for it.
    pub fn table(&self, truth: Option<&BTreeMap<String, f64>>) -> String {
        let verdict = self.verdict.as_ref().map(|verdict| format!("{}\n\n", verdict.sentence)).unwrap_or_default();
        verdict + &table::parameters(&self.chain, truth) + &self.modes_table() + &table::rest(&self.chain, truth)
    }

    /// Whether the period has several modes, or one that spots may mimic.
    pub fn has_modes_to_show(&self) -> bool {
        self.period_modes.len() > 1 || self.period_modes.iter().any(|mode| mode.rotation.is_some())
    }

    fn modes_table(&self) -> String {
        if !self.has_modes_to_show() {
            return String::new();
        }
        let head = ["mode of the period", "weight", "porb_over_prot", "68% interval", "k_kms", ""];
        let row = |(k, mode): (usize, &PeriodMode)| {
            let [low, high] = mode.ci68;
            let digits = (1.0 - (high - low).log10().floor()).clamp(2.0, 9.0) as usize;
            vec![
                (k + 1).to_string(),
                format!("{:.2}", mode.weight),
                format!("{:.digits$}", mode.porb_over_prot),
                format!("[{low:.digits$}, {high:.digits$}]"),
                format!("{:.3}", mode.k_kms),
                mode.rotation.clone().unwrap_or_default(),
            ]
        };
        let rows = self.period_modes.iter().enumerate().take(MODES_SHOWN).map(row);
        aligned(&std::iter::once(head.map(str::to_owned).to_vec()).chain(rows).collect::<Vec<_>>())
    }
}

impl RunSummary {
    /// For a run by `settings` whose `chain` has this `summary`, with the blind search; a run of the first versions has
    /// none.
    pub(super) fn of(chain: &Chain, summary: Summary, settings: &Settings, search: Option<&SearchSummary>) -> Self {
        let rotation = search.and_then(|search| search.rotation.as_ref());
        let modes = rotation.and_then(|rotation| modes(chain, summary.discarded_steps, settings, rotation));
        let period_modes = modes.unwrap_or_default();
        let mut summary = RunSummary { chain: summary, verdict: None, period_modes, remarks: Vec::new() };
        let few = rotation.is_some_and(|rotation| are_few(&summary.period_modes, rotation));
        let of_the_chain = &mut summary.chain;
        for f in &settings.free {
            let is_period = matches!(f.parameter, Parameter::PorbOverProt | Parameter::Period);
            if let Some(one) = of_the_chain.parameters.get_mut(f.parameter.name()) {
                one.unconstrained = !(few && is_period) && is_as_wide(one, f);
            }
        }
        let is_open = |p: Parameter| of_the_chain.parameters.get(p.name()).is_some_and(|one| one.unconstrained);
        let period_is_open = is_open(Parameter::PorbOverProt);
        let period_d = of_the_chain.derived.get(OrbitQuantity::Period.name()).map(|one| one.median);
        let fixed_d = settings.star.rotation_period_d * settings.values[Parameter::PorbOverProt];
        let turn_d = period_d.unwrap_or(fixed_d);
        for quantity in [OrbitQuantity::Period, OrbitQuantity::Maximum, OrbitQuantity::Conjunction] {
            if let Some(one) = of_the_chain.derived.get_mut(quantity.name()) {
                one.unconstrained = match quantity {
                    OrbitQuantity::Period => period_is_open,
                    // however far away the origin of the phase is
                    _ => fills_turn(one, turn_d),
                };
            }
        }
        let is_planet_sampled = summary.parameters.contains_key(Parameter::K.name());
        match search.filter(|_| is_planet_sampled) {
            Some(search) => {
                let remarks = summary.of_the_planet(settings, search);
                let mut verdict = search.verdict.clone().with(&remarks);
                if !summary.period_modes.is_empty() {
                    verdict = verdict.with_periods(shares(&summary.period_modes, settings.star.rotation_period_d));
                }
                summary.verdict = Some(verdict);
                let all = search.remarks.iter().chain(&remarks).map(|remark| &remark.text);
                summary.remarks = all.filter(|text| !text.is_empty()).cloned().collect();
            }
            None if is_planet_sampled => {
                let why = "this run was started by a version without a blind search";
                summary.verdict = Some(Verdict::not_judged(why));
            }
            None => {}
        }
        summary
    }

    /// The effect of the chain on the verdict of the blind search.
    fn of_the_planet(&self, settings: &Settings, search: &SearchSummary) -> Vec<Remark> {
        let mut remarks = Vec::new();
        let (is_found, rotation_period_d) = (search.verdict.finding.is_signal(), settings.star.rotation_period_d);
        match (is_found, self.parameters[Parameter::K.name()].upper95) {
            (true, Some(_)) => remarks.push(Remark::against(
                "posterior K consistent with zero",
                "The blind search finds a signal, but the posterior of K is consistent with zero.",
            )),
            (false, None) => remarks.push(Remark::note(
                "The MCMC assumes a planet: K > 0 is meaningful only if the blind search finds a significant signal.",
            )),
            _ => {}
        }
        if is_found {
            // the period of a planet of known ephemeris is no choice of the search
            if search.verdict.known.is_none() {
                remarks.extend(doubts(&self.period_modes));
            }
            let heaviest = self.period_modes.first().map(|mode| mode.porb_over_prot);
            let period = heaviest.unwrap_or(settings.values[Parameter::PorbOverProt]);
            remarks.extend(search.of_another_orbit(period, rotation_period_d));
        }
        if !self.converged {
            let text = "Chain not converged: do not quote its intervals.";
            remarks.push(Remark::against("chain not converged", text));
        }
        let clock = Clock { rotation_period_d, epoch_d: settings.star.epoch_d };
        let period = period_prior(&settings.free, &Elements::PLANETS[0], clock);
        if let Some(shortest) = period.map(|prior| prior.bounds().0).filter(|shortest| *shortest > 1.0) {
            remarks.push(Remark::note(format!(
                "The period prior starts at {shortest:.4} P_rot: spot signals at P_rot and its harmonics appear \
                only as aliases."
            )));
        }
        remarks
    }
}

/// The modes of the period; `None` where it is not sampled, or K is not.
fn modes(chain: &Chain, discarded: usize, settings: &Settings, rotation: &RotationPeriods) -> Option<Vec<PeriodMode>> {
    let rotation_period_d = settings.star.rotation_period_d;
    let place = |p: Parameter| chain.names().iter().position(|name| name == p.name());
    let ratio = place(Parameter::PorbOverProt).map(|i| (i, 1.0));
    let (period, unit) = ratio.or(place(Parameter::Period).map(|i| (i, rotation_period_d)))?;
    let draws = |i: usize| chain.series(i, discarded).into_iter().flatten().flatten();
    let draws = draws(period).map(|period| period / unit).zip(draws(place(Parameter::K)?));
    Some(period_modes(&draws.collect::<Vec<_>>(), rotation, rotation_period_d))
}

/// Whether a time is unconstrained within an orbit's period (d).
fn fills_turn(one: &ParameterSummary, turn_d: f64) -> bool {
    one.ci68[1] - one.ci68[0] > UNCONSTRAINED * 0.68 * turn_d
}

/// Whether the posterior is about as wide as the prior, unless the prior is informative: a normal one is.
fn is_as_wide(one: &ParameterSummary, f: &FreeParameter) -> bool {
    let width = |[low, high]: [f64; 2]| match f.prior {
        Prior::LogUniform { .. } => (high / low).ln(),
        _ => high - low,
    };
    match f.prior {
        // the limit constrains an amplitude
        _ if f.parameter.is_amplitude() => false,
        Prior::Normal { .. } => false,
        Prior::Periodic => width(one.hdi68) > UNCONSTRAINED * 0.68,
        prior => width(one.ci68) > UNCONSTRAINED * width(interval68(&prior)),
    }
}

fn interval68(prior: &Prior) -> [f64; 2] {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut draws: Vec<f64> = (0..PRIOR_DRAWS).map(|_| prior.sample(&mut rng)).collect();
    draws.sort_unstable_by(f64::total_cmp);
    [quantile(&draws, 0.16), quantile(&draws, 0.84)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary(ci68: [f64; 2]) -> ParameterSummary {
        let [low, high] = ci68;
        let middle = 0.5 * (low + high);
        ParameterSummary {
            median: middle,
            mean: middle,
            sd: 0.5 * (high - low),
            mode: middle,
            ci68,
            ci95: ci68,
            hdi68: ci68,
            hdi95: ci68,
            rhat: None,
            ess: None,
            tau: None,
            unconstrained: false,
            widened: None,
            upper95: None,
        }
    }

    /// A phase relative to a time long before the data may be unconstrained, and the time of an event in the data
    /// constrained; a period from transits is no better constrained by the profiles, and is known.
    #[test]
    fn a_quantity_is_asked_whether_it_is_open() {
        assert!(!fills_turn(&summary([2459000.0, 2459000.15]), 5.0));
        assert!(fills_turn(&summary([2459000.0, 2459003.2]), 5.0));
        let of = |prior| FreeParameter { parameter: Parameter::PorbOverProt, prior };
        let known = summary([1.699, 1.701]);
        assert!(!is_as_wide(&known, &of(Prior::Normal { mean: 1.7, sd: 0.001, min: 1.0, max: 3.0 })));
        assert!(is_as_wide(&known, &of(Prior::Uniform { min: 1.6985, max: 1.7015 })));
    }
}
