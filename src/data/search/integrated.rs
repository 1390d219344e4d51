//! The search where all maps are integrated over: the field is fitted to the star without a planet, ln Z is expanded
//! around it (`docs/method.md` section 9), and the highest of its peaks over all periods becomes the next place to
//! expand it around, until that place stays.

use super::{
    Attempt, Found, OTHER_STARTS, PEAK_DROP, Progress, REFERENCE_SHIFT, ROUNDS, SearchError, SearchSettings, Stage,
    shift, within,
};
use crate::posterior::density::Density;
use crate::posterior::imaging::Imager;
use crate::posterior::marginal::{Basis, Forecast, MarginalPosterior, fit};
use crate::posterior::objective::{Parameter, ParameterSpace, ParameterValues};
use crate::posterior::surrogate::Surrogate;
use crate::sampling::log_density::LogDensity as _;
use crate::sampling::optimise::climb;

pub(super) fn find(
    imager: &Imager,
    space: &ParameterSpace,
    settings: SearchSettings,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Found, SearchError> {
    let at = |stage| report(Progress { stage, evaluations: 0 });
    at(Stage::FirstImage);
    let start = space.start();
    let fitted = fit(imager, &Basis::new(&imager.grid), without_planet(space, &start), settings.known, None)?;
    let (field, jitter_kms) = (fitted.marginal.values, fitted.marginal.assumed.jitter_kms);
    let posterior_at = |values: ParameterValues| MarginalPosterior::new(imager.clone(), space, values, jitter_kms);
    let first = posterior_at(field)?;
    // where the field is free its best values are the start
    let start = with_field(space, start, &field);
    let attempts: Vec<Attempt> = starts(&first, &start)?
        .into_iter()
        .map(|start| Ok(Attempt { end: climb(&forecast(&first)?, &start, &|| ()), start }))
        .collect::<Result<_, SearchError>>()?;
    let height = |attempt: &Attempt| attempt.end.as_ref().map_or(f64::NEG_INFINITY, |o| o.evaluation.log_prob);
    let best = attempts.iter().max_by(|a, b| height(a).total_cmp(&height(b))).expect("at least the config's values");
    let mut optimum = best.end.clone()?;
    for round in 0.. {
        at(Stage::Reference);
        let posterior = posterior_at(first.space().values_at(&optimum.theta))?;
        at(Stage::Refining);
        let mut next = climb(&forecast(&posterior)?, &optimum.theta, &|| ())?;
        let moved = shift(space, &optimum.theta, &next);
        if moved < REFERENCE_SHIFT || round + 1 == ROUNDS {
            next.evaluation = posterior.evaluate(&next.theta);
            return Ok(Found { posterior: Density::Integrated(Box::new(posterior)), optimum: next, attempts });
        }
        optimum = next;
    }
    unreachable!("the loop returns")
}

fn forecast(posterior: &MarginalPosterior) -> Result<Forecast<'_>, SearchError> {
    Ok(Forecast { space: posterior.space(), expansion: posterior.expansion()? })
}

/// The values at `theta`, without a planet where one is looked for.
fn without_planet(space: &ParameterSpace, theta: &[f64]) -> ParameterValues {
    let mut values = space.values_at(theta);
    if space.free().iter().any(|f| f.parameter == Parameter::K) {
        values[Parameter::K] = 0.0;
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
