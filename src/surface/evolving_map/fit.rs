//! The fit of the field: the amplitude, slope and lifetime for which ln Z is largest, and the jitter.

use super::climb::{GAIN, STEPS, Top, climb, limits, place};
use super::known::{Known, USUAL};
use super::{Assumed, Basis, Design, Marginal};
use crate::field::{Field, FieldError, Kernel, Lifetime};
use crate::model::{Parameter, ParameterValues};
use crate::surface::imaging::Imager;
use nalgebra::Matrix4;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Amplitude and slope of a spectrum without a break over those of an equally good one with it.
const WITHOUT_BREAK: (f64, f64) = (1.2, 0.47);

/// A climb cannot recover from this deficit in ln Z.
const FAR_BELOW: f64 = 5.0;

const LIFETIMES_D: [f64; 5] = [4.0, 12.0, 36.0, 108.0, 400.0];
const USUAL_JITTER_KMS: f64 = 0.1;

/// A fit of so many profiles starts from that of a subset of them, at most half as many.
const MANY: usize = 160;

/// Multiples of this are evenly distributed modulo 1, and never repeat.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Beyond so many profiles times squared harmonics a climb of 20 to 40 evaluations takes minutes: 411 profiles of a
/// star of 30 km/s (some 800 harmonics) are 2.6e8, 226 of one of 90 km/s (1,344) 4.1e8.
const LONG: f64 = 3e8;

/// The most probable field.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The profiles with it.
    pub marginal: Marginal,
    /// ln Z, the jitter counted.
    pub ln_evidence: f64,
    /// Bounds of the search that were reached.
    pub at_bounds: Vec<&'static str>,
    /// Approximate minus second derivatives of ln Z in the coordinates of the search; `None` if there was no search.
    pub(super) hessian: Option<Matrix4<f64>>,
}

/// Why there is no most probable field.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoFit {
    /// The field cannot be marginalised over.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The density of the data is not finite.
    #[error("the evidence of the most probable field is not finite: check intensities and uncertainties")]
    NotFinite,
}

impl NoFit {
    /// A status for it.
    pub fn status(&self) -> &'static str {
        match self {
            NoFit::Field(FieldError::NoSuchField { .. }) => "no-such-field",
            NoFit::Field(FieldError::NotFinite { .. }) | NoFit::NotFinite => "non-finite",
            NoFit::Field(FieldError::NotPositive) => "not-positive",
            NoFit::Field(FieldError::NotSettled { .. }) => "not-settled",
        }
    }
}

impl Fitted {
    /// A start for another fit.
    pub(in crate::surface) fn near(marginal: Marginal) -> Self {
        Fitted { ln_evidence: marginal.ln_evidence(), marginal, at_bounds: Vec::new(), hessian: None }
    }

    /// The amplitude, where it lies on the lower bound: the profiles show no spots.
    pub fn too_faint(&self) -> Option<f64> {
        let amplitude = self.marginal.assumed.field.spectrum.amplitude;
        (self.at_bounds.contains(&Parameter::SpotAmplitude.name()) && amplitude < USUAL[0]).then_some(amplitude)
    }
}

/// The profiles with a usual field, except for what is known: a static one, unless the lifetime is known. Maps are
/// found from those `near`.
pub(in crate::surface) fn usual(
    imager: &Imager,
    basis: &Arc<Basis>,
    values: ParameterValues,
    known: Known,
    near: Option<&Marginal>,
) -> Result<Fitted, FieldError> {
    let spectrum = known.spectrum();
    let kernel = Kernel::of(known.lifetime.unwrap_or(Lifetime::Static));
    let assumed = known.assumed(Field { spectrum, kernel }, 0.0);
    let design = Arc::new(Design::new(imager, basis, &values.state()));
    Ok(Fitted::near(Marginal::new(imager, basis, design, values, assumed, near)?))
}

