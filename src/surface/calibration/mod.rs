//! What the profiles say of themselves before anything else: line, continuum and vsini ([`first_look`]), how large
//! their uncertainties are ([`noise`]), the RV jitter ([`jitter`]), RV offsets between data sets ([`offsets`]), and the
//! target chi2 ([`target`]).

pub mod events;
pub mod first_look;
pub mod jitter;
pub mod noise;
pub mod offsets;
pub mod star;
pub mod target;

use crate::model::{Parameter, ParameterValues};
use crate::surface::evolving_map::contrast::{FittedContrast, fit_contrast};
use crate::surface::evolving_map::star::{coarsely, slopes};
use crate::surface::evolving_map::{Assumed, Fitted, NoFit};
use crate::surface::expansion::Nuisance;
use crate::surface::imaging::Imager;
use crate::surface::{FieldStart, Known};
use events::{ByHand, Events};
use star::MeasuredStar;

/// What is to be asked of the profiles before maps and searches.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// Numbers of the star.
    pub fitted: &'a [Parameter],
    /// Events, with what is known of each profile.
    pub events: Option<&'a [ByHand]>,
    /// Whether the velocities have a slope; one that the imager integrates out anyway is held where it is found.
    pub slope: bool,
    /// Data sets with a contrast of spots for each.
    pub contrasts: &'a [usize],
    /// Parameters that are integrated out.
    pub nuisances: &'a [Nuisance],
}

/// What they say.
#[derive(Clone, Debug)]
pub struct FoundStar {
    /// Line and active regions, where they are fitted.
    pub star: Option<MeasuredStar>,
    /// Events, where they are looked for.
    pub events: Option<Events>,
    /// Slopes at which drifts of the velocities are held (km/s per day); empty where they have none.
    pub drift_kms_d: Vec<f64>,
    /// Contrasts of spots of the data sets that have one each.
    pub contrasts: Vec<FittedContrast>,
    /// Where a fit with finer maps begins.
    pub field: FieldStart,
}

/// What the profiles say of all that is `asked`. Flares would be taken for regions, and regions for flares: events are
/// found with plain spots first, and anew with the star that is found without them. Spots and jitter would take up a
/// drift: profiles are expected where it moves them before either is fitted. `report` is told what is under way.
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
    let events = |imager: &Imager, near: Assumed| {
        report("looking for flares and other events");
        asked.events.map(|by_hand| Events::of(imager, values, known, near, by_hand)).transpose()
    };
    report("fitting active regions");
    let mut plain = coarsely(imager, values, *known)?;
    let mut drifting = match asked.slope {
        true => imager.clone().with_drifts(false),
        false => imager.clone(),
    };
    let mut drift_kms_d = Vec::new();
    // a steep one has bent the maps from which it was found
    for _ in 0..2 {
        let Some(kms_d) = slopes(&drifting, &plain, asked.nuisances)? else { break };
        drifting.hold_drifts(&kms_d);
        plain = coarsely(&drifting, values, *known)?;
        drift_kms_d = kms_d;
    }
    let imager = if drift_kms_d.is_empty() { imager } else { &drifting };
    let contrasts = |imager: &mut Imager, near: &Fitted| {
        asked.contrasts.iter().map(|set| fitted_contrast(imager, near, *set)).collect::<Result<Vec<_>, NoFit>>()
    };
    let mut imager = imager.clone();
    let mut of_sets = contrasts(&mut imager, &plain)?;
    if !of_sets.is_empty() {
        plain = coarsely(&imager, values, *known)?;
    }
    let imager = &imager;
    let first = events(imager, plain.marginal.assumed)?;
    if asked.fitted.is_empty() {
        let field = plain.marginal.assumed.into();
        return Ok(FoundStar { star: None, events: first, drift_kms_d, contrasts: of_sets, field });
    }
    let mut without = imager.clone();
    if let Some(first) = first.as_ref().filter(|first| !first.profiles.is_empty()) {
        without = imager.with_larger_errors(&first.factors(imager.profiles().count()));
        plain = coarsely(&without, values, *known)?;
    }
    report("fitting active regions");
    let (mut star, mut near) = MeasuredStar::of(&without, &plain, known, asked.fitted)?;
    let of_regions: Vec<Parameter> =
        asked.fitted.iter().copied().filter(|parameter| Parameter::REGIONS.contains(parameter)).collect();
    if star.numbers.is_empty() && !of_regions.is_empty() && of_regions.len() < asked.fitted.len() {
        // a line that is right as it is must not count against regions
        let (alone, of_alone) = MeasuredStar::of(&without, &plain, known, &of_regions)?;
        if !alone.numbers.is_empty() {
            (star, near) = (alone, of_alone);
        }
    }
    let mut imager = imager.clone();
    star.put_into(&mut imager);
    if !of_sets.is_empty() && !star.numbers.is_empty() {
        // the line of regions has taken up some of what spots were dark for
        star.put_into(&mut without);
        let Fitted { marginal, .. } = coarsely(&without, values, Known { start: Some(near.into()), ..*known })?;
        near = marginal.assumed;
        of_sets = contrasts(&mut without, &Fitted::near(marginal))?;
        of_sets.iter().zip(asked.contrasts).for_each(|(of, set)| imager.sets[*set].contrast = Some(of.value));
    }
    let events = if star.numbers.is_empty() { first } else { events(&imager, near)? };
    Ok(FoundStar { star: Some(star), events, drift_kms_d, contrasts: of_sets, field: near.into() })
}

/// The contrast of spots in a data `set`, which is put into the imager.
fn fitted_contrast(imager: &mut Imager, near: &Fitted, set: usize) -> Result<FittedContrast, NoFit> {
    let fitted = fit_contrast(imager, near, set)?;
    imager.sets[set].contrast = Some(fitted.value);
    Ok(fitted)
}
