//! The way to the reference: from the config's values, and from the peaks of the likelihood over all periods, to the
//! best parameters and to the maximum-entropy image there (`docs/method.md` section 3, step 1).
//!
//! The peaks are those of the quadratic around the first climb's end (`docs/method.md` section 4), brought into the
//! priors where they lie outside; where there is no quadratic (K or phi fixed), orbits drawn from the prior take their
//! place. The search itself runs on the regularised likelihood, which needs no target and is smooth everywhere; a last
//! climb is on the objective asked for.

use crate::field::FieldError;
use crate::inference::detection::Detection;
use crate::inference::surrogate::Surrogate;
use crate::model::{FreeParameter, ParameterSpace, Prior};
use crate::sampling::optimise::{OptimiseError, Optimum, climb};
use crate::surface::density::Density;
use crate::surface::evolving_map::{Known, NoFit};
use crate::surface::imaging::Imager;
use crate::surface::objective::ObjectiveKind;
use crate::surface::static_map::{Posterior, Reference, ReferenceError};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

mod integrated;

/// What to search for, and from where.
#[derive(Clone, Copy, Debug)]
pub struct SearchSettings {
    /// Target of chi2 per datum.
    pub chi2_target: f64,
    /// The objective.
    pub objective: ObjectiveKind,
    /// What is known of the field, where maps are integrated over.
    pub known: Known,
    /// Most other orbits to start from, beside the config's values.
    pub other_starts: usize,
    /// Seed of those draws.
    pub seed: u64,
}

impl SearchSettings {
    /// The search that is usual.
    pub fn new(chi2_target: f64, objective: ObjectiveKind, known: Known, seed: u64) -> Self {
        SearchSettings { chi2_target, objective, known, other_starts: OTHER_STARTS, seed }
    }
}

/// Most orbits that a search starts from, beside the config's.
const OTHER_STARTS: usize = 4;

/// Peaks of the quadratic this much below its best in ln L are climbed too.
const PEAK_DROP: f64 = 10.0;

/// Evaluations of a climb, near its start for the most part.
const CLIMB: usize = 15;

/// One start of the search and where it led.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// Where it started (physical coordinates); the first attempt is from the config's values.
    pub start: Vec<f64>,
    /// Where it ended, or why it did not.
    pub end: Result<Optimum, OptimiseError>,
}

/// The result of a search.
#[derive(Clone, Debug)]
pub struct Found {
    /// The posterior relative to the reference at the optimum.
    pub posterior: Density,
    /// The optimum of the objective asked for.
    pub optimum: Optimum,
    /// All starts, by regularised likelihood at the first reference's lambda.
    #[doc(hidden)]
    pub attempts: Vec<Attempt>,
    /// The blind search that it began with, where all maps are integrated over.
    #[doc(hidden)]
    pub detection: Option<Box<Detection>>,
}

/// Why a search failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// No reference image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No field, where maps are integrated over.
    #[error("{0}")]
    Field(#[from] NoFit),
    /// No start led anywhere.
    #[error("{0}")]
    Optimise(#[from] OptimiseError),
}

impl From<FieldError> for SearchError {
    fn from(error: FieldError) -> Self {
        SearchError::Field(error.into())
    }
}

/// How far a search has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What it is at.
    pub stage: Stage,
    /// Evaluations made by all climbs so far.
    pub evaluations: usize,
}

/// Stages of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reconstruction at the config's values.
    FirstImage,
    /// Climbs from all starts.
    Climbing {
        /// Climbs that have ended.
        done: usize,
        /// Number of starts.
        starts: usize,
    },
    /// Reconstruction and trade-off curve at the best parameters.
    Reference,
    /// The last climb, on the objective asked for.
    Refining,
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Stage::FirstImage => f.write_str("reconstructing at the config's values"),
            Stage::Climbing { done, starts } => write!(f, "searching, {done} of {starts} climbs done"),
            Stage::Reference => f.write_str("reference image and trade-off curve"),
            Stage::Refining => f.write_str("refining the best parameters"),
        }
    }
}

/// The reference is rebuilt until the optimum stays within this many standard deviations of it.
const REFERENCE_SHIFT: f64 = 0.3;

/// A maximum this much lower in log-probability holds a thousandth of the weight of the best, and is no rival.
const RIVAL_DROP: f64 = 7.0;

/// Climbs that end within this many standard deviations of each other found the same maximum.
const RIVAL_DISTANCE: f64 = 4.0;

/// Most rebuilds of the reference.
const ROUNDS: usize = 4;

