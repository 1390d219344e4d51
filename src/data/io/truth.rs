//! The inputs of a simulation, or of an injection into observed profiles: `truth.json`.

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
    /// filling factor; for evolving spots also the time of the largest area and the lifetime (d).
    pub spots: Vec<Vec<f64>>,
    /// The faculae, if there are any: longitude, latitude and radius in degrees, excess of brightness.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub faculae: Option<serde_json::Value>,
    /// With faculae: brightness of a spot over that of the photosphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast: Option<f64>,
    /// Errors of line and continuum of each profile.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub continuum: Vec<LineAndContinuum>,
    /// The RV jitter of each profile (km/s), which is not part of `orbit_kms`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zero_points_kms: Vec<f64>,
    /// The RV offset of the data set (km/s), if there is one; not part of `orbit_kms` either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_point_kms: Option<f64>,
    /// Correlation length of the noise in bins, where it is not white.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlated_bins: Option<f64>,
    /// Fractional spot coverage; for evolving spots the mean over the profiles.
    pub spottedness: f64,
    /// That at each of `times_d`, for evolving spots.
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
    /// Provenance.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// The content of `truth.json` of profiles with an injected orbit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct InjectedTruth {
    /// The orbit, by the names of its parameters.
    pub injected: Orbit,
    /// The truth of the profiles before injection, where they are simulated.
    pub before: Option<ParameterValues>,
    /// Times of the profiles (d).
    pub times_d: Vec<f64>,
    /// The shift of each (km/s).
    pub velocity_kms: Vec<f64>,
    /// The observations and the config before injection.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// The content of a `truth.json`, of either kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum TruthFile {
    /// Of a simulation.
    Simulated(Truth),
    /// Of observed profiles with an injected orbit.
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
