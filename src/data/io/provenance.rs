//! What every result says of where it came from.

use crate::posterior::noise::MeasuredErrors;
use crate::posterior::objective::target::ChosenTarget;
use crate::posterior::zero_points::MeasuredJitter;
use serde::{Deserialize, Serialize};

/// Config, data and program that made a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// SHA-256 (hex) of the part of the config that decides the posterior and the chain.
    pub config_sha256: String,
    /// The config with all defaults filled in.
    pub config: serde_json::Value,
    /// What the config leaves to the observations.
    #[serde(default, skip_serializing_if = "Measured::is_empty")]
    pub measured: Measured,
}

/// Settings that were taken from the observations before anything else, and what was made of these.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// What was made of the profiles on reading.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profiles: Vec<String>,
    /// `observations.sigma_scale` and `.weights`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors: Option<MeasuredErrors>,
    /// `observations.velocity_jitter_kms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_jitter: Option<MeasuredJitter>,
    /// `imaging.chi2_target`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chi2_target: Option<ChosenTarget>,
}

impl Measured {
    /// Whether the config leaves nothing to the observations.
    pub fn is_empty(&self) -> bool {
        *self == Measured::default()
    }

    /// That the model does not fit as well as the continuum promises, where the errors say so.
    pub fn misfit_text(&self) -> Option<String> {
        self.errors.as_ref().and_then(MeasuredErrors::misfit_text)
    }

    /// It in words, label and text a line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let profiles = self.profiles.iter().map(|remark| ("profiles", remark.clone()));
        let errors = self.errors.as_ref().map(|errors| ("errors", errors.line()));
        let target = self.chi2_target.as_ref().map(|target| ("target chi2", target.line()));
        let jitter = self.velocity_jitter.as_ref().map(|jitter| ("velocity jitter", jitter.line()));
        profiles.chain(errors).chain(jitter).chain(target).collect()
    }
}
