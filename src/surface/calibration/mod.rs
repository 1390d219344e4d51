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

use crate::field::{Field, Kernel, Lifetime, Spectrum};
use crate::model::{Parameter, ParameterValues};
use crate::surface::Known;
use crate::surface::evolving_map::star::coarsely;
use crate::surface::evolving_map::{Assumed, NoFit};
use crate::surface::imaging::Imager;
use events::{ByHand, Events};
use serde::{Deserialize, Serialize};
use star::MeasuredStar;

/// A field of spots from which a fit with finer maps begins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldStart {
    /// Standard deviation of the filling factor.
    pub spot_amplitude: f64,
    /// Slope of its spectrum.
    pub spot_slope: f64,
    /// Degree below which the spectrum is flat.
    pub spot_break_degree: f64,
    /// Lifetime (d); null for static spots.
    pub spot_lifetime_d: Option<f64>,
    /// Velocity jitter (km/s).
    pub velocity_jitter_kms: f64,
}

impl From<Assumed> for FieldStart {
    fn from(Assumed { field: Field { spectrum, kernel }, jitter_kms }: Assumed) -> Self {
        FieldStart {
            spot_amplitude: spectrum.amplitude,
            spot_slope: spectrum.slope,
            spot_break_degree: spectrum.break_degree,
            spot_lifetime_d: kernel.lifetime.days(),
            velocity_jitter_kms: jitter_kms,
        }
    }
}

impl FieldStart {
    /// What a fit begins from.
    pub fn assumed(&self) -> Assumed {
        let FieldStart { spot_amplitude, spot_slope, spot_break_degree, spot_lifetime_d, velocity_jitter_kms } = *self;
        let spectrum = Spectrum { amplitude: spot_amplitude, slope: spot_slope, break_degree: spot_break_degree };
        let kernel = Kernel::of(spot_lifetime_d.map_or(Lifetime::Static, Lifetime::Days));
        Assumed { field: Field { spectrum, kernel }, jitter_kms: velocity_jitter_kms }
    }
}

/// What the profiles say of the numbers of the star that are `fitted`, and of events, where these are looked for.
/// Flares would be taken for regions, and regions for flares: events are found with plain spots first, and anew with
/// the star that is found without them. With them goes the field from which a fit with finer maps begins. `report` is
/// told what is under way.
///
/// # Errors
/// [`NoFit`].
pub fn found(
    imager: &Imager,
    values: ParameterValues,
    known: &Known,
    (fitted, by_hand): (&[Parameter], Option<&[ByHand]>),
    report: &dyn Fn(&str),
) -> Result<(Option<MeasuredStar>, Option<Events>, FieldStart), NoFit> {
    let events = |imager: &Imager, near: Assumed| {
        report("looking for flares and other events");
        by_hand.map(|by_hand| Events::of(imager, values, known, near, by_hand)).transpose()
    };
    report("fitting active regions");
    let mut plain = coarsely(imager, values, *known)?;
    let first = events(imager, plain.marginal.assumed)?;
    if fitted.is_empty() {
        return Ok((None, first, plain.marginal.assumed.into()));
    }
    let mut without = imager.clone();
    if let Some(first) = first.as_ref().filter(|first| !first.profiles.is_empty()) {
        without = imager.with_larger_errors(&first.factors(imager.profiles().count()));
        plain = coarsely(&without, values, *known)?;
    }
    report("fitting active regions");
    let (star, near) = MeasuredStar::of(&without, &plain, known, fitted)?;
    let mut imager = imager.clone();
    star.put_into(&mut imager);
    let events = if star.numbers.is_empty() { first } else { events(&imager, near)? };
    Ok((Some(star), events, near.into()))
}
