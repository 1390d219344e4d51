//! The search where all maps are integrated over: it begins at the orbit that a blind search finds, with the field and
//! the jitter as they are with that orbit; ln Z is expanded there (`docs/method.md` section 9), and the top of the
//! expansion, or what is higher beyond, becomes the next place to expand it around, until that place stays.

use super::{
    Attempt, Found, OTHER_STARTS, PEAK_DROP, Progress, REFERENCE_SHIFT, SearchError, SearchSettings, Stage, shift,
    within,
};
use crate::field::FieldError;
use crate::inference::detection::{Detection, DetectionSettings, Spots};
use crate::inference::surrogate::Surrogate;
use crate::model::{Elements, Parameter, ParameterSpace, ParameterValues, for_blind_search};
use crate::planets::periodogram::{Frequencies, FrequencySettings};
use crate::sampling::log_density::{Evaluation, LogDensity as _};
use crate::sampling::optimise::climb;
use crate::star::Shape;
use crate::surface::density::Density;
use crate::surface::evolving_map::{Basis, Fitted, Forecast, Held, MarginalPosterior, fit};
use crate::surface::expansion::nuisances;
use crate::surface::imaging::Imager;

/// A circle is a saddle of the square roots of eccentricities: a climb begins beside it.
const SMALLEST_E: f64 = 0.01;

/// Share of the largest eccentricity that a climb begins within.
const SMALL_PART: f64 = 0.8;

/// Places that ln Z is expanded around at most: from an inclination that is far off it takes some.
const MOST_ROUNDS: usize = 16;

/// Parts of the way to the top of an expansion that are tried.
const SHARES: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// Where the top is higher, so many times the way is tried: curvatures of the expansion are often too large.
const BEYOND: [f64; 2] = [2.0, 4.0];

/// Log-probabilities of rounds as close as this count as the same: maps are found from others in each.
const SAME: f64 = 0.1;

pub(super) fn find(
    imager: &Imager,
    space: &ParameterSpace,
    settings: SearchSettings,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Found, SearchError> {
    let at = |stage| report(Progress { stage, evaluations: 0 });
    at(Stage::FirstImage);
    let (detection, start) = match blind(imager, space, settings) {
        Some((detection, start)) => (Some(Box::new(detection)), start),
        None => (None, None),
    };
    let (mut theta, field, held) = match start {
        Some(start) => start,
        None => without_search(imager, space, settings)?,
    };
    let mut highest: Option<Found> = None;
    let (mut last, mut settled): (Option<(Vec<f64>, f64)>, _) = (None, false);
    for _ in 0..MOST_ROUNDS {
        at(Stage::Reference);
        let values = space.clone().with_field_of(&field).values_at(&theta);
        let Ok(posterior) = MarginalPosterior::new(imager.clone(), space, values, held) else { break };
        let here = posterior.evaluate(&theta);
        // an expansion that has led astray: half of the way
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
        // away from the best star curvatures may be negative, and no measure of the way
        let stays = shift(space, &theta, &next) < REFERENCE_SHIFT && next.evaluation.log_prob - height < SAME;
        settled = stays && left_over < REFERENCE_SHIFT;
        last = Some((std::mem::replace(&mut theta, next.theta.clone()), height));
        let posterior = Density::Integrated(Box::new(posterior));
        highest = Some(Found { posterior, optimum: next, attempts: Vec::new(), detection: None });
        if stays {
            break;
        }
    }
    let mut found = highest.ok_or(FieldError::NotPositive)?;
    found.optimum.converged &= settled;
    found.detection = detection;
    if let Density::Integrated(posterior) = &found.posterior {
        found.attempts = attempts(posterior, &found.optimum.theta)?;
    }
    Ok(found)
}

/// The first of ever shorter parts of the way from a point to the top of the expansion around it that leads up, or what
/// is higher beyond the top; the point itself, where none does. Far from the best star the expansion promises too much.
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

/// Part of the way between two points.
fn on_the_way(space: &ParameterSpace, from: &[f64], to: &[f64], share: f64) -> Vec<f64> {
    let (a, b) = (space.to_sampling(from), space.to_sampling(to));
    space.to_physical(&a.iter().zip(&b).map(|(a, b)| a + share * (b - a)).collect::<Vec<_>>())
}

/// Where to begin: vector, field and jitter.
type Start = (Vec<f64>, ParameterValues, Held);

/// A blind search, where an orbit is looked for; and the orbit that it finds, where the priors allow it.
fn blind(imager: &Imager, space: &ParameterSpace, settings: SearchSettings) -> Option<(Detection, Option<Start>)> {
    let is_free = |p: Parameter| space.free().iter().any(|f| f.parameter == p);
    let sought = |of: &&Elements| is_free(of.k) && is_free(of.phi) && space.period_prior(of).is_some();
    let sought: Vec<&Elements> = Elements::PLANETS.iter().filter(sought).collect();
    let [first, second] = &Elements::PLANETS;
    let beside = second.all().into_iter().any(is_free);
    // of a planet of known ephemeris the config knows where it is
    if !sought.contains(&first) || (beside && !sought.contains(&second)) {
        return None;
    }
    let usual = FrequencySettings::default();
    let frequencies = Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, usual).ok()?;
    let wanted = DetectionSettings {
        spots: Spots::Integrated(settings.known),
        eccentric: is_free(first.shape[0]),
        second_planet: beside,
        ..DetectionSettings::of(settings.chi2_target, nuisances(space.free()))
    };
    let config = space.values_at(&space.start());
    let values = for_blind_search(config, space.free());
    let found = Detection::find(imager, values, frequencies, &wanted, &|_| ()).ok()?;
    let marginal = &found.last().field()?.marginal;
    let mut values = marginal.values.with_orbits_of(&config);
    let both = found.second.as_ref().and_then(|second| second.both).map(|both| both.orbits.to_vec());
    let mut peaks = both.filter(|_| beside).unwrap_or_else(|| vec![found.best]);
    for of in sought {
        let prior = space.period_prior(of)?;
        let allowed = peaks.iter().position(|peak| prior.contains(peak.porb_over_prot));
        let peak = peaks.remove(allowed.or((!beside).then_some(0))?);
        values.set(of.k, peak.orbit.k_kms);
        values.set(of.ratio, peak.porb_over_prot);
        values.set(of.phi, peak.orbit.phi);
    }
    if let Some(Some(ellipse)) = found.keplerian.first().filter(|_| !beside) {
        let largest =
            first.shape.map(|p| space.free().iter().find(|f| f.parameter == p).map(|f| f.prior.bounds().1))[0]?;
        let e = ellipse.eccentricity.clamp(SMALLEST_E, (SMALL_PART * largest * largest).max(SMALLEST_E));
        let shape = Shape::new(e, ellipse.omega);
        values.set(Parameter::SqrtECosOmega, shape.sqrt_e_cos_omega);
        values.set(Parameter::SqrtESinOmega, shape.sqrt_e_sin_omega);
        values.set(Parameter::K, ellipse.k_kms);
        values.set(Parameter::PorbOverProt, ellipse.porb_over_prot);
        values.set(Parameter::Phi, (ellipse.maximum_cycle / ellipse.porb_over_prot).rem_euclid(1.0));
    }
    let mut theta = with_field(space, space.theta_of(&values), &values);
    // phi as its prior has it
    theta = space.to_physical(&space.to_sampling(&theta));
    let start = space.log_prior(&theta).is_finite().then_some((theta, values, marginal.assumed.held()));
    Some((found, start))
}

