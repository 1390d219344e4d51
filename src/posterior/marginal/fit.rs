//! What the profiles say of the field itself: the amplitude, slope and lifetime for which ln Z is largest, and the
//! jitter.

use super::known::{BOUNDS, Known, USUAL};
use super::{Assumed, Basis, Design, Marginal};
use crate::field::{Field, FieldError, Kernel, Lifetime, Spectrum};
use crate::posterior::imaging::Imager;
use crate::posterior::objective::{Parameter, ParameterValues};
use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;
use std::sync::Arc;

/// Amplitude and slope of a spectrum without a break over those of one with it that is as good.
const WITHOUT_BREAK: (f64, f64) = (1.2, 0.47);

/// From so much lower in ln Z no climb makes good.
const FAR_BELOW: f64 = 5.0;

const LIFETIMES_D: [f64; 5] = [4.0, 12.0, 36.0, 108.0, 400.0];
const USUAL_JITTER_KMS: f64 = 0.1;

/// Bounds of a jitter (km/s); that of none is 0.
const JITTER_KMS: (f64, f64) = (1e-3, 3.0);

/// A fit of so many profiles starts from that of a share of them, at most half as many.
const MANY: usize = 160;

/// A search ends when a step would gain less than this in ln Z, or after so many.
const GAIN: f64 = 0.02;
const STEPS: usize = 25;

/// Step of the derivatives of ln Z: errors of ln Z of 0.03 are some 10 in its second derivative.
const STEP: f64 = 0.1;

/// Second derivatives of minus ln Z that are larger than this say something.
const LEAST_BEND: f64 = 10.0;

/// Longest step in ln amplitude, slope and ln lifetime: maps are found from those of the step before.
const LONGEST: f64 = 0.35;

/// The most probable field.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The profiles with it.
    pub marginal: Marginal,
    /// ln Z, the jitter counted.
    pub ln_evidence: f64,
    /// Bounds of the search that were reached.
    pub at_bounds: Vec<&'static str>,
}

/// Why there is no most probable field.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoFit {
    /// The field cannot be integrated over.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// No spots are like that.
    #[error(
        "the amplitude of the spots grows to the upper bound of its search, {0:.2}: spots stand in for something else; \
        star.vsini_kms, star.line, star.vsys_kms or observations.sigma_scale may be wrong"
    )]
    TooLarge(f64),
    /// The density of the data is no number.
    #[error("the evidence of the most probable field is not finite; data or errors are beyond sense")]
    NotFinite,
}

impl NoFit {
    /// A name for it.
    pub fn status(&self) -> &'static str {
        match self {
            NoFit::Field(FieldError::NoSuchField { .. }) => "no-such-field",
            NoFit::Field(FieldError::NotFinite { .. }) | NoFit::NotFinite => "non-finite",
            NoFit::Field(FieldError::NotPositive) => "not-positive",
            NoFit::Field(FieldError::NotSettled { .. }) => "not-settled",
            NoFit::TooLarge(_) => "amplitude-at-bound",
        }
    }
}

impl Fitted {
    /// The amplitude, where it lies on the lower bound: the profiles show no spots.
    pub fn too_faint(&self) -> Option<f64> {
        let amplitude = self.marginal.assumed.field.spectrum.amplitude;
        (self.at_bounds.contains(&Parameter::SpotAmplitude.name()) && amplitude < USUAL[0]).then_some(amplitude)
    }

    /// That spots are like that.
    fn checked(self) -> Result<Self, NoFit> {
        let amplitude = self.marginal.assumed.field.spectrum.amplitude;
        match self.at_bounds.contains(&Parameter::SpotAmplitude.name()) {
            true if amplitude > BOUNDS[0].1 - 1e-9 => Err(NoFit::TooLarge(amplitude)),
            _ if !self.ln_evidence.is_finite() => Err(NoFit::NotFinite),
            _ => Ok(self),
        }
    }
}

