//! The marginal likelihood: spots as a Gaussian field on the sphere and in time (room `field`), marginalised over
//! (`docs/method.md` section 9).
//!
//! In: the [`Imager`], values of all parameters, the assumptions on the field ([`Assumed`]). Out: ln Z, and its
//! gradient and information in the velocities of the profiles and in the stellar parameters, as an expansion like that
//! of maximum entropy. The order:
//! 1. [`Basis`]: the harmonics on the pixels of the map, once; `seen`: those to which the data are sensitive.
//! 2. [`Design`]: the profiles of each harmonic, for one star, by one model application per harmonic; and its light
//!    curves. Both are epochs of the field, profiles first.
//! 3. [`Marginal`]: the most probable maps, one per profile, and ln Z linearised there.
//! 4. [`fit()`]: the amplitude, slope and lifetime of the field, and the jitter, for which ln Z is largest.
//! 5. [`Maps`]: the most probable maps at any times, with their uncertainties.
//! 6. [`change`]: whether evolving spots explain the profiles better than static ones.
//! 7. [`MarginalPosterior`]: ln Z with the priors, for chains, likelihood grids and searches.
//! 8. [`Planned`]: the expected constraints of planned profiles on velocities.
//! 9. [`fit_indicator`]: the dependence of activity indicators on the spots; indicators in use are epochs, too.
//! 10. `absorbing`: fields that absorb more of an orbit that is not in the model, for detection limits.
//! 11. `errors`: the uncertainties of the field.
//! 12. `noise`: jitter and RV offsets of nights, fitted together.

mod absorbing;
mod basis;
pub mod change;
mod climb;
mod condense;
pub mod contrast;
mod density;
mod design;
mod errors;
pub mod events;
mod expand;
pub(in crate::surface) mod fit;
mod forecast;
mod indicators;
mod known;
mod light;
pub(in crate::surface) mod linearised;
mod maps;
mod nights;
mod noise;
mod optimum;
mod planned;
mod posterior;
mod rotation;
mod seen;
pub mod star;
mod surface;

pub use basis::Basis;
pub use change::Change;
pub use design::Design;
pub use fit::{Fitted, NoFit, fit};
pub use forecast::Forecast;
pub use indicators::{FittedIndicator, fit_indicator};
pub use known::{FieldStart, Known, LARGEST_AMPLITUDE};
pub use light::{FluxFit, LEVEL, ReadingFit};
pub use maps::Maps;
pub use planned::Planned;
pub use posterior::{LN_EVIDENCE, MarginalPosterior};
pub use rotation::OtherRotation;
pub use surface::EvolvingMap;

use crate::field::{Field, FieldError, Kernel, Lifetime, Settled, Sought, Spectrum, settle};
use crate::model::{FieldValues, Parameter, ParameterValues};
use crate::surface::imaging::Imager;
use nalgebra::DMatrix;
use std::sync::{Arc, OnceLock};

/// Mean of the field: the spot filling factor of a typical star. Profiles do not constrain it.
pub const MEAN_FILLING: f64 = 0.06;

/// Largest degree of the harmonics: finer than the line resolves. With 18, the residuals of a star of 40 km/s at S/N
/// 1000 would be absorbed by evolving spots.
pub const DEGREE: usize = 36;

/// Iterations of maps with a jitter, each along the slopes of the previous ones, from maps without one.
const JITTERED: usize = 2;

/// The assumptions before the data, beside the parameters of star and orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assumed {
    /// The spots.
    pub field: Field,
    /// RV jitter of the profiles (km/s).
    pub jitter_kms: f64,
    /// RV offsets of nights (km/s), in data sets where their size is not given.
    pub night_kms: f64,
}

/// The assumptions that are not parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Degree below which the spectrum of the spots is flat.
    pub break_degree: f64,
    /// RV jitter of the profiles (km/s).
    pub jitter_kms: f64,
    /// RV offsets of nights (km/s), in data sets where their size is not given.
    pub night_kms: f64,
}

impl Assumed {
    /// The field among the parameters, together with the assumptions that are not parameters.
    pub fn of(values: &ParameterValues, Held { break_degree, jitter_kms, night_kms }: Held) -> Self {
        let (amplitude, slope) = (values[Parameter::SpotAmplitude], values[Parameter::SpotSlope]);
        let spectrum = Spectrum { amplitude, slope, break_degree };
        let lifetime = values.get(Parameter::SpotLifetime).map_or(Lifetime::Static, Lifetime::Days);
        Assumed { field: Field { spectrum, kernel: Kernel::of(lifetime) }, jitter_kms, night_kms }
    }

