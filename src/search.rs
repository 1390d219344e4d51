//! The way to the reference: from the config's values and from several starts over the prior to the best parameters, and to
//! the maximum-entropy image there (method section 3, step 1).
//!
//! The search itself runs on the regularised likelihood, which needs no target and is smooth everywhere; a last climb is on
//! the objective asked for. Left out: the maximum-entropy solver, argmin.

use crate::config::{ImagingSettings, Settings};
use crate::imaging::Imager;
use crate::objective::{FreeParameter, ObjectiveKind, ParameterSpace, Posterior, Reference, ReferenceError};
use crate::optimise::{OptimiseError, Optimum, climb};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// What to search for, and from where.
#[derive(Clone, Copy, Debug)]
pub struct SearchSettings {
    /// Target of chi2 per datum.
    pub chi2_target: f64,
    /// The objective.
    pub objective: ObjectiveKind,
    /// Number of orbits drawn from the prior to start from, beside the config's values.
    pub prior_starts: usize,
    /// Seed of those draws.
    pub seed: u64,
}

impl SearchSettings {
    /// The search that a config asks for.
    pub fn new(settings: &Settings) -> Self {
        let ImagingSettings { chi2_target, objective, .. } = settings.imaging;
        SearchSettings { chi2_target, objective, prior_starts: PRIOR_STARTS, seed: settings.sampler.seed }
    }
}

/// Orbits drawn from the prior that a search starts from, beside the config's.
const PRIOR_STARTS: usize = 4;

/// One start of the search and where it led.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// Where it started (written coordinates); the first attempt is from the config's values.
    pub start: Vec<f64>,
    /// Where it ended, or why it did not.
    pub end: Result<Optimum, OptimiseError>,
}

/// The result of a search.
#[derive(Clone, Debug)]
pub struct Found {
    /// The posterior relative to the reference at the optimum.
    pub posterior: Posterior,
    /// The optimum of the objective asked for.
    pub optimum: Optimum,
    /// All starts, by regularised likelihood at the first reference's lambda.
    pub attempts: Vec<Attempt>,
}

/// Why a search failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// No reference image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No start led anywhere.
    #[error("{0}")]
    Optimise(#[from] OptimiseError),
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
    let SearchSettings { chi2_target, objective, prior_starts, seed } = settings;
    let orbital = space.free().iter().any(|f| f.parameter.is_orbital());
    let prior_starts = if orbital { prior_starts } else { 0 };
    let (evaluations, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let at = |stage| report(Progress { stage, evaluations: evaluations.load(Relaxed) });
    at(Stage::FirstImage);
    let start = space.start();
    let first = Reference::provisional(imager, space.values_at(&start), chi2_target)?;
    let smooth = Posterior::new(imager.clone(), space.clone(), ObjectiveKind::RegularisedLikelihood, first);
    let climbing = || at(Stage::Climbing { done: done.load(Relaxed), starts: 1 + prior_starts });
    let attempt = |start: Vec<f64>| {
        let tick = || {
            evaluations.fetch_add(1, Relaxed);
            climbing();
        };
        let end = climb(&smooth, &start, &tick);
        done.fetch_add(1, Relaxed);
        climbing();
        Attempt { start, end }
    };
    let mut attempts = vec![attempt(start)];
    let from = attempts[0].end.as_ref().map_or(attempts[0].start.clone(), |optimum| optimum.theta.clone());
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let starts: Vec<Vec<f64>> = (0..prior_starts).map(|_| with_other_orbit(space, &from, &mut rng)).collect();
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
            return Ok(Found { posterior, optimum, attempts });
        }
    }
    unreachable!("the loop returns")
}

impl Found {
    /// Maxima other than the optimum, best first, that are lower by less than 7 in log-probability. A chain that
    /// starts around the optimum may never see them.
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

/// `theta` with an orbit drawn from the prior: it is in the orbit that the landscape has several maxima, one for every alias
/// of the sampling; the star's own parameters have one, which the climb from the config's values has found.
fn with_other_orbit(space: &ParameterSpace, theta: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let draw = space.sample_prior(rng);
    let choose = |((f, drawn), kept): ((&FreeParameter, f64), &f64)| {
        if f.parameter.is_orbital() { drawn } else { *kept }
    };
    space.free().iter().zip(draw).zip(theta).map(choose).collect()
}

/// Distance of an optimum from `theta`, in standard deviations of the curvature.
fn shift(space: &ParameterSpace, theta: &[f64], to: &Optimum) -> f64 {
    let (a, b) = (space.to_internal(theta), space.to_internal(&to.theta));
    let d = nalgebra::DVector::from_iterator(a.len(), a.iter().zip(&b).map(|(a, b)| b - a));
    (&to.curvature * &d).dot(&d).max(0.0).sqrt()
}