/// The profiles with a usual field, but for what is known: one that does not change, if the lifetime is not. Maps are
/// found from those `near` by.
pub(super) fn usual(
    imager: &Imager,
    basis: &Basis,
    values: ParameterValues,
    known: Known,
    near: Option<&Marginal>,
) -> Result<Fitted, FieldError> {
    let spectrum = known.spectrum();
    let kernel = Kernel::of(known.lifetime.unwrap_or(Lifetime::Static));
    let assumed = Assumed { field: Field { spectrum, kernel }, jitter_kms: known.jitter_kms.unwrap_or(0.0) };
    let design = Arc::new(Design::new(imager, basis, &values.state()));
    let marginal = Marginal::new(imager, basis, design, values, assumed, near)?;
    let ln_evidence = marginal.ln_evidence();
    Ok(Fitted { marginal, ln_evidence, at_bounds: Vec::new() })
}

/// Fits the field to the profiles at `values`, from the result of a fit `near` by, or else from several lifetimes; of
/// many profiles from what a share of them says, whether the spectrum has a break included.
///
/// # Errors
/// [`NoFit`]: of the last attempt, where none succeeds.
pub fn fit(
    imager: &Imager,
    basis: &Basis,
    values: ParameterValues,
    known: Known,
    near: Option<&Marginal>,
) -> Result<Fitted, NoFit> {
    let design = Arc::new(Design::new(imager, basis, &values.state()));
    let at = |assumed: Assumed, nearby: Option<&Marginal>| {
        Marginal::new(imager, basis, Arc::clone(&design), values, assumed, nearby)
    };
    let share = near.is_none().then(|| by_a_share(imager, basis, values, known)).flatten();
    let first = match (near, share) {
        (Some(near), _) => at(near.assumed, Some(near)).or_else(|_| {
            // maps of another orbit may be too far away
            at(near.assumed, None)
        })?,
        (None, Some(assumed)) => at(assumed, None)?,
        (None, None) => {
            let rough = basis.roughly();
            // of many profiles each is hundreds of megabytes: only the best so far is kept
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
            at(best.assumed, Some(&best))?
        }
    };
    let mut marginal = climb(first, &known, &at)?;
    if near.is_none() && share.is_none() && known.break_degree.is_none() && known.slope.is_none() {
        marginal = with_or_without_break(marginal, &known, &at)?;
    }
    if known.jitter_kms.is_none() {
        marginal = with_or_without_jitter(marginal, &known, &at)?;
    }
    let ln_evidence = marginal.ln_evidence();
    let at_bounds = reached(&marginal.assumed, &known);
    Fitted { marginal, ln_evidence, at_bounds }.checked()
}

/// The field of a share of the profiles: nearly that of all of them, at a small part of the work. `None` where there
/// are few, the share does not tell it, or nothing is left to tell.
fn by_a_share(imager: &Imager, basis: &Basis, values: ParameterValues, known: Known) -> Option<Assumed> {
    let share = share_of(imager).filter(|_| known.is_open())?;
    Some(fit(&share, basis, values, known, None).ok()?.marginal.assumed)
}

/// Every n-th profile, where there are [`MANY`]: at most half as many as that.
pub(super) fn share_of(imager: &Imager) -> Option<Imager> {
    let profiles = imager.profiles().count();
    let every = profiles.div_ceil(MANY / 2);
    let others = || (0..profiles).filter(|k| k % every != 0).collect::<Vec<_>>();
    (profiles >= MANY).then(|| imager.without(&others()))
}

/// Where a fit may start: several lifetimes, each with and without a jitter, as far as they are not known.
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
        jitters.iter().map(|jitter_kms| Assumed { field, jitter_kms: *jitter_kms }).collect()
    };
    lifetimes.iter().map(assumed).collect()
}

/// The profiles with one of the fields that a fit may start from.
type Found = Result<Marginal, FieldError>;

/// The one with the higher ln Z, the first of equals; or the last error.
fn higher(best: Option<Found>, next: Found, known: &Known) -> Found {
    match (best, next) {
        (Some(Ok(best)), Ok(next)) if known.height(&next) > known.height(&best) => Ok(next),
        (Some(Ok(best)), _) => Ok(best),
        (_, next) => next,
    }
}

