//! What a simulation was made with: `truth.json`.

use super::atomic::{WriteError, write_json};
use super::provenance::Provenance;
use crate::nuisances::LineAndContinuum;
use crate::objective::ParameterValues;
use serde::Serialize;
use std::path::Path;

/// The content of `truth.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Truth {
    /// The parameters as simulated.
    pub parameters: ParameterValues,
    /// The spots: longitude, latitude and radius in degrees, filling factor.
    pub spots: serde_json::Value,
    /// What is wrong with each profile by itself, in line and continuum.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub continuum: Vec<LineAndContinuum>,
    /// Fractional spot coverage.
    pub spottedness: f64,
    /// Signal-to-noise ratio of each bin; null for no noise.
    pub snr: Option<f64>,
    /// Standard error written with each bin, in units of the continuum.
    pub sigma: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// Pixels of the simulated star.
    pub pixels: usize,
    /// Times of the profiles (d).
    pub times_d: Vec<f64>,
    /// Velocity of the orbit at each of them, plus the systemic velocity (km/s).
    pub orbit_kms: Vec<f64>,
    /// Where all this came from.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// Writes `truth.json` into `folder`.
///
/// # Errors
/// A file that cannot be written.
pub fn write(folder: &Path, truth: &Truth) -> Result<(), WriteError> {
    write_json(&folder.join("truth.json"), truth)
}
