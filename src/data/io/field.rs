//! The most probable field of spots, as results hold it.

use crate::field::Field;
use crate::surface::evolving_map::{Assumed, Fitted};
use serde::{Deserialize, Serialize};

/// The most probable field of spots, at the best orbit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldRecord {
    /// Standard deviation of the filling factor.
    pub spot_amplitude: f64,
    /// Slope of its spectrum.
    pub spot_slope: f64,
    /// Degree below which the spectrum is flat.
    #[serde(default)]
    pub spot_break_degree: f64,
    /// Lifetime (d); null for a star that does not change.
    pub spot_lifetime_d: Option<f64>,
    /// Velocity jitter (km/s).
    pub velocity_jitter_kms: f64,
    /// ln Z.
    pub ln_evidence: f64,
    /// Which of them lie on a bound of the search.
    pub at_bounds: Vec<String>,
}

impl FieldRecord {
    /// Of a fit.
    pub fn of(fitted: &Fitted) -> Self {
        let Assumed { field: Field { spectrum, kernel }, jitter_kms } = fitted.marginal.assumed;
        FieldRecord {
            spot_amplitude: spectrum.amplitude,
            spot_slope: spectrum.slope,
            spot_break_degree: spectrum.break_degree,
            spot_lifetime_d: kernel.lifetime.days(),
            velocity_jitter_kms: jitter_kms,
            ln_evidence: fitted.ln_evidence,
            at_bounds: fitted.at_bounds.iter().map(|name| (*name).to_owned()).collect(),
        }
    }

    /// Shape of the spectrum in words.
    pub fn spectrum(&self) -> &'static str {
        if self.spot_break_degree > 0.0 { "flat at low degrees" } else { "a power law" }
    }

    /// It in a line.
    pub fn line(&self) -> String {
        let FieldRecord { spot_amplitude, spot_slope, velocity_jitter_kms, ln_evidence, .. } = self;
        let life = self.spot_lifetime_d.map_or("for ever".to_owned(), |days| format!("{days:.2} d"));
        format!(
            "spots, integrated over: amplitude {spot_amplitude:.3}, slope {spot_slope:.2} ({}), lifetime {life}; \
            velocity jitter {velocity_jitter_kms:.3} km/s; ln of the evidence {ln_evidence:.1}\n",
            self.spectrum()
        )
    }
}
