//! The search for the best parameters with an evolving map: it begins at the orbit of a blind search, with the field
//! and the noise fitted together with that orbit; ln Z is expanded there (`docs/method.md` section 9), and the maximum
//! of the expansion, or a higher point beyond it, becomes the next point of expansion, until that point converges.

use super::linearised::linearised;
use super::{Basis, Design, Fitted, Forecast, Held, Known, Marginal, MarginalPosterior, fit, noise};
use crate::field::FieldError;
use crate::model::{Elements, ParameterSpace, ParameterValues};
use crate::planets::periodogram::Scatter;
use crate::sampling::log_density::{Evaluation, LogDensity as _};
use crate::sampling::optimise::{Optimum, climb};
use crate::surface::At;
use crate::surface::expansion::nuisances;
use crate::surface::optimum::{
    Attempt, Best, BlindStart, PEAK_DROP, Progress, REFERENCE_SHIFT, SearchError, Sought, Stage, shift, with_spots_of,
    within,
};
use crate::surface::surrogate::Surrogate;
use std::sync::Arc;

/// Largest number of expansions: a start far from the best inclination requires several.
const MOST_ROUNDS: usize = 16;

/// Fractions of the step to the maximum of an expansion that are tried.
const SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// Multiples of the step that are tried where the maximum is higher: curvatures of the expansion are often too large.
const BEYOND: [f64; 2] = [2.0, 4.0];

/// Log-probabilities of rounds within this are considered equal: maps are found from others in each.
const SAME: f64 = 0.1;