/// Fits the field to the profiles at `values`, from the result of a fit `near`, or from the start in what is `known`,
/// or from several lifetimes; with many profiles from the fit of a subset, including whether the spectrum has a break.
/// Where a climb with all of them takes minutes the field of the subset is used.
///
/// # Errors
/// [`NoFit`]: of the last attempt, where none succeeds.
pub fn fit(
    imager: &Imager,
    basis: &Arc<Basis>,
    values: ParameterValues,
    known: Known,
    near: Option<&Fitted>,
) -> Result<Fitted, NoFit> {
    let design = Arc::new(Design::new(imager, basis, &values.state()));
    let at = |assumed: Assumed, nearby: Option<&Marginal>| {
        Marginal::new(imager, basis, Arc::clone(&design), values, assumed, nearby)
    };
    let many = known.is_open() && is_many(imager);
    if many
        && takes_minutes(imager, basis)
        && let Some(fitted) = by_a_share(imager, (basis, &design), values, known, near, &at)?
    {
        return Ok(fitted);
    }
    // the field from which a fit begins has or lacks a break
    let begin = known.begin().filter(|_| near.is_none()).and_then(|begin| at(begin, None).ok());
    let is_near = near.is_some() || begin.is_some();
    let share = if many && !is_near { share_of_many(imager) } else { None };
    let share = share.and_then(|share| fit(&share, basis, values, known, None).ok());
    let (first, hessian) = match (near, begin, &share) {
        (Some(Fitted { marginal, hessian, .. }), ..) => (anew(marginal.assumed, marginal, &at)?, *hessian),
        (None, Some(begin), _) => (begin, None),
        (None, None, Some(Fitted { marginal: share, hessian, .. })) => {
            (of_share(share, (imager, basis, &design), values, &at)?, *hessian)
        }
        (None, None, None) => {
            let rough = Arc::new(basis.roughly());
            // with many profiles each takes hundreds of megabytes: only the best so far is kept
            let higher = |best, next| higher(best, next, &known);
            let start = |of_field: Vec<Assumed>| {
                of_field.into_iter().fold(None, |best: Option<Found>, assumed| {
                    // with a jitter from the maps without one
                    let before = best.as_ref().and_then(|before| before.as_ref().ok());
                    let next = Marginal::new(imager, &rough, Arc::clone(&design), values, assumed, before);
                    Some(higher(best, next))
                })
            };
            let tried = starts(&known).into_par_iter().with_max_len(1).filter_map(start);
            let best = tried.reduce_with(|best, next| higher(Some(best), next));
            let best = best.expect("a start at least")?;
            (at(best.assumed, Some(&best))?, None)
        }
    };
    // a subset or another fit gives a start that is close, and rough maps need an accuracy of a few tenths only
    let is_fitted = share.is_some() || near.map_or(is_near, |near| near.hessian.is_some());
    let few = many && basis.is_rough() && is_fitted;
    let mut top = climb(first, &known, hessian, if few { 1 } else { STEPS }, &at)?;
    if !is_near && share.is_none() && known.break_degree.is_none() && known.slope.is_none() {
        top = with_or_without_break(top, &known, &at)?;
    }
    if known.jitter_kms.is_none() {
        top = with_or_without_jitter(top, &known, &at)?;
    }
    let Top { marginal, hessian } = top;
    fitted(marginal, Some(hessian), &known)
}

/// The fit with this result.
fn fitted(marginal: Marginal, hessian: Option<Matrix4<f64>>, known: &Known) -> Result<Fitted, NoFit> {
    let ln_evidence = marginal.ln_evidence();
    if !ln_evidence.is_finite() {
        return Err(NoFit::NotFinite);
    }
    let at_bounds = reached(&marginal.assumed, known);
    Ok(Fitted { marginal, ln_evidence, at_bounds, hessian })
}

/// Whether a climb with all profiles does.
pub(super) fn takes_minutes(imager: &Imager, basis: &Basis) -> bool {
    imager.epochs() as f64 * (basis.len() as f64).powi(2) > LONG
}

/// The profiles with the field of a subset of them, or of a fit `near` where maps of the subset are not found: profiles
/// that follow each other closely give nearly the same constraints on the field. `None` where neither is available.
fn by_a_share(
    imager: &Imager,
    (basis, design): (&Arc<Basis>, &Arc<Design>),
    values: ParameterValues,
    known: Known,
    near: Option<&Fitted>,
    at: &impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError>,
) -> Result<Option<Fitted>, NoFit> {
    let Some(share) = share_of_many(imager) else { return Ok(None) };
    let start = near.map(|near| near.marginal.assumed.into()).or(known.start);
    let (marginal, hessian) = match (fit(&share, basis, values, Known { start, ..known }, None), near) {
        (Ok(of), Some(near)) => (anew(of.marginal.assumed, &near.marginal, at)?, of.hessian),
        (Ok(of), None) => (of_share(&of.marginal, (imager, basis, design), values, at)?, of.hessian),
        (Err(NoFit::Field(FieldError::NotSettled { .. })), Some(near)) => {
            (anew(near.marginal.assumed, &near.marginal, at)?, near.hessian)
        }
        (Err(_), _) => return Ok(None),
    };
    fitted(marginal, hessian, &known).map(Some)
}

/// All profiles with the field of a subset of them.
fn of_share(
    share: &Marginal,
    (imager, basis, design): (&Imager, &Arc<Basis>, &Arc<Design>),
    values: ParameterValues,
    at: &impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError>,
) -> Result<Marginal, FieldError> {
    let begun = Marginal::of_share(imager, basis, Arc::clone(design), values, share);
    begun.or_else(|_| at(share.assumed, None))
}

/// The profiles with a field from neighbouring maps, or from uniform ones: maps of another orbit may be too far away.
pub(super) fn anew(
    assumed: Assumed,
    near: &Marginal,
    at: &impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError>,
) -> Result<Marginal, FieldError> {
    at(assumed, Some(near)).or_else(|_| at(assumed, None))
}