/// Finds the best parameters and the reference there; `report` is called at every evaluation, from any thread.
///
/// # Errors
/// If the target is out of reach even there, or no start leads to a finite log-probability.
pub fn find(
    imager: &Imager,
    space: &ParameterSpace,
    settings: SearchSettings,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Found, SearchError> {
    if settings.objective == ObjectiveKind::MarginalLikelihood {
        return integrated::find(imager, space, settings, report);
    }
    let SearchSettings { chi2_target, objective, .. } = settings;
    let (evaluations, done, all) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(1));
    let at = |stage| report(Progress { stage, evaluations: evaluations.load(Relaxed) });
    at(Stage::FirstImage);
    let start = space.start();
    let first = Reference::provisional(imager, space.values_at(&start), chi2_target)?;
    let smooth = Posterior::new(imager.clone(), space.clone(), ObjectiveKind::RegularisedLikelihood, first);
    let climbing = || at(Stage::Climbing { done: done.load(Relaxed), starts: all.load(Relaxed) });
    let attempt = |start: Vec<f64>| {
        let tick = || {
            evaluations.fetch_add(1, Relaxed);
            climbing();
        };
        let near = smooth.clone().with_warm_starts_for(std::slice::from_ref(&start), CLIMB);
        let end = climb(&near, &start, &tick);
        done.fetch_add(1, Relaxed);
        climbing();
        Attempt { start, end }
    };
    let mut attempts = vec![attempt(start)];
    let starts = other_starts(imager, space, settings, &attempts[0])?;
    all.fetch_add(starts.len(), Relaxed);
    attempts.extend(starts.into_par_iter().with_max_len(1).map(attempt).collect::<Vec<_>>());
    let height = |attempt: &Attempt| attempt.end.as_ref().map_or(f64::NEG_INFINITY, |o| o.evaluation.log_prob);
    let best = attempts.iter().max_by(|a, b| height(a).total_cmp(&height(b))).expect("at least the config's values");
    let mut optimum = best.end.clone()?;
    for round in 0.. {
        at(Stage::Reference);
        let reference = Reference::build(imager, space.values_at(&optimum.theta), chi2_target)?;
        let posterior = Posterior::new(imager.clone(), space.clone(), objective, reference);
        let tick = || {
            evaluations.fetch_add(1, Relaxed);
            at(Stage::Refining);
        };
        let next = climb(&posterior, &optimum.theta, &tick)?;
        let moved = shift(space, &optimum.theta, &next);
        optimum = next;
        if moved < REFERENCE_SHIFT || round + 1 == ROUNDS {
            let posterior = Density::Mapped(Box::new(posterior));
            return Ok(Found { posterior, optimum, attempts, detection: None });
        }
    }
    unreachable!("the loop returns")
}

/// Where else to climb from, after the `first` attempt.
fn other_starts(
    imager: &Imager,
    space: &ParameterSpace,
    settings: SearchSettings,
    first: &Attempt,
) -> Result<Vec<Vec<f64>>, ReferenceError> {
    let from = first.end.as_ref().map_or(&first.start, |optimum| &optimum.theta);
    if !space.free().iter().any(|f| f.parameter.is_orbital()) {
        return Ok(Vec::new());
    }
    let here = Reference::provisional(imager, space.values_at(from), settings.chi2_target)?;
    let Some(surrogate) = Surrogate::new(imager, space, &here) else {
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        return Ok((0..settings.other_starts).map(|_| with_other_orbit(space, from, &mut rng)).collect());
    };
    let peaks = surrogate.peaks(PEAK_DROP, settings.other_starts + 1);
    let starts = peaks.iter().map(|peak| within(space, space.to_physical(&peak.position)));
    let reached = |theta: &Vec<f64>| first.end.as_ref().is_ok_and(|end| shift(space, theta, end) < RIVAL_DISTANCE);
    let allowed = |theta: &Vec<f64>| space.log_prior(theta).is_finite();
    Ok(starts.filter(|theta| allowed(theta) && !reached(theta)).take(settings.other_starts).collect())
}

/// `theta` brought into the bounds of the priors, a little inside.
fn within(space: &ParameterSpace, mut theta: Vec<f64>) -> Vec<f64> {
    for (x, f) in theta.iter_mut().zip(space.free()) {
        let (low, high) = f.prior.bounds();
        let margin = if (high - low).is_finite() { 0.02 * (high - low) } else { 0.0 };
        if f.prior != Prior::Periodic && !f.prior.contains(*x) {
            *x = x.clamp(low + margin, high - margin);
        }
    }
    theta
}

impl Found {
    /// Maxima other than the optimum, best first, that are lower by less than 7 in log-probability. A chain that
    /// starts around the optimum may never see them.
    #[doc(hidden)]
    pub fn rivals(&self) -> Vec<&Optimum> {
        let mut ends: Vec<&Optimum> = self.attempts.iter().filter_map(|attempt| attempt.end.as_ref().ok()).collect();
        ends.sort_by(|a, b| b.evaluation.log_prob.total_cmp(&a.evaluation.log_prob));
        let mut distinct: Vec<&Optimum> = Vec::new();
        for end in ends {
            let lower = distinct.first().map_or(0.0, |best| best.evaluation.log_prob - end.evaluation.log_prob);
            let same = |other: &&Optimum| shift(self.posterior.space(), &end.theta, other) < RIVAL_DISTANCE;
            if lower < RIVAL_DROP && !distinct.iter().any(same) {
                distinct.push(end);
            }
        }
        distinct.split_off(distinct.len().min(1))
    }
}

/// `theta` with an orbit drawn from the prior: it is in the orbit that the landscape has several maxima, one for every
/// alias of the sampling; the star's own parameters have one, which the climb from the config's values has found.
fn with_other_orbit(space: &ParameterSpace, theta: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let draw = space.sample_prior(rng);
    let choose = |((f, drawn), kept): ((&FreeParameter, f64), &f64)| {
        if f.parameter.is_orbital() { drawn } else { *kept }
    };
    space.free().iter().zip(draw).zip(theta).map(choose).collect()
}

/// Distance of an optimum from `theta`, in standard deviations of the curvature.
fn shift(space: &ParameterSpace, theta: &[f64], to: &Optimum) -> f64 {
    let (a, b) = (space.to_sampling(theta), space.to_sampling(&to.theta));
    let d = nalgebra::DVector::from_iterator(a.len(), a.iter().zip(&b).map(|(a, b)| b - a));
    (&to.curvature * &d).dot(&d).max(0.0).sqrt()
}