/// The fit with a spectrum that is a power law all the way in place of one with a break, where that is better.
fn with_or_without_break(
    fitted: Marginal,
    known: &Known,
    at: &(impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError> + Sync),
) -> Result<Marginal, FieldError> {
    let mut assumed = fitted.assumed;
    let spectrum = &mut assumed.field.spectrum;
    spectrum.break_degree = 0.0;
    if known.amplitude.is_none() {
        spectrum.amplitude = known.within(0, WITHOUT_BREAK.0 * spectrum.amplitude);
    }
    spectrum.slope = known.within(1, WITHOUT_BREAK.1 * spectrum.slope);
    match at(assumed, Some(&fitted)) {
        Ok(other) if known.height(&other) > known.height(&fitted) - FAR_BELOW => {
            let other = climb(other, known, at)?;
            Ok(if known.height(&other) > known.height(&fitted) { other } else { fitted })
        }
        _ => Ok(fitted),
    }
}

/// The fit with a jitter in place of one without, or the other way round, where that is better.
fn with_or_without_jitter(
    fitted: Marginal,
    known: &Known,
    at: &(impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError> + Sync),
) -> Result<Marginal, FieldError> {
    let jitter_kms = if fitted.assumed.jitter_kms == 0.0 { USUAL_JITTER_KMS / 2.0 } else { 0.0 };
    let Ok(other) = at(Assumed { jitter_kms, ..fitted.assumed }, Some(&fitted)) else { return Ok(fitted) };
    // without one it is simpler
    let needed = if jitter_kms == 0.0 { -GAIN } else { GAIN };
    if other.ln_evidence() < fitted.ln_evidence() + needed {
        return Ok(fitted);
    }
    climb(other, known, at)
}

/// ln amplitude, slope, ln lifetime, ln jitter.
fn place(Assumed { field, jitter_kms }: &Assumed) -> Vector4<f64> {
    let lifetime_d = match field.kernel.lifetime {
        Lifetime::Days(days) => days,
        Lifetime::Static => f64::INFINITY,
    };
    Vector4::new(field.spectrum.amplitude.ln(), field.spectrum.slope, lifetime_d.ln(), jitter_kms.ln())
}

fn assumed_at(place: Vector4<f64>, like: &Assumed) -> Assumed {
    let lifetime = match like.field.kernel.lifetime {
        Lifetime::Static => Lifetime::Static,
        Lifetime::Days(_) => Lifetime::Days(place[2].exp()),
    };
    let field = Field {
        spectrum: Spectrum { amplitude: place[0].exp(), slope: place[1], ..like.field.spectrum },
        kernel: Kernel { lifetime, ..like.field.kernel },
    };
    Assumed { field, jitter_kms: if like.jitter_kms == 0.0 { 0.0 } else { place[3].exp() } }
}

/// Bounds in the coordinates of [`place`].
fn limits(known: &Known) -> [(f64, f64); 4] {
    let [amplitude, slope, lifetime] = [0, 1, 2].map(|i| {
        let ((low, high), p) = (known.bounds(i), Parameter::FIELD[i]);
        (p.to_sampling(low), p.to_sampling(high))
    });
    [amplitude, slope, lifetime, (JITTER_KMS.0.ln(), JITTER_KMS.1.ln())]
}

/// Which of the fitted numbers lie on a bound.
fn reached(assumed: &Assumed, known: &Known) -> Vec<&'static str> {
    let (place, free, limits) = (place(assumed), known.free(assumed), limits(known));
    let on = |i: &usize| free[*i] && (place[*i] <= limits[*i].0 + 1e-9 || place[*i] >= limits[*i].1 - 1e-9);
    (0..3).filter(on).map(|i| Parameter::FIELD[i].name()).collect()
}

