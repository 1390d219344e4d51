//! What a simulation, or an injection into observed profiles, was made with: `truth.json`.

use super::atomic::{WriteError, write_json};
use super::provenance::Provenance;
use super::saved::{Saved, as_many};
use crate::model::ParameterValues;
use crate::star::Orbit;
use crate::surface::nuisances::LineAndContinuum;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the file.
pub const FILE: &str = "truth.json";

/// The content of `truth.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The parameters as simulated.
    pub parameters: ParameterValues,
    /// The spots as a config lists them, drawn ones behind listed ones: longitude, latitude and radius in degrees,
    /// filling factor; of those that come and go the time of the largest area and the lifetime (d).
    pub spots: Vec<Vec<f64>>,
    /// The faculae, if there are any: longitude, latitude and radius in degrees, excess of brightness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faculae: Option<serde_json::Value>,
    /// Beside faculae: brightness of a spot over that of the photosphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast: Option<f64>,
    /// What is wrong with each profile by itself, in line and continuum.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub continuum: Vec<LineAndContinuum>,
    /// The velocity zero point of each profile (km/s), which is not part of `orbit_kms`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zero_points_kms: Vec<f64>,
    /// The zero point of the whole data set (km/s), which is not part of `orbit_kms` either; if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_point_kms: Option<f64>,
    /// Over how many bins the noise is correlated, where it is not white.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlated_bins: Option<f64>,
    /// Fractional spot coverage; of a star that changes, the mean over the profiles.
    pub spottedness: f64,
    /// That at each of `times_d`, of a star that changes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coverage: Vec<f64>,
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

/// The content of `truth.json` beside profiles that an orbit was put into.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InjectedTruth {
    /// The orbit, by the names of its parameters.
    pub injected: Orbit,
    /// What the profiles held before, where they are simulated.
    pub before: Option<ParameterValues>,
    /// Times of the profiles (d).
    pub times_d: Vec<f64>,
    /// By how much each was shifted (km/s).
    pub velocity_kms: Vec<f64>,
    /// The observations and the config before.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// The content of a `truth.json`, whichever it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum TruthFile {
    /// Of a simulation.
    Simulated(Truth),
    /// Of observed profiles that an orbit was put into.
    Injected(InjectedTruth),
}

impl Saved for TruthFile {
    fn check(&self) -> Result<(), String> {
        let times = self.times_d().len();
        let count = |key: &str, found: usize| as_many(key, found, times, "times_d");
        match self {
            TruthFile::Injected(truth) => count("velocity_kms", truth.velocity_kms.len()),
            TruthFile::Simulated(truth) => {
                let some = |key: &str, found: usize| if found == 0 { Ok(()) } else { count(key, found) };
                some("continuum", truth.continuum.len())?;
                some("zero_points_kms", truth.zero_points_kms.len())?;
                some("coverage", truth.coverage.len())?;
                count("orbit_kms", truth.orbit_kms.len())
            }
        }
    }
}

impl TruthFile {
    /// Times of the profiles (d).
    pub fn times_d(&self) -> &[f64] {
        match self {
            TruthFile::Simulated(truth) => &truth.times_d,
            TruthFile::Injected(truth) => &truth.times_d,
        }
    }

    /// Config, data and program.
    pub fn provenance(&self) -> &Provenance {
        match self {
            TruthFile::Simulated(truth) => &truth.provenance,
            TruthFile::Injected(truth) => &truth.provenance,
        }
    }
}

/// Writes `truth.json` into `folder`: a [`Truth`] or an [`InjectedTruth`].
///
/// # Errors
/// A file that cannot be written.
pub fn write(folder: &Path, truth: &impl Serialize) -> Result<(), WriteError> {
    write_json(&folder.join(FILE), truth)
}
