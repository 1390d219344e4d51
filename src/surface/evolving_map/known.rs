//! Prior knowledge of the field, and the bounds of its free parameters.

use super::{Assumed, Marginal};
use crate::field::{Field, Kernel, Lifetime, Spectrum};
use crate::model::{Parameter, Prior};
use crate::numerics::json::is_zero;
use crate::planets::periodogram::ln_prior;
use serde::{Deserialize, Serialize};

/// Bounds of amplitude, slope and lifetime (d).
pub(super) const BOUNDS: [(f64, f64); 3] =
    [Parameter::FIELD[0].widest(), Parameter::FIELD[1].widest(), Parameter::FIELD[2].widest()];

/// Usual starts of searches.
pub(super) const USUAL: [f64; 3] =
    [Parameter::FIELD[0].usual(), Parameter::FIELD[1].usual(), Parameter::FIELD[2].usual()];

/// An amplitude has a half-normal prior of this standard deviation, unless a config gives another one: no star is
/// covered so much, and apparent spots beyond it mimic other effects.
pub const LARGEST_AMPLITUDE: f64 = 1.0;

/// Degree below which the spectrum of spots is flat: spots of 10 to 25 deg.
const BREAK_DEGREE: f64 = 7.0;

/// Prior knowledge of the field; parameters that are `None` are fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// Standard deviation of the filling factor.
    pub amplitude: Option<f64>,
    /// Slope of the spectrum.
    pub slope: Option<f64>,
    /// Degree below which the spectrum is flat; if neither it nor the slope is known, a fit takes the better one of 0
    /// and 7.
    pub break_degree: Option<f64>,
    /// Lifetime.
    pub lifetime: Option<Lifetime>,
    /// Velocity jitter (km/s).
    pub jitter_kms: Option<f64>,
    /// RV offsets of nights (km/s), in data sets where their size is not given.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub night_kms: f64,
    /// RV stability of the spectrograph (km/s), where it is known: scale of the prior of the jitter. Without it the
    /// prior is uniform, as the jitter also takes up what the surface lacks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability_kms: Option<f64>,
    /// Priors of amplitude, slope and lifetime (d) where they are fitted; without one they are uniform between the
    /// bounds in ln amplitude, up to usual ones, slope and ln lifetime.
    pub priors: [Option<Prior>; 3],
    /// Start of a fit: a field that was found with coarser maps, instead of several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<FieldStart>,
}

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
    fn from(Assumed { field: Field { spectrum, kernel }, jitter_kms, .. }: Assumed) -> Self {
        FieldStart {
            spot_amplitude: spectrum.amplitude,
            spot_slope: spectrum.slope,
            spot_break_degree: spectrum.break_degree,
            spot_lifetime_d: kernel.lifetime.days(),
            velocity_jitter_kms: jitter_kms,
        }
    }
}

impl Known {
    /// All values as fitted, for a spectrograph of that stability (km/s).
    pub fn of(marginal: &Marginal, stability_kms: Option<f64>) -> Self {
        let Assumed { field, jitter_kms, night_kms } = marginal.assumed;
        Known {
            amplitude: Some(field.spectrum.amplitude),
            slope: Some(field.spectrum.slope),
            break_degree: Some(field.spectrum.break_degree),
            lifetime: Some(field.kernel.lifetime),
            jitter_kms: Some(jitter_kms),
            night_kms,
            stability_kms,
            priors: [None; 3],
            start: None,
        }
    }

    /// The start of a fit, unless there are several, with the known values.
    pub(super) fn begin(&self) -> Option<Assumed> {
        let start = self.start?;
        let spectrum = Spectrum {
            amplitude: self.amplitude.unwrap_or(self.within(0, start.spot_amplitude)),
            slope: self.slope.unwrap_or(self.within(1, start.spot_slope)),
            break_degree: self.break_degree.unwrap_or(start.spot_break_degree),
        };
        let lifetime = match self.lifetime {
            Some(lifetime) => lifetime,
            None => Lifetime::Days(self.within(2, start.spot_lifetime_d?)),
        };
        let field = Field { spectrum, kernel: Kernel::of(lifetime) };
        Some(self.assumed(field, start.velocity_jitter_kms))
    }