/// The way up from `first` by quasi-Newton steps (BFGS; Nocedal & Wright 2006, chapter 6), within the bounds.
fn climb(
    first: Marginal,
    known: &Known,
    at: &(impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError> + Sync),
) -> Result<Marginal, FieldError> {
    let (free, limits) = (known.free(&first.assumed), limits(known));
    let height = |of: &Marginal| known.height(of);
    // gradient, and second derivatives along each number. Derivatives at fixed maps are not enough: the determinant
    // changes with the maps, and outweighs the rest
    let slope = |of: &Marginal| {
        let from = place(&of.assumed);
        let beside = |i: usize, h: f64| {
            let mut to = from;
            to[i] += h;
            at(assumed_at(to, &of.assumed), Some(of))
                .map(|there| height(&there))
                .ok()
                .filter(|height| height.is_finite())
        };
        let along = |i: usize| {
            if !free[i] {
                return (0.0, 0.0);
            }
            let here = height(of);
            match rayon::join(|| beside(i, STEP), || beside(i, -STEP)) {
                (Some(above), Some(below)) => {
                    ((above - below) / (2.0 * STEP), (2.0 * here - above - below) / (STEP * STEP))
                }
                (Some(above), None) => ((above - here) / STEP, 0.0),
                (None, Some(below)) => ((here - below) / STEP, 0.0),
                (None, None) => (0.0, 0.0),
            }
        };
        let all = [0, 1, 2, 3].map(along);
        (Vector4::from(all.map(|a| a.0)), Vector4::from(all.map(|a| a.1)))
    };
    let mut here = first;
    let (mut gradient, bend) = slope(&here);
    // the inverse Hessian of minus ln Z begins with its diagonal; where that says nothing errors of 10 % are usual
    let mut inverse = Matrix4::from_diagonal(&bend.map(|bend| if bend > LEAST_BEND { bend.recip() } else { 0.01 }));
    for _ in 0..STEPS {
        let from = place(&here.assumed);
        // what pushes against a bound stays there
        let pushes = |i: usize| {
            let (low, high) = limits[i];
            (from[i] <= low + 1e-9 && gradient[i] < 0.0) || (from[i] >= high - 1e-9 && gradient[i] > 0.0)
        };
        let inside = Vector4::from_fn(|i, _| if pushes(i) { 0.0 } else { gradient[i] });
        let mut step = inverse * inside;
        step = Vector4::from_fn(|i, _| if pushes(i) || !free[i] { 0.0 } else { step[i] });
        if inside.dot(&step) < 2.0 * GAIN {
            break;
        }
        step *= (LONGEST / step.amax()).min(1.0);
        let Some((next, slope_there)) = shortened(&here, step, &gradient, (&limits, &height), &slope, at) else {
            break;
        };
        let moved = Vector4::from_fn(|i, _| if free[i] { place(&next.assumed)[i] - from[i] } else { 0.0 });
        let bent = gradient - slope_there;
        let gained = height(&next) - height(&here);
        (here, gradient) = (next, slope_there);
        let curved = moved.dot(&bent);
        if curved > 0.0 {
            let rho = 1.0 / curved;
            let left = Matrix4::identity() - moved * bent.transpose() * rho;
            inverse = left * inverse * left.transpose() + moved * moved.transpose() * rho;
        }
        if gained < 0.1 * GAIN {
            break;
        }
    }
    Ok(here)
}

/// The first of ever shorter steps that leads up, and the gradient there; `None` where none does.
fn shortened(
    here: &Marginal,
    mut step: Vector4<f64>,
    gradient: &Vector4<f64>,
    (limits, height): (&[(f64, f64); 4], &impl Fn(&Marginal) -> f64),
    slope: &impl Fn(&Marginal) -> (Vector4<f64>, Vector4<f64>),
    at: &impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError>,
) -> Option<(Marginal, Vector4<f64>)> {
    const TRIES: usize = 6;
    let from = place(&here.assumed);
    for _ in 0..TRIES {
        let to = Vector4::from_fn(|i, _| (from[i] + step[i]).clamp(limits[i].0, limits[i].1.max(from[i])));
        let to = Vector4::from_fn(|i, _| if step[i] == 0.0 { from[i] } else { to[i] });
        let next = at(assumed_at(to, &here.assumed), Some(here));
        if let Some(next) = next.ok().filter(|next| height(next) > height(here) + 1e-4 * gradient.dot(&step)) {
            let (slope, _) = slope(&next);
            return Some((next, slope));
        }
        step *= 0.3;
    }
    None
}
