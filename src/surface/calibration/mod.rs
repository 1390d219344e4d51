//! Quantities measured from the profiles before anything else: line, continuum and vsini ([`first_look`]), the size of
//! their uncertainties ([`noise`]), the RV jitter ([`jitter`]), RV offsets between data sets ([`offsets`]), the target
//! chi2 ([`target`]), and the dependence of activity indicators on the spots ([`indicators`]).

pub mod events;
pub mod first_look;
pub mod indicators;
pub mod jitter;
pub mod noise;
pub mod offsets;
pub mod star;
pub mod target;

use crate::model::{FreeParameter, Parameter, ParameterValues};
use crate::surface::evolving_map::contrast::{FittedContrast, fit_contrast};
use crate::surface::evolving_map::star::{coarsely, slopes};
use crate::surface::evolving_map::{Assumed, Fitted, NoFit};
use crate::surface::expansion::Nuisance;
use crate::surface::imaging::Imager;
use crate::surface::{FieldStart, Known, OtherRotation};
use events::{ByHand, Events};
use star::{MeasuredStar, Open, with_geometry};

/// The quantities to be fitted before maps and searches.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// Stellar parameters.
    pub fitted: &'a [Parameter],
    /// Events, with what is known of each profile.
    pub events: Option<&'a [ByHand]>,
    /// Whether the velocities have a slope; one that the imager marginalises over is held at its best value.
    pub slope: bool,
    /// Data sets that have their own spot contrast.
    pub contrasts: &'a [usize],
    /// Free parameters.
    pub free: &'a [FreeParameter],
    /// Those that are marginalised over.
    pub nuisances: &'a [Nuisance],
    /// Whether the rotation period may differ.
    pub rotation: bool,
}

/// The results.
#[derive(Clone, Debug)]
pub struct FoundStar {
    /// Line and active regions, where they are fitted.
    pub star: Option<MeasuredStar>,
    /// Events, where they are searched for.
    pub events: Option<Events>,
    /// Slopes at which drifts of the velocities are held (km/s per day); empty where they have none.
    pub drift_kms_d: Vec<f64>,
    /// Spot contrasts of the data sets that have their own.
    pub contrasts: Vec<FittedContrast>,
    /// Another rotation period with which the profiles are far more probable.
    pub other_rotation: Option<OtherRotation>,
    /// The start of a fit with finer maps.
    pub field: FieldStart,
    /// Why there is no star, where one was to be fitted.
    pub problem: Option<NoFit>,
}

