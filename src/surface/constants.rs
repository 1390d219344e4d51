//! The velocities that profiles have in common: the systemic velocity, and the RV offsets of data sets. Their errors
//! are those with all that is free: spots, jitter, each other, and the orbit that is reported.

use super::Linearised;
use super::expansion::Nuisance;
use super::imaging::{Drift, Imager};
use crate::model::Parameter;
use crate::planets::periodogram::Peak;
use crate::planets::periodogram::offset::{Common, common_velocities};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// A velocity with its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConstantVelocity {
    /// The velocity (km/s).
    pub value_kms: f64,
    /// Its standard error (km/s).
    pub sigma_kms: f64,
}

/// A drift of the velocities: its slope in the middle of the data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundDrift {
    /// The slope (km/s per day).
    pub kms_d: f64,
    /// Its standard error (km/s per day).
    pub sigma_kms_d: f64,
}

/// A drift of so many standard errors is one.
const SIGNIFICANT: f64 = 4.0;

impl FoundDrift {
    /// It in words.
    pub fn line(&self) -> String {
        let FoundDrift { kms_d, sigma_kms_d } = self;
        let m_s = |kms: f64| format!("{:.1}", 1000.0 * kms);
        let of = format!("RV drift: {} ± {} m/s/d", m_s(*kms_d), m_s(*sigma_kms_d));
        match kms_d.abs() > SIGNIFICANT * sigma_kms_d {
            true => {
                let sigmas = kms_d.abs() / sigma_kms_d;
                format!("{of} ({sigmas:.0}σ): a long-period companion or instrumental drift")
            }
            false => of,
        }
    }
}

/// Velocities that profiles have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Constants {
    /// Systemic velocity, where it is free.
    pub systemic: Option<ConstantVelocity>,
    /// RV offsets of those data sets whose offset is fitted, in the order of the sets.
    pub offsets: Vec<ConstantVelocity>,
    /// Drift of the velocities, where one is integrated out.
    pub drift: Option<FoundDrift>,
    /// What offsets and systemic velocity add to the velocity of each profile in [`Linearised::held`] (km/s).
    pub of_each_kms: DVector<f64>,
}

impl Linearised {
    /// The velocities that profiles of `imager` have in common, beside the orbit of the `peak`, with its amplitude,
    /// phase and period free, or beside no orbit. The systemic velocity is free if it is among the `nuisances`. `None`
    /// where they are not bounded.
    pub fn constants(&self, imager: &Imager, nuisances: &[Nuisance], peak: Option<&Peak>) -> Option<Constants> {
        let n = self.held.len();
        let vsys_kms = self.expansion.values[Parameter::Vsys];
        let systemic = nuisances.iter().find(|nuisance| nuisance.parameter == Parameter::Vsys);
        let systemic = systemic.map(|prior| Common {
            of_each: DVector::from_element(n, 1.0),
            mean_kms: prior.mean - vsys_kms,
            sd_kms: prior.sd,
        });
        let is_free = systemic.is_some();
        let all: Vec<Common> = systemic.into_iter().chain(imager.common_velocities(n)).collect();
        let (values, sigmas) = common_velocities(&self.held, &all, peak)?;
        // from where the expansion holds them
        let centres = is_free.then_some(vsys_kms).into_iter().chain(imager.zero_points.iter().map(|z| z.held_kms()));
        let found = centres.zip(values.iter().zip(&sigmas));
        let mut found = found.map(|(at, (value, sigma))| ConstantVelocity { value_kms: at + value, sigma_kms: *sigma });
        let of_each = |sum: DVector<f64>, (common, value): (&Common, &f64)| sum + *value * &common.of_each;
        let constant = usize::from(is_free) + imager.zero_points.len();
        let drift = imager.drift.map(|Drift { half_span_d, .. }| {
            let [value_kms, sigma_kms] = [values[constant], sigmas[constant]];
            FoundDrift { kms_d: value_kms / half_span_d, sigma_kms_d: sigma_kms / half_span_d }
        });
        Some(Constants {
            systemic: if is_free { found.next() } else { None },
            offsets: found.collect(),
            drift,
            of_each_kms: all[..constant].iter().zip(&values).fold(DVector::zeros(n), of_each),
        })
    }
}
