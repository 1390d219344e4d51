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
use crate::surface::evolving_map::star::{coarsely, slopes};
use crate::surface::evolving_map::{Assumed, NoFit};
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
    let drift_kms_d = slopes(&drifting, &plain, asked.nuisances)?.unwrap_or_default();
    let imager = match drift_kms_d.is_empty() {
        true => imager,
        false => {
            drifting.hold_drifts(&drift_kms_d);
            plain = coarsely(&drifting, values, *known)?;
            &drifting
        }
    };
    let first = events(imager, plain.marginal.assumed)?;
    if asked.fitted.is_empty() {
        let field = plain.marginal.assumed.into();
        return Ok(FoundStar { star: None, events: first, drift_kms_d, field });
    }
    let mut without = imager.clone();
    if let Some(first) = first.as_ref().filter(|first| !first.profiles.is_empty()) {
        without = imager.with_larger_errors(&first.factors(imager.profiles().count()));
        plain = coarsely(&without, values, *known)?;
    }
    report("fitting active regions");
    let (star, near) = MeasuredStar::of(&without, &plain, known, asked.fitted)?;
    let mut imager = imager.clone();
    star.put_into(&mut imager);
    let events = if star.numbers.is_empty() { first } else { events(&imager, near)? };
    Ok(FoundStar { star: Some(star), events, drift_kms_d, field: near.into() })
}
