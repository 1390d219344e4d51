//! The search for the reference of a static map: from the config's values, and from the peaks of the likelihood over
//! all periods, to the best parameters and to the maximum-entropy image there (`docs/method.md` section 3, step 1).
//!
//! The peaks are those of the quadratic around the end of the first climb (`docs/method.md` section 4), moved into the
//! priors where they lie outside; without a quadratic (K or phi fixed), orbits drawn from the prior replace them. The
//! search itself uses the regularised likelihood, which needs no target and is smooth everywhere; a last climb uses the
//! requested objective.

use super::{Posterior, Reference, ReferenceError, StaticMap};
use crate::model::{FreeParameter, ParameterSpace};
use crate::sampling::optimise::climb;
use crate::surface::ObjectiveKind;
use crate::surface::optimum::{
    Attempt, Best, PEAK_DROP, Progress, REFERENCE_SHIFT, RIVAL_DISTANCE, SearchError, Sought, Stage, shift, within,
};
use crate::surface::surrogate::Surrogate;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Evaluations of a climb, mostly near its start.
const CLIMB: usize = 15;

/// Most rebuilds of the reference.
const ROUNDS: usize = 4;

/// Finds the best parameters and the reference there; `report` is called at every evaluation, from any thread.
///
/// # Errors
/// If the target is out of reach even there, or no start leads to a finite log-probability.
pub(super) fn find(model: &StaticMap, sought: Sought, report: &(dyn Fn(Progress) + Sync)) -> Result<Best, SearchError> {
    let (Sought { imager, space, .. }, chi2_target) = (sought, model.chi2_target);
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
    let starts = other_starts(sought, chi2_target, &attempts[0])?;
    all.fetch_add(starts.len(), Relaxed);
    attempts.extend(starts.into_par_iter().with_max_len(1).map(attempt).collect::<Vec<_>>());
    let height = |attempt: &Attempt| attempt.end.as_ref().map_or(f64::NEG_INFINITY, |o| o.evaluation.log_prob);
    let best = attempts.iter().max_by(|a, b| height(a).total_cmp(&height(b))).expect("at least the config's values");
    let mut optimum = best.end.clone()?;
    for round in 0.. {
        at(Stage::Reference);
        let reference = Reference::build(imager, space.values_at(&optimum.theta), chi2_target)?;
        let posterior = Posterior::new(imager.clone(), space.clone(), model.objective, reference);
        let tick = || {
            evaluations.fetch_add(1, Relaxed);
            at(Stage::Refining);
        };
        let next = climb(&posterior, &optimum.theta, &tick)?;
        let moved = shift(space, &optimum.theta, &next);
        optimum = next;
        if moved < REFERENCE_SHIFT || round + 1 == ROUNDS {
            return Ok(Best { posterior: Arc::new(posterior), optimum, attempts });
        }
    }
    unreachable!("the loop returns")
}

/// Further starts of climbs, after the `first` attempt.
fn other_starts(sought: Sought, chi2_target: f64, first: &Attempt) -> Result<Vec<Vec<f64>>, ReferenceError> {
    let Sought { imager, space, other_starts, seed } = sought;
    let from = first.end.as_ref().map_or(&first.start, |optimum| &optimum.theta);
    if !space.free().iter().any(|f| f.parameter.is_orbital()) {
        return Ok(Vec::new());
    }
    let here = Reference::provisional(imager, space.values_at(from), chi2_target)?;
    let Some(surrogate) = Surrogate::new(imager, space, &here) else {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        return Ok((0..other_starts).map(|_| with_other_orbit(space, from, &mut rng)).collect());
    };
    let peaks = surrogate.peaks(PEAK_DROP, other_starts + 1);
    let starts = peaks.iter().map(|peak| within(space, space.to_physical(&peak.position)));
    let reached = |theta: &Vec<f64>| first.end.as_ref().is_ok_and(|end| shift(space, theta, end) < RIVAL_DISTANCE);
    let allowed = |theta: &Vec<f64>| space.log_prior(theta).is_finite();
    Ok(starts.filter(|theta| allowed(theta) && !reached(theta)).take(other_starts).collect())
}

/// `theta` with an orbit drawn from the prior: the likelihood has several maxima in the orbit, one for every alias of
/// the sampling; the stellar parameters have one, which the climb from the config's values has found.
fn with_other_orbit(space: &ParameterSpace, theta: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let draw = space.sample_prior(rng);
    let choose = |((f, drawn), kept): ((&FreeParameter, f64), &f64)| {
        if f.parameter.is_orbital() { drawn } else { *kept }
    };
    space.free().iter().zip(draw).zip(theta).map(choose).collect()
}