    /// The assumptions that are not parameters.
    pub fn held(&self) -> Held {
        let Assumed { field, jitter_kms, night_kms } = *self;
        Held { break_degree: field.spectrum.break_degree, jitter_kms, night_kms }
    }

    /// Whether there is a jitter, or offsets of nights.
    pub(super) fn has_noise(&self) -> bool {
        self.jitter_kms > 0.0 || self.night_kms > 0.0
    }

    /// `values` with this field among them.
    fn among(&self, mut values: ParameterValues) -> ParameterValues {
        let Field { spectrum, kernel } = self.field;
        let Spectrum { amplitude, slope, .. } = spectrum;
        values.field = Some(FieldValues { amplitude, slope, lifetime_d: kernel.lifetime.days() });
        values
    }
}

/// The profiles marginalised over all maps, linearised around the most probable ones.
#[derive(Clone, Debug)]
pub struct Marginal {
    /// The parameters, those of the field as assumed.
    pub values: ParameterValues,
    /// What is assumed.
    pub assumed: Assumed,
    /// The harmonics that maps are made of.
    pub basis: Arc<Basis>,
    /// The star's response.
    pub design: Arc<Design>,
    /// The most probable maps (their coefficients, one column per profile and then per bin of light curves), and the
    /// evidence there.
    pub settled: Settled,
    /// Derivatives of the coefficients of each epoch with a velocity, once they are needed.
    velocity_slopes: OnceLock<Vec<DMatrix<f64>>>,
}

impl Marginal {
    /// At `values`, with the design given. Maps are found from those of a star and field `nearby`, or else from uniform
    /// ones; with a jitter then from those without.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn new(
        imager: &Imager,
        basis: &Arc<Basis>,
        design: Arc<Design>,
        values: ParameterValues,
        assumed: Assumed,
        nearby: Option<&Marginal>,
    ) -> Result<Self, FieldError> {
        let start = match nearby {
            Some(nearby) => nearby.settled.coefficients.clone(),
            None => DMatrix::zeros(basis.len(), imager.epochs()),
        };
        Marginal::begun((imager, basis), design, values, assumed, (nearby, start))
    }

    /// The same with the field of a `share` of the profiles, with maps found from those of the share.
    fn of_share(
        imager: &Imager,
        basis: &Arc<Basis>,
        design: Arc<Design>,
        values: ParameterValues,
        share: &Marginal,
    ) -> Result<Self, FieldError> {
        let times_d: Vec<f64> = imager.times_of_epochs().collect();
        let start = share.settled.evidence.coefficients_at(&times_d);
        Marginal::begun((imager, basis), design, values, share.assumed, (None, start))
    }

    /// The same for a star and field nearby, if there are any, with maps found from these coefficients (H, epochs).
    fn begun(
        (imager, basis): (&Imager, &Arc<Basis>),
        design: Arc<Design>,
        values: ParameterValues,
        assumed: Assumed,
        (nearby, start): (Option<&Marginal>, DMatrix<f64>),
    ) -> Result<Self, FieldError> {
        let sought = Sought { field: assumed.field, degrees: &basis.degrees, watched: &basis.watched };
        let values = assumed.among(values);
        if let Some(nearby) = nearby.filter(|_| assumed.jitter_kms > 0.0) {
            let times = if nearby.assumed.jitter_kms > 0.0 { basis.jittered } else { JITTERED };
            return Marginal::with_jitter((imager, basis), design, values, assumed, (nearby, start, times));
        }
        let by = nearby.map(|nearby| &nearby.settled.evidence);
        let linearise = |maps: &DMatrix<f64>| design.epochs(imager, maps);
        let settled = settle(linearise, sought, start, by, &basis.settling)?;
        let marginal = Marginal::settled_at((basis, design), values, assumed, settled);
        match assumed.jitter_kms {
            0.0 => Ok(marginal),
            _ => {
                let (design, start) = (Arc::clone(&marginal.design), marginal.settled.coefficients.clone());
                Marginal::with_jitter((imager, basis), design, values, assumed, (&marginal, start, JITTERED))
            }
        }
    }

    fn settled_at(
        (basis, design): (&Arc<Basis>, Arc<Design>),
        values: ParameterValues,
        assumed: Assumed,
        settled: Settled,
    ) -> Self {
        Marginal { values, assumed, basis: Arc::clone(basis), design, settled, velocity_slopes: OnceLock::new() }
    }

    /// The brightness of each pixel (rows) in the most probable map of each profile (columns).
    pub fn brightness(&self) -> DMatrix<f64> {
        self.design.brightness(&self.basis, &self.settled.coefficients)
    }
}
