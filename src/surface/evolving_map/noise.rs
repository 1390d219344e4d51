//! The noise of the velocities beside that of the profiles: a jitter, and RV offsets of nights, fitted together.
//!
//! The fit of the field finds a jitter. Offsets of nights take its place where they are more likely: from the
//! velocities of the star without either, as in the search for a planet (`planets::periodogram::nights`).

use super::linearised::linearised;
use super::{Assumed, Fitted, Known, Marginal};
use crate::field::FieldError;
use crate::model::Parameter;
use crate::planets::periodogram::Scatter;
use crate::planets::periodogram::nights::{Nights, Reach, most_likely};
use crate::planets::periodogram::two_planets::without as without_orbit;
use crate::surface::{At, Linearised, WithoutJitter};
use std::sync::Arc;

/// The star `here` without jitter and offsets, where they are to be fitted.
pub(super) fn without(at: At, here: &Linearised, known: &Known) -> Result<Option<WithoutJitter>, FieldError> {
    if known.jitter_kms.is_some() {
        return Ok(None);
    }
    let fitted = here.kept::<Fitted>();
    let Assumed { jitter_kms, night_kms, .. } = fitted.marginal.assumed;
    let (found_kms, scale_kms) = (jitter_kms.hypot(night_kms), known.jitter_scale_kms);
    let nights = Nights::new(here.quadratic.len(), &at.imager.nights_of_sets());
    if !fitted.marginal.assumed.has_noise() {
        return Ok(Some(WithoutJitter { here: here.clone(), found_kms, scale_kms, nights }));
    }
    let marginal = fitted.marginal.without_jitter(at.imager)?;
    let without = linearised(at.imager, Fitted { marginal, ..fitted.clone() }, at.nuisances)?;
    let here = Linearised { field: here.field.clone(), ..without };
    Ok(Some(WithoutJitter { here, found_kms, scale_kms, nights }))
}

/// The star `here` with the most likely jitter and offsets, where they are to be fitted and offsets are needed.
pub(super) fn with_night_offsets(at: At, here: Linearised, known: &Known) -> Result<Linearised, FieldError> {
    let Some(WithoutJitter { here: without, found_kms, scale_kms, nights: Some(nights) }) = without(at, &here, known)?
    else {
        return Ok(here);
    };
    // marginalised over its orbit: with the best one too little would be left
    let orbit = at.values.motion().first;
    let mut velocities = without.quadratic.clone();
    velocities.count_in(|cycle| -orbit.velocity_kms(cycle));
    let velocities = without_orbit(&velocities, 1.0 / at.values[Parameter::PorbOverProt]).unwrap_or(velocities);
    let found = most_likely(&velocities, &nights, (found_kms, scale_kms), Reach::Stable);
    let Some((Scatter { jitter_kms, night_kms }, _)) = found else { return Ok(here) };
    let Fitted { marginal, at_bounds, hessian, .. } = here.kept::<Fitted>();
    let assumed = Assumed { jitter_kms, night_kms, ..marginal.assumed };
    let (basis, design) = (&marginal.basis, Arc::clone(&marginal.design));
    let marginal = Marginal::new(at.imager, basis, design, marginal.values, assumed, Some(marginal))?;
    let fitted = Fitted { at_bounds: at_bounds.clone(), hessian: *hessian, ..Fitted::near(marginal) };
    linearised(at.imager, fitted, at.nuisances)
}