/// The highest of the maxima that the expansion around the star without a planet has, the field fitted anew there.
fn without_search(imager: &Imager, space: &ParameterSpace, settings: SearchSettings) -> Result<Start, SearchError> {
    let basis = Basis::new(&imager.grid);
    let start = space.start();
    let fitted = fit(imager, &basis, without_planet(space, &start), settings.known, None)?;
    let (field, held) = (fitted.marginal.values, fitted.marginal.assumed.held());
    let first = MarginalPosterior::new(imager.clone(), space, field, held)?;
    // where the field is free its best values are the start
    let attempts = attempts(&first, &with_field(space, start, &field))?;
    let height = |attempt: &Attempt| attempt.end.as_ref().map_or(f64::NEG_INFINITY, |o| o.evaluation.log_prob);
    let best = attempts.iter().max_by(|a, b| height(a).total_cmp(&height(b))).expect("at least the config's values");
    let theta = best.end.clone()?.theta;
    // with the planet in the model the field and the jitter are others
    let with_orbit = first.space().values_at(&theta);
    Ok(match fit(imager, &basis, with_orbit, settings.known, Some(&fitted)) {
        Ok(Fitted { marginal, .. }) => {
            (with_field(space, theta, &marginal.values), marginal.values, marginal.assumed.held())
        }
        Err(_) => (theta, field, held),
    })
}

/// Climbs by the expansion around `posterior`, from `first` and from the peaks over the periods.
fn attempts(posterior: &MarginalPosterior, first: &[f64]) -> Result<Vec<Attempt>, SearchError> {
    let climbed = |start: Vec<f64>| Ok(Attempt { end: climb(&forecast(posterior)?, &start, &|| ()), start });
    starts(posterior, first)?.into_iter().map(climbed).collect()
}

fn forecast(posterior: &MarginalPosterior) -> Result<Forecast<'_>, SearchError> {
    Ok(Forecast { space: posterior.space(), expansion: posterior.expansion()? })
}

/// The values at `theta`, without a planet where one is looked for.
fn without_planet(space: &ParameterSpace, theta: &[f64]) -> ParameterValues {
    let mut values = space.values_at(theta);
    for of in &Elements::PLANETS {
        if space.free().iter().any(|f| f.parameter == of.k) {
            values.set(of.k, 0.0);
        }
    }
    values
}

/// `theta` with the field of `values`, brought into its priors.
fn with_field(space: &ParameterSpace, mut theta: Vec<f64>, values: &ParameterValues) -> Vec<f64> {
    for (x, f) in theta.iter_mut().zip(space.free()).filter(|(_, f)| f.parameter.is_of_field()) {
        *x = values[f.parameter];
    }
    within(space, theta)
}

/// Where to climb from: the config's values, and the peaks over the periods.
fn starts(posterior: &MarginalPosterior, first: &[f64]) -> Result<Vec<Vec<f64>>, SearchError> {
    let space = posterior.space();
    let surrogate = Surrogate::of_expansion(posterior.expansion()?, space, posterior.imager());
    let peaks = surrogate.map_or_else(Vec::new, |surrogate| surrogate.peaks(PEAK_DROP, OTHER_STARTS + 1));
    let peaks = peaks.iter().map(|peak| within(space, space.to_physical(&peak.position)));
    let allowed = |theta: &Vec<f64>| space.log_prior(theta).is_finite();
    Ok(std::iter::once(first.to_vec()).chain(peaks.filter(allowed)).collect())
}