pub(super) fn find(
    known: Known,
    sought: Sought,
    start: Option<BlindStart>,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Best, SearchError> {
    let Sought { imager, space, .. } = sought;
    let at = |stage| report(Progress { stage, evaluations: 0 });
    at(Stage::FirstImage);
    let (mut theta, field, held) = match start {
        Some(start) => from_search(sought, known, start),
        None => without_search(sought, known)?,
    };
    let mut highest: Option<(Arc<MarginalPosterior>, Optimum)> = None;
    let (mut last, mut settled): (Option<(Vec<f64>, f64)>, _) = (None, false);
    for _ in 0..MOST_ROUNDS {
        at(Stage::Reference);
        let values = space.clone().with_field_of(&field).values_at(&theta);
        let Ok(posterior) = MarginalPosterior::new(imager.clone(), space, values, held) else { break };
        let here = posterior.evaluate(&theta);
        // after a failed expansion: half of the step
        if let Some((before, height)) = &last
            && *height > here.log_prob + SAME
        {
            theta = on_the_way(space, before, &theta, 0.5);
            continue;
        }
        let height = here.log_prob;
        at(Stage::Refining);
        let Ok(mut next) = forecast(&posterior).and_then(|forecast| Ok(climb(&forecast, &theta, &|| ())?)) else {
            break;
        };
        let left_over = shift(space, &theta, &next);
        (next.theta, next.evaluation) = uphill(&posterior, (&theta, here), &next.theta);
        // away from the best star curvatures may be negative, and give no scale for the step
        let stays = shift(space, &theta, &next) < REFERENCE_SHIFT && next.evaluation.log_prob - height < SAME;
        settled = stays && left_over < REFERENCE_SHIFT;
        last = Some((std::mem::replace(&mut theta, next.theta.clone()), height));
        highest = Some((Arc::new(posterior), next));
        if stays {
            break;
        }
    }
    let (posterior, mut optimum) = highest.ok_or(FieldError::NotPositive)?;
    optimum.converged &= settled;
    let attempts = attempts(&posterior, &optimum.theta, sought.other_starts)?;
    Ok(Best { posterior, optimum, attempts })
}

/// The first of progressively shorter steps from a point towards the maximum of the expansion around it that leads up,
/// or a higher point beyond that maximum; the point itself, where none does. Far from the best star the expansion
/// overestimates the gain.
fn uphill(posterior: &MarginalPosterior, from: (&[f64], Evaluation), to: &[f64]) -> (Vec<f64>, Evaluation) {
    let (theta, here) = from;
    let evaluated = |share: &f64| {
        let there = on_the_way(posterior.space(), theta, to, *share);
        let evaluation = posterior.evaluate(&there);
        (there, evaluation)
    };
    let rises = |(_, there): &(Vec<f64>, Evaluation), over: &Evaluation| {
        there.log_prob.is_finite() && there.log_prob >= over.log_prob
    };
    let shorter = SHARES.iter().map(evaluated).find(|there| rises(there, &here));
    let Some(mut best) = shorter else { return (theta.to_vec(), here) };
    for share in BEYOND {
        let further = evaluated(&share);
        if !rises(&further, &best.1) {
            break;
        }
        best = further;
    }
    best
}

/// A fraction of the step between two points.
fn on_the_way(space: &ParameterSpace, from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    let (a, b) = (space.to_sampling(from), space.to_sampling(to));
    space.to_physical(&a.iter().zip(&b).map(|(a, b)| a + share * (b - a)).collect::<Vec<_>>())
}

/// The start: vector, field and noise.
type Start = (Vec<f64>, ParameterValues, Held);

/// At the orbit of a blind search. Its offsets of nights are those beside one circular orbit: another planet, or an
/// eccentricity, would be among them.
fn from_search(sought: Sought, known: Known, BlindStart { theta, values, here }: BlindStart) -> Start {
    let (imager, space) = (sought.imager, sought.space);
    let Fitted { marginal, .. } = here.kept();
    let all = space.clone().with_field_of(&values).values_at(&theta);
    let held = marginal.assumed.held();
    if held.night_kms == 0.0 || (all.second.is_none() && all.first.shape.is_none()) {
        return (theta, values, held);
    }
    let design = Arc::new(Design::new(imager, &marginal.basis, &all.state()));
    let there = Marginal::new(imager, &marginal.basis, design, all, marginal.assumed, Some(marginal));
    let held = there.map_or(held, |there| beside_orbits(sought, known, Fitted::near(there)));
    (theta, values, held)
}

/// What is held of a fit, with the most likely offsets of nights beside its orbits.
fn beside_orbits(Sought { imager, space, .. }: Sought, known: Known, fitted: Fitted) -> Held {
    let (values, held) = (fitted.marginal.values, fitted.marginal.assumed.held());
    let at = At { imager, values, nuisances: &nuisances(space.free()) };
    let here = linearised(imager, fitted, at.nuisances).ok();
    match here.and_then(|here| noise::beside_orbits(at, &here, &known, space)) {
        Some(Scatter { jitter_kms, night_kms }) if night_kms > 0.0 || held.night_kms > 0.0 => {
            Held { jitter_kms, night_kms, ..held }
        }
        _ => held,
    }
}

/// The highest of the maxima of the expansion around the star without a planet, with the field fitted again there.
fn without_search(sought: Sought, known: Known) -> Result<Start, SearchError> {
    let Sought { imager, space, other_starts, .. } = sought;
    let start = space.start();
    let basis = Arc::new(Basis::seen(imager, &without_planet(space, &start)));
    let fitted = fit(imager, &basis, without_planet(space, &start), known, None)?;
    let (field, held) = (fitted.marginal.values, fitted.marginal.assumed.held());
    let first = MarginalPosterior::new(imager.clone(), space, field, held)?;
    // where the field is free its best values are the start
    let attempts = attempts(&first, &with_spots_of(space, start, &field), other_starts)?;
    let height = |attempt: &Attempt| attempt.end.as_ref().map_or(f64::NEG_INFINITY, |o| o.evaluation.log_prob);
    let best = attempts.iter().max_by(|a, b| height(a).total_cmp(&height(b))).expect("at least the config's values");
    let theta = best.end.clone()?.theta;
    // with the planet in the model the field and the jitter differ
    let with_orbit = first.space().values_at(&theta);
    Ok(match fit(imager, &basis, with_orbit, known, Some(&fitted)) {
        Ok(fitted) => {
            let (values, held) = (fitted.marginal.values, beside_orbits(sought, known, fitted));
            (with_spots_of(space, theta, &values), values, held)
        }
        Err(_) => (theta, field, held),
    })
}

/// Climbs by the expansion around `posterior`, from `first` and from the peaks over the periods.
fn attempts(posterior: &MarginalPosterior, first: &[f64], others: usize) -> Result<Vec<Attempt>, SearchError> {
    let climbed = |start: Vec<f64>| Ok(Attempt { end: climb(&forecast(posterior)?, &start, &|| ()), start });
    starts(posterior, first, others)?.into_iter().map(climbed).collect()
}

fn forecast(posterior: &MarginalPosterior) -> Result<Forecast<'_>, SearchError> {
    Ok(Forecast { space: posterior.space(), expansion: posterior.expansion()? })
}

/// The values at `theta`, without a planet where one is searched for.
fn without_planet(space: &ParameterSpace, theta: &[f64]) -> ParameterValues {
    let mut values = space.values_at(theta);
    for of in &Elements::PLANETS {
        if space.free().iter().any(|f| f.parameter == of.k) {
            values.set(of.k, 0.0);
        }
    }
    values
}

/// The starts of climbs: the config's values, and the peaks over the periods.
fn starts(posterior: &MarginalPosterior, first: &[f64], others: usize) -> Result<Vec<Vec<f64>>, SearchError> {
    let space = posterior.space();
    let surrogate = Surrogate::of_expansion(posterior.expansion()?, space, posterior.imager());
    let peaks = surrogate.map_or_else(Vec::new, |surrogate| surrogate.peaks(PEAK_DROP, others + 1));
    let peaks = peaks.iter().map(|peak| within(space, space.to_physical(&peak.position)));
    let allowed = |theta: &Vec<f64>| space.log_prior(theta).is_finite();
    Ok(std::iter::once(first.to_vec()).chain(peaks.filter(allowed)).collect())
}