    /// Such a field with the known noise, with this jitter (km/s) where it is not known.
    pub(super) fn assumed(&self, field: Field, jitter_kms: f64) -> Assumed {
        Assumed { field, jitter_kms: self.jitter_kms.unwrap_or(jitter_kms), night_kms: self.night_kms }
    }

    /// Degree below which the spectrum is flat at the start of a search: a given slope means a pure power law, unless a
    /// break is given, too.
    pub fn break_degree(&self) -> f64 {
        self.break_degree.unwrap_or(if self.slope.is_some() { 0.0 } else { BREAK_DEGREE })
    }

    /// The spectrum at the start of a search.
    pub(super) fn spectrum(&self) -> Spectrum {
        let usual = |i: usize| self.within(i, USUAL[i]);
        Spectrum {
            amplitude: self.amplitude.unwrap_or(usual(0)),
            slope: self.slope.unwrap_or(usual(1)),
            break_degree: self.break_degree(),
        }
    }

    /// Bounds of amplitude, slope or lifetime: those of their prior, where there is one.
    pub(super) fn bounds(&self, i: usize) -> (f64, f64) {
        let (low, high) = BOUNDS[i];
        let (least, most) = self.priors[i].map_or(BOUNDS[i], |prior| prior.bounds());
        (low.max(least), high.min(most))
    }

    pub(super) fn within(&self, i: usize, x: f64) -> f64 {
        let (low, high) = self.bounds(i);
        x.clamp(low, high)
    }

    /// ln of the prior density in the coordinates of [`place`].
    fn log_prior(&self, assumed: &Assumed) -> f64 {
        let Field { spectrum, kernel } = assumed.field;
        let numbers = [Some(spectrum.amplitude), Some(spectrum.slope), kernel.lifetime.days()];
        let of = |i: usize| {
            let (prior, x) = (self.priors[i]?, numbers[i]?);
            self.free(assumed)[i].then(|| prior.log_density(x) + Parameter::FIELD[i].log_jacobian(x))
        };
        let usual = match self.priors[0] {
            None if self.amplitude.is_none() => -0.5 * (spectrum.amplitude / LARGEST_AMPLITUDE).powi(2),
            _ => 0.0,
        };
        let jitter = match self.jitter_kms {
            None => self.stability_kms.map_or(0.0, |scale| ln_prior(assumed.jitter_kms, scale)),
            Some(_) => 0.0,
        };
        (0..3).filter_map(of).sum::<f64>() + usual + jitter
    }

    /// The objective: ln Z, and the prior of the field.
    pub(super) fn height(&self, of: &Marginal) -> f64 {
        of.ln_evidence() + self.log_prior(&of.assumed)
    }

    /// The same for a static map.
    pub fn unchanging(self) -> Self {
        Known { lifetime: Some(Lifetime::Static), ..self }
    }

    /// Whether any parameter is fitted.
    pub(super) fn is_open(&self) -> bool {
        let open = [self.amplitude.is_none(), self.slope.is_none(), self.lifetime.is_none(), self.jitter_kms.is_none()];
        open.contains(&true)
    }

    /// Which of amplitude, slope, lifetime and jitter are fitted.
    pub(super) fn free(&self, assumed: &Assumed) -> [bool; 4] {
        let lives = self.lifetime.is_none() && assumed.field.kernel.lifetime != Lifetime::Static;
        let jitters = self.jitter_kms.is_none() && assumed.jitter_kms > 0.0;
        [self.amplitude.is_none(), self.slope.is_none(), lives, jitters]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A jitter takes up what the surface lacks, unless the spectrograph is known to be stable.
    #[test]
    fn a_jitter_has_a_prior_where_the_spectrograph_is_known() {
        let kernel = Kernel::of(Lifetime::Static);
        let spectrum = Spectrum { amplitude: 0.2, slope: 1.0, break_degree: 0.0 };
        let of = |known: Known| {
            let height = |jitter_kms| {
                known.log_prior(&Assumed { field: Field { spectrum, kernel }, jitter_kms, night_kms: 0.0 })
            };
            height(0.06) - height(0.0)
        };
        assert_eq!(of(Known::default()), 0.0);
        assert!((of(Known { stability_kms: Some(0.03), ..Known::default() }) + 5f64.ln()).abs() < 1e-12);
    }
}
