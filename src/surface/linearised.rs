//! The results of every surface model at one point of parameter space, and its errors.

use super::evolving_map::{LARGEST_AMPLITUDE, NoFit};
use super::expansion::Expansion;
use super::static_map::ReferenceError;
use crate::field::FieldError;
use crate::model::Parameter;
use crate::numerics::json::is_zero;
use crate::planets::periodogram::nights::{Nights, beside_offsets, beside_offsets_of, most_likely, with_noise};
use crate::planets::periodogram::{CircularOrbit, Jitters, Scatter, Unbounded};
use crate::planets::speeds::with_unit;
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::{Remark, decimals};
use crate::star::observation::RadialVelocity;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::sync::Arc;

/// A star with its spots, and the quadratic in its profiles' velocities around it.
#[derive(Clone, Debug)]
pub struct Linearised {
    /// ln L around it.
    pub expansion: Expansion,
    /// ln L of the orbit's velocities, relative to 0 whatever the orbit at the centre; unresolved spots count as noise.
    pub quadratic: VelocityQuadratic,
    /// The same with the systemic velocity and the RV offsets of data sets held that are otherwise marginalised over:
    /// for tables of velocities with individual uncertainties, and for [`Constants`](super::Constants).
    pub held: VelocityQuadratic,
    /// The same without that noise.
    pub regularised: VelocityQuadratic,
    /// Size of the unresolved spots relative to the model's expectation, in variance.
    pub unresolved_spots: f64,
    /// Whether the maps reach the target chi2; true where there is none.
    pub on_target: bool,
    /// The field of spots, if the model has one.
    pub field: Option<SpotField>,
    /// The internal result of the model.
    pub(super) solution: Arc<dyn Any + Send + Sync>,
}

impl Linearised {
    /// The internal result of the model, of a known type.
    pub(super) fn kept<T: 'static>(&self) -> &T {
        self.solution.downcast_ref().expect("of the model that is asked")
    }

    /// The internal result of the model, if it has that type.
    pub fn solution<T: 'static>(&self) -> Option<&T> {
        self.solution.downcast_ref()
    }
}

/// A star without its RV jitter and RV offsets of nights, which the profiles constrain.
#[derive(Clone, Debug)]
pub struct WithoutJitter {
    /// The star with its spots, without jitter and offsets.
    pub here: Linearised,
    /// The jitter that was found, with the offsets in quadrature (km/s); 0 where none is needed.
    pub found_kms: f64,
    /// Stability of the spectrograph (km/s).
    pub stability_kms: f64,
    /// Nights with unknown RV offsets, where the profiles distinguish offsets from a jitter.
    pub nights: Option<Nights>,
}

impl WithoutJitter {
    /// The likelihood of these velocities of this star with jitters and night offsets of several sizes.
    pub fn beside(&self, quadratic: &VelocityQuadratic) -> Jitters {
        let jitter = (self.found_kms, self.stability_kms);
        let beside = |nights: &Nights| Some(beside_offsets(quadratic, nights, jitter)?.0);
        self.nights.as_ref().and_then(beside).unwrap_or_else(|| self.beside_jitter(quadratic))
    }

    /// The same for some of the profiles, in their order, with the sizes that are likely in `of_all`.
    pub fn of_some_beside(&self, quadratic: &VelocityQuadratic, of_all: &Jitters) -> Jitters {
        let nights = self.nights.as_ref().map(|nights| nights.of(&quadratic.cycles, &self.here.quadratic.cycles));
        let beside = |nights| beside_offsets_of(of_all, quadratic, &nights, self.stability_kms);
        let jitter_kms = (self.found_kms, of_all.units().jitter_kms);
        nights.and_then(beside).unwrap_or_else(|| Jitters::in_units(quadratic, jitter_kms, self.stability_kms))
    }

    /// The most likely jitter and night offsets of these velocities of this star, in which orbits are left free.
    pub fn noise(&self, velocities: &VelocityQuadratic) -> Option<Scatter> {
        most_likely(velocities, self.nights.as_ref()?, (self.found_kms, self.stability_kms))
    }

    /// The likelihood of these velocities of this star with that noise.
    pub fn with_noise(&self, velocities: &VelocityQuadratic, noise: Scatter) -> Option<VelocityQuadratic> {
        with_noise(velocities, self.nights.as_ref()?, noise)
    }

    /// With the jitter that was found, and parts of it, only: none where none was found.
    pub fn beside_found(&self, quadratic: &VelocityQuadratic) -> Jitters {
        match self.found_kms > 0.0 {
            true => Jitters::in_units(quadratic, (self.found_kms, self.found_kms), self.stability_kms),
            false => Jitters::none(quadratic),
        }
    }

    /// With jitters of several sizes only.
    pub fn beside_jitter(&self, quadratic: &VelocityQuadratic) -> Jitters {
        Jitters::new(quadratic, self.found_kms, self.stability_kms)
    }
}