/// A subset of the profiles where there are [`MANY`]: one of each group of profiles that follow each other in a data
/// set, at most half as many in total, but at least one per set. Its position in the group varies: profiles at even
/// times would show a star of the same period from one side.
pub(super) fn share_of_many(imager: &Imager) -> Option<Imager> {
    let profiles = imager.profiles().count();
    let every = profiles.div_ceil(MANY / 2);
    let chosen = |set: Range<usize>| {
        let first = |k: usize| set.start + k * every;
        let one = |k: usize| first(k) + ((k as f64 * GOLDEN).fract() * every.min(set.end - first(k)) as f64) as usize;
        (0..set.len().div_ceil(every)).map(one).collect::<Vec<_>>()
    };
    let kept: Vec<usize> = imager.profiles_of_sets().into_iter().flat_map(chosen).collect();
    let others = || (0..profiles).filter(|k| !kept.contains(k)).collect::<Vec<_>>();
    (is_many(imager) && kept.len() < MANY).then(|| imager.without(&others()))
}

/// Whether there are so many profiles that a subset constrains their field.
fn is_many(imager: &Imager) -> bool {
    imager.profiles().count() >= MANY
}

/// Every n-th profile, so that there are at most so many; `None` where there are no more.
pub(super) fn share_of(imager: &Imager, most: usize) -> Option<Imager> {
    let profiles = imager.profiles().count();
    let every = profiles.div_ceil(most);
    let others = || (0..profiles).filter(|k| k % every != 0).collect::<Vec<_>>();
    (every > 1).then(|| imager.without(&others()))
}

/// Starts of a fit: several lifetimes, each with and without a jitter, unless they are known.
fn starts(known: &Known) -> Vec<Vec<Assumed>> {
    let lifetimes: Vec<Lifetime> = match known.lifetime {
        Some(lifetime) => vec![lifetime],
        None => {
            let mut all = LIFETIMES_D.map(|days| known.within(2, days)).to_vec();
            all.dedup();
            all.into_iter().map(Lifetime::Days).collect()
        }
    };
    let jitters = known.jitter_kms.map_or(vec![0.0, USUAL_JITTER_KMS], |kms| vec![kms]);
    let spectrum = known.spectrum();
    let field = |lifetime: &Lifetime| Field { spectrum, kernel: Kernel::of(*lifetime) };
    let assumed = |lifetime: &Lifetime| {
        let field = field(lifetime);
        jitters.iter().map(|jitter_kms| known.assumed(field, *jitter_kms)).collect()
    };
    lifetimes.iter().map(assumed).collect()
}

/// The profiles with one of the starts of a fit.
type Found = Result<Marginal, FieldError>;

/// The one with the higher ln Z, the first of equals; or the last error.
fn higher(best: Option<Found>, next: Found, known: &Known) -> Found {
    match (best, next) {
        (Some(Ok(best)), Ok(next)) if known.height(&next) > known.height(&best) => Ok(next),
        (Some(Ok(best)), _) => Ok(best),
        (_, next) => next,
    }
}

/// The fit with a pure power-law spectrum instead of one with a break, where that is better.
fn with_or_without_break(
    fitted: Top,
    known: &Known,
    at: &(impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError> + Sync),
) -> Result<Top, FieldError> {
    let mut assumed = fitted.marginal.assumed;
    let spectrum = &mut assumed.field.spectrum;
    spectrum.break_degree = 0.0;
    if known.amplitude.is_none() {
        spectrum.amplitude = known.within(0, WITHOUT_BREAK.0 * spectrum.amplitude);
    }
    spectrum.slope = known.within(1, WITHOUT_BREAK.1 * spectrum.slope);
    let height = known.height(&fitted.marginal);
    match at(assumed, Some(&fitted.marginal)) {
        Ok(other) if known.height(&other) > height - FAR_BELOW => {
            let other = climb(other, known, None, STEPS, at)?;
            Ok(if known.height(&other.marginal) > height { other } else { fitted })
        }
        _ => Ok(fitted),
    }
}

/// The fit with a jitter instead of one without, or the other way round, where that is better.
fn with_or_without_jitter(
    fitted: Top,
    known: &Known,
    at: &(impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError> + Sync),
) -> Result<Top, FieldError> {
    let assumed = fitted.marginal.assumed;
    let jitter_kms = if assumed.jitter_kms == 0.0 { USUAL_JITTER_KMS / 2.0 } else { 0.0 };
    let Ok(other) = at(Assumed { jitter_kms, ..assumed }, Some(&fitted.marginal)) else { return Ok(fitted) };
    // the model without one is simpler
    let needed = if jitter_kms == 0.0 { -GAIN } else { GAIN };
    if known.height(&other) < known.height(&fitted.marginal) + needed {
        return Ok(fitted);
    }
    climb(other, known, None, STEPS, at)
}

/// The fitted parameters that lie on a bound.
fn reached(assumed: &Assumed, known: &Known) -> Vec<&'static str> {
    let (place, free, limits) = (place(assumed), known.free(assumed), limits(known));
    let on = |i: &usize| free[*i] && (place[*i] <= limits[*i].0 + 1e-9 || place[*i] >= limits[*i].1 - 1e-9);
    (0..3).filter(on).map(|i| Parameter::FIELD[i].name()).collect()
}
