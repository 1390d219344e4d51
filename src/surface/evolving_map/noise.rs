//! The noise of the velocities beside that of the profiles: a jitter, and RV offsets of nights, fitted together.
//!
//! The fit of the field finds a jitter. Offsets of nights take its place where they are more likely: from the
//! velocities of the star without either, as in the search for a planet (`planets::periodogram::nights`).

use super::fit::anew;
use super::linearised::linearised;
use super::{Assumed, Fitted, Known, Marginal};
use crate::field::FieldError;
use crate::model::{Elements, ParameterSpace};
use crate::planets::periodogram::nights::Nights;
use crate::planets::periodogram::two_planets::without as without_orbit;
use crate::planets::periodogram::{Scatter, USUAL_STABILITY_KMS};
use crate::surface::{At, Linearised, WithoutJitter};
use std::sync::Arc;

/// The star `here` without jitter and offsets, where they are to be fitted.
pub(super) fn without(at: At, here: &Linearised, known: &Known) -> Result<Option<WithoutJitter>, FieldError> {
    if known.jitter_kms.is_some() {
        return Ok(None);
    }
    let fitted = here.kept::<Fitted>();
    let Assumed { jitter_kms, night_kms, .. } = fitted.marginal.assumed;
    let found_kms = jitter_kms.hypot(night_kms);
    let stability_kms = known.stability_kms.unwrap_or(USUAL_STABILITY_KMS);
    let nights = Nights::new(here.quadratic.len(), &at.imager.nights_of_sets());
    if !fitted.marginal.assumed.has_noise() {
        return Ok(Some(WithoutJitter { here: here.clone(), found_kms, stability_kms, nights }));
    }
    let marginal = fitted.marginal.without_jitter(at.imager)?;
    let without = linearised(at.imager, Fitted { marginal, ..fitted.clone() }, at.nuisances)?;
    let here = Linearised { field: here.field.clone(), ..without };
    Ok(Some(WithoutJitter { here, found_kms, stability_kms, nights }))
}

/// The star `here` with this noise.
pub(super) fn with(at: At, here: &Linearised, noise: Scatter) -> Result<Linearised, FieldError> {
    let Scatter { jitter_kms, night_kms } = noise;
    let Fitted { marginal, at_bounds, hessian, .. } = here.kept::<Fitted>();
    let assumed = Assumed { jitter_kms, night_kms, ..marginal.assumed };
    let noisy = |assumed: Assumed, near: Option<&Marginal>| {
        let (basis, design) = (&marginal.basis, Arc::clone(&marginal.design));
        Marginal::new(at.imager, basis, design, marginal.values, assumed, near)
    };
    let marginal = anew(assumed, marginal, &noisy)?;
    let fitted = Fitted { at_bounds: at_bounds.clone(), hessian: *hessian, ..Fitted::near(marginal) };
    linearised(at.imager, fitted, at.nuisances)
}

/// The most likely noise of the star `here`, beside its orbits, where there may be offsets of nights; amplitudes of
/// orbits with a free K are marginalised over: with the best ones too little would be left.
pub(super) fn beside_orbits(at: At, here: &Linearised, known: &Known, space: &ParameterSpace) -> Option<Scatter> {
    Nights::new(here.quadratic.len(), &at.imager.nights_of_sets())?;
    let star = without(at, here, known).ok()??;
    let is_free = |of: &&Elements| space.free().iter().any(|free| free.parameter == of.k);
    let orbit = at.values.motion().first;
    let mut velocities = star.here.quadratic.clone();
    velocities.count_in(|cycle| -orbit.velocity_kms(cycle));
    for ratio in Elements::PLANETS.iter().filter(is_free).filter_map(|of| at.values.get(of.ratio)) {
        velocities = without_orbit(&velocities, 1.0 / ratio).unwrap_or(velocities);
    }
    star.noise(&velocities)
}