/// Spots as a Gaussian field on the sphere and in time, with the most probable parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpotField {
    /// Standard deviation of the filling factor.
    pub spot_amplitude: f64,
    /// Slope of its spectrum.
    pub spot_slope: f64,
    /// Degree below which the spectrum is flat.
    #[serde(default)]
    pub spot_break_degree: f64,
    /// Lifetime (d); null for static spots.
    pub spot_lifetime_d: Option<f64>,
    /// Velocity jitter (km/s).
    pub velocity_jitter_kms: f64,
    /// RV offsets of nights, where they are fitted and needed: their standard deviation (km/s).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub night_offsets_kms: f64,
    /// ln Z.
    pub ln_evidence: f64,
    /// Names of those that lie on a bound of the search.
    pub at_bounds: Vec<String>,
    /// Their uncertainties, where they were requested.
    #[serde(flatten)]
    pub errors: FieldErrors,
}

/// Uncertainties of a logarithm beyond this are printed as asymmetric ones of the value.
const UNEVEN: f64 = 0.25;

/// Standard errors of a field, the jitter held; for amplitude and lifetime those of their logarithms, times the value;
/// `None` for given, bounded or unconstrained parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FieldErrors {
    /// Of the standard deviation of the filling factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_spot_amplitude: Option<f64>,
    /// Of the slope of its spectrum.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_spot_slope: Option<f64>,
    /// Of the lifetime (d).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_spot_lifetime_d: Option<f64>,
    /// Names of unconstrained parameters among the three.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unconstrained: Vec<String>,
}

/// A value with its uncertainty to two digits of that, without one to these decimals.
fn with_error(value: f64, sigma: Option<f64>, digits: usize) -> String {
    match sigma {
        Some(sigma) => format!("{value:.0$} ± {sigma:.0$}", decimals(sigma)),
        None => format!("{value:.digits$}"),
    }
}

/// The same for a positive value whose logarithm is known: with two uncertainties where these differ.
fn with_errors(value: f64, sigma: Option<f64>, digits: usize) -> String {
    match sigma.filter(|sigma| *sigma > UNEVEN * value) {
        Some(sigma) => {
            let factor = (sigma / value).exp();
            let (up, down) = (value * (factor - 1.0), value * (1.0 - factor.recip()));
            format!("{value:.0$} +{up:.0$} -{down:.0$}", decimals(down))
        }
        None => with_error(value, sigma, digits),
    }
}

impl SpotField {
    /// The amplitude with its uncertainties, where these are known.
    pub fn amplitude(&self) -> String {
        with_errors(self.spot_amplitude, self.errors.sigma_spot_amplitude, 3)
    }

    /// The slope of the spectrum with its uncertainty, where that is known.
    pub fn slope(&self) -> String {
        with_error(self.spot_slope, self.errors.sigma_spot_slope, 2)
    }

    /// The lifetime (d) with its uncertainties, where these are known; `None` for static spots.
    pub fn lifetime_d(&self) -> Option<String> {
        let digits = |days: f64| if days < 1.0 { 2 } else { 1 };
        self.spot_lifetime_d.map(|days| with_errors(days, self.errors.sigma_spot_lifetime_d, digits(days)))
    }

    /// The lifetime as text.
    pub fn lifetime(&self) -> String {
        self.lifetime_d().map_or_else(|| "infinite (static)".to_owned(), |days| format!("{days} d"))
    }

