//! `photometry`: light curves as users write them. Doc comments here are the descriptions of the JSON Schema.

use super::listed::Section;
use super::observations::{default_seed, is_one, one};
use super::star::LimbDarkeningSection;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A light curve: either `path` or `simulate`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhotometrySection {
    /// Name of the light curve, in results, and of the file that `dimcmc simulate` writes it to: letters, digits, `-`,
    /// `_` and `.`. "photometry" if not given, of several "photometry1", "photometry2", ...
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// A text table, relative to the folder of this config, with a header: time (d), flux (or magnitude) and its
    /// uncertainty, as `time,flux,sigma` or other usual names, such as BTJD, PDCSAP_FLUX, mag_err. Times are in the
    /// system of the profiles, unless the column name gives another. Transits must be cut out, here or by `exclude`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Brightness of a spot over that of the photosphere in this band, from 0 and below 1; that of the star if not
    /// given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast: Option<f64>,
    /// Wavelength (nm) of this band, at which the star's temperatures give the brightness of a spot: about 790 for
    /// TESS, 640 for Kepler.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelength_nm: Option<f64>,
    /// Limb darkening in this band; that of the star if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limb_darkening: Option<LimbDarkeningSection>,
    /// A gap longer than this (d), from 0 to 1000, begins a new segment. Each segment has its own level and slope,
    /// which are marginalised over. Nights must not be segments.
    #[serde(default = "default_gap_d")]
    pub segment_gap_d: f64,
    /// Factor on the standard errors, above 0.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub sigma_scale: f64,
    /// Windows of time `[start, end]` (d) whose measurements are left out: transits, flares.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<[f64; 2]>,
    /// Treatment of outliers: measurements more than 5 standard deviations from their neighbours within 1/12 of a
    /// rotation, and flares. Dips of three points and more are kept.
    #[serde(default, skip_serializing_if = "OutlierTreatment::is_default")]
    pub outliers: OutlierTreatment,
    /// A simulated light curve of the star that `observations.simulate` has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulate: Option<SimulatedLight>,
}

/// Treatment of outliers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OutlierTreatment {
    /// Outliers are rejected, counted and named.
    #[default]
    LeaveOut,
    /// Outliers are kept.
    Keep,
}

impl OutlierTreatment {
    fn is_default(&self) -> bool {
        *self == OutlierTreatment::default()
    }
}

/// A simulated light curve, from the first profile to the last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulatedLight {
    /// Time between measurements (d), above 0.
    pub cadence_d: f64,
    /// Standard error of a measurement, in units of the flux of the bare photosphere, above 0.
    pub sigma: f64,
    /// Seed of the noise.
    #[serde(default = "default_seed")]
    pub seed: u64,
}

impl Section for PhotometrySection {
    const KEY: &'static str = "photometry";
    const SCHEMA: [&'static str; 2] = ["Photometry", "One light curve, or a list of several of one star."];
    const EMPTY: &'static str = "the list is empty, leave photometry out where there is none";
}

/// A longer gap (d) begins a new segment, unless the config has another number.
pub const SEGMENT_GAP_D: f64 = 3.0;

fn default_gap_d() -> f64 {
    SEGMENT_GAP_D
}
