//! What a chain says when its priors and the blind search are known: which parameters it constrains at all, the modes
//! of the period, and the verdict.
//!
//! The verdict is that of the blind search. A chain takes a planet for granted, so that it can only take something
//! away: where its K is compatible with zero, or its period is not one, a detection becomes a candidate.

use super::Manifest;
use crate::data::config::Settings;
use crate::model::{Elements, FreeParameter, OrbitQuantity, Parameter, Prior, period_prior};
use crate::planets::periodogram::RotationPeriods;
use crate::planets::verdict::{Finding, Remark, Verdict};
use crate::sampling::chain::modes::period_modes;
use crate::sampling::chain::statistics::quantile;
use crate::sampling::chain::{Chain, ParameterSummary, PeriodMode, Summary};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A parameter whose 68 % interval is wider than this share of its prior's is not constrained.
const UNCONSTRAINED: f64 = 0.7;

/// A mode that is wider than this (inverse time bases) is none: the data do not tell its periods from each other.
const BROAD: f64 = 1.0;

/// A period in no more modes than this, which hold at least that share of the draws, is constrained.
const FEW_MODES: (usize, f64) = (3, 0.68);

/// A mode of more weight than this has no rival.
const ALONE: f64 = 0.95;

/// What follows from the orbit means nothing where one of these is not constrained.
const DERIVED: [(OrbitQuantity, &[Parameter]); 3] = [
    (OrbitQuantity::Period, &[Parameter::PorbOverProt]),
    (OrbitQuantity::Maximum, &[Parameter::PorbOverProt, Parameter::Phi]),
    (OrbitQuantity::Conjunction, &[Parameter::PorbOverProt, Parameter::Phi]),
];

/// Draws of a prior by which its width is known, to 2 %.
const PRIOR_DRAWS: usize = 4001;

impl Manifest {
    /// Adds to the summary of `chain` what priors and blind search have to say to it.
    pub(super) fn conclude(&self, settings: &Settings, chain: &Chain, summary: &mut Summary) {
        summary.period_modes = self.period_modes(settings, chain, summary.discarded_steps);
        for f in &settings.free {
            let is_period = matches!(f.parameter, Parameter::PorbOverProt | Parameter::Period);
            let few = is_period && self.is_in_few_modes(summary);
            if let Some(one) = summary.parameters.get_mut(f.parameter.name()) {
                one.unconstrained = !few && is_as_wide(one, f);
            }
        }
        for (name, of) in DERIVED {
            let open = of.iter().any(|p| summary.parameters.get(p.name()).is_some_and(|one| one.unconstrained));
            if let Some(one) = summary.derived.get_mut(name.name()) {
                one.unconstrained = open;
            }
        }
        if self.blind_search.is_none() && summary.parameters.contains_key(Parameter::K.name()) {
            let why = "this run was begun by a version that made no blind search";
            summary.verdict = Some(Verdict::not_judged(why));
        }
        if let Some((verdict, remarks)) = self.verdict(summary, settings) {
            summary.remarks = remarks.into_iter().map(|remark| remark.text).filter(|text| !text.is_empty()).collect();
            summary.verdict = Some(verdict);
        }
    }

    fn period_modes(&self, settings: &Settings, chain: &Chain, discarded: usize) -> Vec<PeriodMode> {
        let place = |p: Parameter| self.names.iter().position(|name| name == p.name());
        let rotation = self.blind_search.as_ref().and_then(|search| search.rotation.as_ref());
        let ratio = place(Parameter::PorbOverProt).map(|i| (i, 1.0));
        let period = ratio.or(place(Parameter::Period).map(|i| (i, settings.star.rotation_period_d)));
        let (Some((period, unit)), Some(k), Some(rotation)) = (period, place(Parameter::K), rotation) else {
            return Vec::new();
        };
        let draws = |i: usize| chain.series(i, discarded).into_iter().flatten().flatten();
        let draws: Vec<(f64, f64)> = draws(period).map(|period| period / unit).zip(draws(k)).collect();
        let mut modes = period_modes(&draws, rotation.time_base_cycles);
        for mode in &mut modes {
            if is_broad(mode, rotation) {
                continue;
            }
            let sigma = 0.5 * (mode.ci68[1] - mode.ci68[0]);
            let imitation = rotation.imitated(mode.porb_over_prot, Some(sigma));
            mode.rotation = imitation.map(|imitation| imitation.words(settings.star.rotation_period_d));
        }
        modes
    }