/// Fits all that is `asked` from the profiles. Flares would be absorbed by regions, and regions by flares: events are
/// found with plain spots first, and again with the star that is found without them. Spots and jitter would absorb a
/// drift: the profiles are corrected for it before either is fitted. `report` is called with the current stage.
///
/// # Errors
/// [`NoFit`].
pub fn found(
    imager: &Imager,
    values: ParameterValues,
    known: &Known,
    asked: Asked,
    report: &dyn Fn(&str),
) -> Result<FoundStar, NoFit> {
    let events = |imager: &Imager, values: ParameterValues, near: Assumed| {
        report("looking for flares and other events");
        asked.events.map(|by_hand| Events::of(imager, values, known, near, by_hand)).transpose()
    };
    let rotation = |imager: &Imager, values: ParameterValues, near: Assumed, events: Option<&Events>| {
        report("checking the rotation period");
        let factors =
            events.filter(|events| !events.profiles.is_empty()).map(|of| of.factors(imager.profiles().count()));
        let larger = factors.map(|factors| imager.with_larger_errors(&factors));
        asked.rotation.then(|| OtherRotation::of(larger.as_ref().unwrap_or(imager), values, near, *known)).flatten()
    };
    report("fitting active regions");
    let given: Vec<f64> = asked.contrasts.iter().map(|set| imager.contrast_of(*set)).collect();
    let plain = coarsely(imager, values, *known)?;
    let (mut imager, mut plain, drift_kms_d) = with_drifts_held(imager, plain, values, known, &asked)?;
    let mut contrasts = fit_contrasts(&mut imager, &plain, asked.contrasts, &given)?;
    if !contrasts.is_empty() {
        plain = coarsely(&imager, values, *known)?;
    }
    let near = plain.marginal.assumed;
    let first = events(&imager, values, near)?;
    if asked.fitted.is_empty() {
        let other_rotation = rotation(&imager, values, near, first.as_ref());
        let (events, field) = (first, near.into());
        return Ok(FoundStar { star: None, events, drift_kms_d, contrasts, other_rotation, field, problem: None });
    }
    let mut without = imager.clone();
    if let Some(first) = first.as_ref().filter(|first| !first.profiles.is_empty()) {
        without = imager.with_larger_errors(&first.factors(imager.profiles().count()));
        plain = coarsely(&without, values, *known)?;
    }
    report("fitting active regions");
    let open = Open { fitted: asked.fitted, free: asked.free };
    // if that fails, the fit begins with the values of the config
    if let Ok(Some(better)) = with_geometry(&without, &plain, known, open) {
        plain = better;
    }
    let (star, mut near) = match MeasuredStar::of(&without, &plain, known, open) {
        Ok(found) => found,
        // everything else is valid without it
        Err(error) => {
            let near = plain.marginal.assumed;
            let other_rotation = rotation(&imager, values, near, first.as_ref());
            let (events, field, problem) = (first, near.into(), Some(error));
            return Ok(FoundStar { star: None, events, drift_kms_d, contrasts, other_rotation, field, problem });
        }
    };
    star.put_into(&mut imager);
    let mut values = values;
    star.set(&mut values, |parameter| !parameter.is_surface());
    if !contrasts.is_empty() && !star.numbers.is_empty() {
        // the line of regions has absorbed part of the darkness of spots
        star.put_into(&mut without);
        let Fitted { marginal, .. } = coarsely(&without, values, Known { start: Some(near.into()), ..*known })?;
        near = marginal.assumed;
        contrasts = fit_contrasts(&mut without, &Fitted::near(marginal), asked.contrasts, &given)?;
        contrasts.iter().zip(asked.contrasts).for_each(|(of, set)| imager.sets[*set].contrast = Some(of.value));
    }
    let events = if star.numbers.is_empty() { first } else { events(&imager, values, near)? };
    let other_rotation = rotation(&imager, values, near, events.as_ref());
    let field = near.into();
    Ok(FoundStar { star: Some(star), events, drift_kms_d, contrasts, other_rotation, field, problem: None })
}

/// The same profiles and field `plain` with drifts held where one is steep, and their slopes (km/s per day); no slopes
/// where none is.
fn with_drifts_held(
    imager: &Imager,
    mut plain: Fitted,
    values: ParameterValues,
    known: &Known,
    asked: &Asked,
) -> Result<(Imager, Fitted, Vec<f64>), NoFit> {
    let mut drifting = imager.clone();
    if asked.slope {
        drifting = drifting.with_drifts(false);
    }
    let mut held = Vec::new();
    // a steep drift has distorted the maps from which it was found
    for _ in 0..2 {
        let Some(kms_d) = slopes(&drifting, &plain, asked.nuisances)? else { break };
        drifting.hold_drifts(&kms_d);
        plain = coarsely(&drifting, values, *known)?;
        held = kms_d;
    }
    let imager = if held.is_empty() { imager.clone() } else { drifting };
    Ok((imager, plain, held))
}

/// The spot contrasts in data `sets` with priors around those `given`; the results are set in `imager`.
fn fit_contrasts(
    imager: &mut Imager,
    near: &Fitted,
    sets: &[usize],
    given: &[f64],
) -> Result<Vec<FittedContrast>, NoFit> {
    let fit = |(set, given): (&usize, &f64)| {
        let fitted = fit_contrast(imager, near, *set, *given)?;
        imager.sets[*set].contrast = Some(fitted.value);
        Ok(fitted)
    };
    sets.iter().zip(given).map(fit).collect()
}