    /// The caveat on the parameter of that name.
    pub fn caveat(&self, name: &str) -> Option<&'static str> {
        let among = |names: &[String]| names.iter().any(|of| of == name);
        match (among(&self.at_bounds), among(&self.errors.unconstrained)) {
            (true, _) => Some("at its search bound"),
            (false, true) => Some("not constrained"),
            (false, false) => None,
        }
    }

    /// Shape of the spectrum as text.
    pub fn spectrum(&self) -> &'static str {
        if self.spot_break_degree > 0.0 { "flat at low degrees" } else { "a power law" }
    }

    /// The remark that spots absorb anything, where their lifetime is the shortest of the search, and the possible
    /// cause.
    pub fn absorbs(&self) -> Option<String> {
        let name = Parameter::SpotLifetime.name();
        let lifetime_d = self.spot_lifetime_d.filter(|days| *days < Parameter::SpotLifetime.usual())?;
        self.at_bounds.iter().any(|reached| reached == name).then(|| {
            format!(
                "{name} is at its lower search bound, {lifetime_d:.2} d: maps that vary between profiles absorb any \
                signal, planets included. Likely causes: star.rotation_period_d; underestimated uncertainties \
                (observations.sigma_scale: \"auto\"); a variable continuum or line (imaging.nuisances)"
            )
        })
    }

    /// The remark that spots mimic something else, where their amplitude is impossible, and the possible cause.
    pub fn stands_in(&self) -> Option<Remark> {
        let amplitude = self.spot_amplitude;
        (amplitude > LARGEST_AMPLITUDE).then(|| {
            let text = format!(
                "spot_amplitude = {amplitude:.2} is implausibly large: spots mimic an error of the model. Likely \
                causes: star.line, star.vsini_kms or star.vsys_kms (fit them: star.fitted), or \
                observations.sigma_scale"
            );
            Remark::against("implausible spot amplitude", text)
        })
    }

    /// Remarks: bounds that were reached, and impossible spot amplitudes.
    pub fn remarks(&self) -> Vec<Remark> {
        let reached = |name: &String| {
            let is_of = |parameter: Parameter| *name == parameter.name();
            let absorbs = || self.absorbs().filter(|_| is_of(Parameter::SpotLifetime));
            let faint = || {
                let amplitude = self.spot_amplitude;
                (is_of(Parameter::SpotAmplitude) && amplitude < Parameter::SpotAmplitude.usual()).then(|| {
                    format!("The profiles show no spots: spot_amplitude is at its lower search bound, {amplitude:.2}.")
                })
            };
            Remark::note(faint().or_else(absorbs).unwrap_or_else(|| {
                format!("{name} is at its search bound: unconstrained by the data, or the model is misspecified.")
            }))
        };
        self.at_bounds.iter().map(reached).chain(self.stands_in()).collect()
    }

    /// One line of text.
    pub fn line(&self) -> String {
        let jitter = with_unit(self.velocity_jitter_kms);
        let nights = match self.night_offsets_kms {
            0.0 => String::new(),
            kms => format!(", RV offsets of nights {}", with_unit(kms)),
        };
        let (amplitude, slope, lifetime) = (self.amplitude(), self.slope(), self.lifetime());
        format!(
            "spots (marginalised): amplitude {amplitude}, power-law index {slope} ({}), \
            lifetime {lifetime}; RV jitter {jitter}{nights}\n",
            self.spectrum()
        )
    }
}

/// The orbit at one target of chi2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtTarget {
    /// Requested chi2 per datum.
    pub chi2_target: f64,
    /// Whether the image reaches it before noise is turned into spots.
    pub on_target: bool,
    /// The orbit; `None` where none is bounded, or without an image.
    pub orbit: Option<CircularOrbit>,
}

/// The profiles with the model of the most probable maps.
#[derive(Clone, Debug)]
pub struct Explained {
    /// Radial velocities, one per profile.
    pub velocities: Vec<FilteredVelocity>,
    /// chi2 over the number of data.
    pub chi2_per_datum: f64,
    /// Deviations of the residuals from noise.
    pub misfit: Vec<String>,
}

/// The first moment of one profile, observed and modelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteredVelocity {
    /// Time (d).
    pub time_d: f64,
    /// Rotation cycle.
    pub cycle: f64,
    /// First moment of the observed profile.
    pub observed: RadialVelocity,
    /// First moment of the model profile (km/s): spots, orbit and systemic velocity.
    pub modelled_kms: f64,
    /// Velocity of the assumed orbit, plus the systemic velocity (km/s).
    pub orbit_kms: f64,
}

impl FilteredVelocity {
    /// Observed minus modelled (km/s).
    pub fn filtered_kms(&self) -> f64 {
        self.observed.value_kms - self.modelled_kms
    }
}

/// Errors of a surface model.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// No image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No orbit at all.
    #[error(transparent)]
    Unbounded(#[from] Unbounded),
    /// No field.
    #[error(transparent)]
    Field(#[from] NoFit),
}

impl From<FieldError> for SurfaceError {
    fn from(error: FieldError) -> Self {
        SurfaceError::Field(error.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spots_that_live_as_short_as_they_may_absorb_anything() {
        let name = Parameter::SpotLifetime.name().to_owned();
        let field = |days: Option<f64>, at_bounds: Vec<String>| SpotField {
            spot_amplitude: 0.2,
            spot_slope: 1.0,
            spot_break_degree: 7.0,
            spot_lifetime_d: days,
            velocity_jitter_kms: 0.0,
            night_offsets_kms: 0.0,
            ln_evidence: 0.0,
            at_bounds,
            errors: FieldErrors::default(),
        };
        let shortest = field(Some(0.3), vec![name.clone()]).absorbs().unwrap();
        assert!(shortest.contains("0.30 d") && shortest.contains("star.rotation_period_d"), "{shortest}");
        assert_eq!(field(Some(3000.0), vec![name]).absorbs(), None, "the longest");
        assert_eq!(field(Some(0.3), Vec::new()).absorbs(), None, "within the bounds");
        assert_eq!(field(None, Vec::new()).absorbs(), None, "for ever");
    }
}