    /// Whether a few narrow modes hold most of the draws.
    fn is_in_few_modes(&self, summary: &Summary) -> bool {
        let rotation = self.blind_search.as_ref().and_then(|search| search.rotation.as_ref());
        let Some(rotation) = rotation else { return false };
        let narrow = summary.period_modes.iter().filter(|mode| !is_broad(mode, rotation));
        // a single one that is as wide as the prior is none
        summary.period_modes.len() > 1 && narrow.take(FEW_MODES.0).map(|mode| mode.weight).sum::<f64>() >= FEW_MODES.1
    }

    /// The verdict of the blind search, and what the chain has to say to it.
    fn verdict(&self, summary: &Summary, settings: &Settings) -> Option<(Verdict, Vec<Remark>)> {
        let search = self.blind_search.as_ref()?;
        let mut remarks = Vec::new();
        let is_found = matches!(search.verdict.finding, Finding::Candidate | Finding::Detection);
        let k = summary.parameters.get(Parameter::K.name())?;
        match (is_found, k.upper95) {
            (true, Some(_)) => remarks.push(Remark::against(
                "K of the chain is compatible with zero",
                "the blind search finds a signal, but K of the chain is compatible with zero",
            )),
            (false, None) => remarks.push(Remark::note(
                "the chain takes a planet for granted: its K, which is away from zero, means something only if there \
                is one",
            )),
            _ => {}
        }
        if is_found {
            remarks.extend(of_the_period(summary));
            let heaviest = summary.period_modes.first().map(|mode| mode.porb_over_prot);
            let period = heaviest.unwrap_or(settings.values[Parameter::PorbOverProt]);
            remarks.extend(search.of_another_orbit(period, settings.star.rotation_period_d));
        }
        if !summary.converged {
            let text = "the chain has not converged: its intervals are not to be quoted";
            remarks.push(Remark::against("the chain has not converged", text));
        }
        let clock = self.orbit_quantities(settings).clock();
        let period = period_prior(&settings.free, &Elements::PLANETS[0], clock);
        if let Some(shortest) = period.map(|prior| prior.bounds().0).filter(|shortest| *shortest > 1.0) {
            remarks.push(Remark::note(format!(
                "the prior of the period begins at {shortest:.4} Prot, above the rotation period: signals of the \
                spots at Prot and \
                 its fractions can only appear as their aliases"
            )));
        }
        let verdict = search.verdict.clone().with(&remarks);
        Some((verdict, search.remarks.iter().cloned().chain(remarks).collect()))
    }
}

/// Whether the chain's period is one, and not the star's.
fn of_the_period(summary: &Summary) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let Some(heaviest) = summary.period_modes.first() else { return remarks };
    if let Some(words) = &heaviest.rotation {
        remarks.push(Remark::against(
            format!("the period is {words}"),
            format!("the chain's period is {words}: spots may imitate an orbit there"),
        ));
    }
    if heaviest.weight < ALONE {
        let share = 100.0 * heaviest.weight;
        remarks.push(Remark::against(
            "the period is ambiguous",
            format!("the period is ambiguous: the heaviest mode of the chain holds {share:.0} % of its draws"),
        ));
    }
    remarks
}

fn is_broad(mode: &PeriodMode, rotation: &RotationPeriods) -> bool {
    let [low, high] = mode.ci68;
    (1.0 / low - 1.0 / high) * rotation.time_base_cycles > BROAD
}

/// Whether the posterior is about as wide as the prior.
fn is_as_wide(one: &ParameterSummary, f: &FreeParameter) -> bool {
    let width = |[low, high]: [f64; 2]| match f.prior {
        Prior::LogUniform { .. } => (high / low).ln(),
        _ => high - low,
    };
    match f.prior {
        // how much there is of an amplitude is said by its limit
        _ if f.parameter.is_amplitude() => false,
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
