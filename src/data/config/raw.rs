//! The config as users write it: names, units and defaults. Doc comments here are the descriptions of the JSON Schema.
//!
//! Sections of their own are in `star`, `data_sets`, `photometry` and `raw_parts`.

use super::data_sets::DataSets;
use super::listed::Listed;
use super::photometry::PhotometrySection;
use super::raw_parts::{Grid, PerParameter, PlanSection, PriorSection};
use super::star::{Instrument, Star};
use super::{ImagingSettings, SamplerSettings};
use crate::model::Parameter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Configuration of dimcmc: a star, its observations (or how to simulate them), and what is to be inferred.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "dimcmc configuration")]
pub(super) struct Config {
    /// Where the JSON Schema is, for editors. Ignored by the program.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// The star.
    pub star: Star,
    /// The spectrograph.
    #[serde(default)]
    pub instrument: Instrument,
    /// The planet; without it there is none (K = 0). Where a parameter is free, this is the start.
    #[serde(default)]
    pub planet: Planet,
    /// The line profiles, observed or simulated: either `path` or `simulate`; or a list of data sets, each with its
    /// own.
    pub observations: DataSets,
    /// Light curves of the star, with objective "marginal-likelihood": one, or a list.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photometry: Option<Listed<PhotometrySection>>,
    /// What is planned beside the observations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<PlanSection>,
    /// The Doppler image.
    #[serde(default)]
    pub imaging: ImagingSettings,
    /// The free parameters with their priors; all others are fixed at the values under `star` and `planet`.
    #[serde(default)]
    pub parameters: PerParameter<PriorSection>,
    /// The chain.
    #[serde(default)]
    pub sampler: SamplerSettings,
    /// The landscape that `dimcmc grid` computes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<Grid>,
}

/// Period over rotation period where none is given.
pub(super) const DEFAULT_PORB_OVER_PROT: f64 = 2.0;

/// The planet's orbit, and that of a second planet if there is one; circles unless told otherwise. Where a parameter is
/// free, its value here is the start.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Planet {
    /// Semi-amplitude of the star's radial velocity (km/s), 0 or more.
    pub k_kms: f64,
    /// Orbital period over the rotation period, above 0.
    pub porb_over_prot: f64,
    /// Orbital phase (cycles, 0 to 1): the part of an orbit from `star.epoch_d` (rotation cycle 0) to the next maximum
    /// of the star's radial velocity. `phi` = 0 is a maximum at `star.epoch_d`.
    pub phi: f64,
    /// Orbital period (d), above 0, in place of `porb_over_prot`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_d: Option<f64>,
    /// Time of an inferior conjunction (planet in front; d, on the time scale of the observations), in place of `phi`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_conjunction_d: Option<f64>,
    /// Square root of the eccentricity e times the cosine of the argument of periastron omega of the star's orbit; a
    /// circle if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e_cos_omega: Option<f64>,
    /// The same with the sine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e_sin_omega: Option<f64>,
    /// Semi-amplitude of the star's radial velocity by a second planet (km/s), 0 or more; without any key of its there
    /// is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k2_kms: Option<f64>,
    /// Orbital period of the second planet over the rotation period, above 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub porb2_over_prot: Option<f64>,
    /// Orbital period of the second planet (d), in place of `porb2_over_prot`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period2_d: Option<f64>,
    /// Orbital phase of the second planet (cycles), as `phi`; 0 if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phi2: Option<f64>,
    /// Time of an inferior conjunction of the second planet (d), in place of `phi2`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_conjunction2_d: Option<f64>,
    /// Of the second planet's orbit, as `sqrt_e_cos_omega`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e2_cos_omega2: Option<f64>,
    /// Of the second planet's orbit, as `sqrt_e_sin_omega`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e2_sin_omega2: Option<f64>,
}

impl Planet {
    /// A value that may be left out.
    pub fn given(&self, parameter: Parameter) -> Option<f64> {
        match parameter {
            Parameter::Period => self.period_d,
            Parameter::Conjunction => self.t_conjunction_d,
            Parameter::SqrtECosOmega => self.sqrt_e_cos_omega,
            Parameter::SqrtESinOmega => self.sqrt_e_sin_omega,
            Parameter::K2 => self.k2_kms,
            Parameter::PorbOverProt2 => self.porb2_over_prot,
            Parameter::Period2 => self.period2_d,
            Parameter::Phi2 => self.phi2,
            Parameter::Conjunction2 => self.t_conjunction2_d,
            Parameter::SqrtECosOmega2 => self.sqrt_e2_cos_omega2,
            Parameter::SqrtESinOmega2 => self.sqrt_e2_sin_omega2,
            _ => None,
        }
    }
}

impl Default for Planet {
    fn default() -> Self {
        Planet {
            k_kms: 0.0,
            porb_over_prot: DEFAULT_PORB_OVER_PROT,
            phi: 0.0,
            period_d: None,
            t_conjunction_d: None,
            sqrt_e_cos_omega: None,
            sqrt_e_sin_omega: None,
            k2_kms: None,
            porb2_over_prot: None,
            period2_d: None,
            phi2: None,
            t_conjunction2_d: None,
            sqrt_e2_cos_omega2: None,
            sqrt_e2_sin_omega2: None,
        }
    }
}
