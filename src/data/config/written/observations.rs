//! `observations` as users write them: one data set, or a list of them. Doc comments here are the descriptions of the
//! JSON Schema.

use super::listed::Section;
use super::number_or::{Automatic, OfStar, VelocityJitter, ZeroPoint};
use super::per_parameter::PerParameter;
use super::star::{LimbDarkeningSection, Line, RegionsSection};
use crate::data::simulate::{RandomSpots, Schedule};
use crate::numerics::json::is_zero;
use crate::surface::calibration::noise::Weights;
use crate::surface::nuisances::LineAndContinuum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

impl Section for ObservationsSection {
    const KEY: &'static str = "observations";
    const SCHEMA: [&'static str; 2] = ["DataSets", "One data set, or a list of several of one star."];
    const EMPTY: &'static str = "the list is empty, one data set at least is needed";
}

/// The line profiles of a data set: either `path` (with its options), or `simulate`.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservationsSection {
    /// Name of the data set, in results, and the folder that `dimcmc simulate` writes it to: letters, digits, `-`, `_`
    /// and `.`. "set1", "set2", ... if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The list of profiles, one `FILE TIME_DAYS [VRAD_KMS]` per line, relative to the folder of this config. Times are
    /// mid-exposure, in days, on one time system (preferably BJD_TDB, optionally with a constant offset). Velocities
    /// are barycentric, in the profiles or after subtraction of VRAD. Uncorrected, the Earth's motion of up to 30 km/s
    /// mimics an orbit. A first line that names the columns may name one of exposure times, `exposure_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Exposure time (s) of the profiles for which the list has none: model profiles are averaged over the rotation in
    /// it, where that moves a feature at the centre of the disc by more than a tenth of a velocity bin. At most a tenth
    /// of a rotation. Simulated profiles are averaged, too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure_s: Option<f64>,
    /// With `path`: first and last velocity used (km/s), after subtraction of VRAD; without it, all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_range_kms: Option<[f64; 2]>,
    /// With `path`: factor on the uncertainties of the profiles, above 0; 1 if not given. "auto": the larger of two
    /// factors, from the rms of the continuum and from the residuals of a map at the config's values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_scale: Option<Automatic>,
    /// With `path`: level of the continuum in the files, from 0.5 to 2; 1 if not given. Intensities and uncertainties
    /// are divided by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub continuum_level: Option<f64>,
    /// With `path`: how the profiles are weighted against each other.
    #[serde(default, skip_serializing_if = "Weights::is_default")]
    pub weights: Weights,
    /// RV jitter (km/s): standard deviation of a Gaussian velocity offset per profile. It should be small compared with
    /// the width of the local line. "fitted": fitted to the profiles, under a static map once at the config's values.
    /// If not given, "fitted" with the objective "marginal-likelihood", 0 with the others. Fitted, all data sets share
    /// one value; a number for each set is taken with the objective "marginal-likelihood".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_jitter_kms: Option<VelocityJitter>,
    /// RV offset that all profiles of one night share: its standard deviation from night to night (km/s), such as the
    /// scatter of nightly means of an RV standard. Marginalised over with objective "marginal-likelihood". If not
    /// given, searches, chains and limits with a fitted RV jitter fit such offsets up to twice the stability of the
    /// spectrograph, and a candidate or known planet that is not significant beside larger ones has a caveat.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub night_jitter_kms: Option<f64>,
    /// Resolving power of this set's spectrograph, in place of `instrument.resolving_power`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolving_power: Option<f64>,
    /// Local line of this set, in place of `star.line`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<Line>,
    /// Wavelength (nm) of this set, at which the temperatures give the brightness of a spot, in place of
    /// `star.wavelength_nm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wavelength_nm: Option<f64>,
    /// Brightness of a spot over that of the photosphere in this set, in place of what the star has. "fitted", for the
    /// second and further sets, with objective "marginal-likelihood": fitted to the profiles, starting from what the
    /// star has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast: Option<OfStar>,
    /// Limb darkening in this set, in place of that of the star.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limb_darkening: Option<LimbDarkeningSection>,
    /// Active regions as this set sees them, in place of `star.regions`. Numbers that are not given are those of a
    /// dimmed photosphere; they are not fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub regions: Option<RegionsSection>,
    /// Line and continuum of each profile of this set, in place of `imaging.nuisances`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nuisances: Option<LineAndContinuum>,
    /// RV offset (km/s) of this set, added to all its profiles; 0 if not given. "fitted", for one of several sets:
    /// marginalised over with a Gaussian prior of 3 km/s around 0; maps hold it at its most probable value.
    #[serde(default, skip_serializing_if = "ZeroPoint::is_default")]
    pub zero_point_kms: ZeroPoint,
    /// With `path`: windows of time `[start, end]` (d), transits for example: profiles within are left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<[f64; 2]>,
    /// Outlier profiles, such as those taken during flares. "fitted" (the default with objective
    /// "marginal-likelihood"): uncertainties of profiles that the others do not predict are multiplied by a fitted
    /// factor. "none": all profiles are treated alike. An object sets single profiles by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub events: Option<EventsKey>,
    /// Simulated profiles of the star and planet of this config. In a list of data sets the first one has the spots.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulate: Option<SimulateSection>,
}

/// Outlier profiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "must be \"fitted\", \"none\", or windows of time {\"include\": [[start, end]], \"exclude\": []}"
)]
pub enum EventsKey {
    /// Whether they are fitted.
    Word(EventsWord),
    /// Fitted, except for profiles in these windows.
    Windows(EventWindows),
}

/// Whether events are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EventsWord {
    /// They are.
    Fitted,
    /// They are not.
    None,
}

/// Windows of time `[start, end]` (d) in which profiles are, or are not, outliers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EventWindows {
    /// Profiles within are outliers: their uncertainties are multiplied by at least 3.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub include: Vec<[f64; 2]>,
    /// Profiles within are never outliers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<[f64; 2]>,
}

/// Simulated profiles.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulateSection {
    /// Hard-edged circular spots `[longitude, latitude, radius, filling]`: degrees, and the filling factor from 0 to 1.
    /// The larger filling counts where they overlap. Two more numbers let a spot come and go, `[longitude, latitude,
    /// radius, filling, peak, lifetime]`: the time of its largest area, when it has that radius and is round, and the
    /// full width at half maximum of its area, which grows linearly and falls again over twice as long (d). Longitudes
    /// are counted at `epoch_d`.
    #[serde(default)]
    #[schemars(inner(length(min = 4, max = 6)))]
    pub spots: Vec<Vec<f64>>,
    /// Spots drawn at random, in addition to the listed ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random_spots: Option<RandomSpots>,
    /// Hard-edged circular faculae `[longitude, latitude, radius, excess]`: degrees, and brightness excess in units of
    /// the photosphere, above 0 and up to 10. Where a spot of filling s overlaps, the excess is multiplied by 1 - s.
    /// The larger excess counts where faculae overlap.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub faculae: Vec<[f64; 4]>,
    /// Rotation cycles of the profiles, counted from `epoch_d`; this or `schedule`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cycles: Option<Vec<f64>>,
    /// Times of the profiles drawn at random, in place of `cycles`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schedule: Option<Schedule>,
    /// Velocity bins.
    pub velocity_kms: VelocitySection,
    /// Signal-to-noise ratio of each bin, above 0; null for no noise (standard errors as for 1000).
    #[serde(default = "default_snr")]
    pub snr: Option<f64>,
    /// Seed of the noise.
    #[serde(default = "default_seed")]
    pub seed: u64,
    /// Pixels of the star that is simulated, 100 to 2,000,000; more than of the image, for honesty.
    #[serde(default = "default_simulation_pixels")]
    pub pixels: usize,
    /// Line and continuum errors per profile, drawn with the same seed; none if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub continuum: Option<ContinuumSection>,
    /// RV jitter (km/s), from 0 to 100: standard deviation of one Gaussian velocity offset per profile, drawn with the
    /// same seed; 0 if not given.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub velocity_jitter_kms: f64,
    /// Velocity (km/s), from -100 to 100, that is added to all profiles; 0 if not given.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub zero_point_kms: f64,
    /// Over how many bins the noise is correlated, from 1 (white noise, if not given) to 1000: c makes correlations of
    /// ((c - 1) / (c + 1))^m at a distance of m bins, which add up to c. The variance of a bin stays.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub correlated_bins: f64,
    /// Values of parameters that are simulated in place of those under `star` and `planet`, so that the start of an
    /// inference may be wrong.
    #[serde(default)]
    pub truth: PerParameter<f64>,
}

pub(super) fn one() -> f64 {
    1.0
}

pub(super) fn is_one(x: &f64) -> bool {
    *x == 1.0
}

fn default_snr() -> Option<f64> {
    Some(1000.0)
}

pub(super) fn default_seed() -> u64 {
    1
}

fn default_simulation_pixels() -> usize {
    20_000
}

/// Errors of line and continuum: standard deviations, from 0 to 10, of one Gaussian value per profile.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContinuumSection {
    /// Level of the continuum, in its own units.
    pub offset: f64,
    /// Slope of the continuum: by how much it is higher at the last bin than in the middle.
    pub slope: f64,
    /// Equivalent width of the line, relative.
    pub equivalent_width: f64,
}

/// Centres of the velocity bins: `min`, `min + step`, ... up to `max` (km/s).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VelocitySection {
    /// First velocity (km/s).
    pub min: f64,
    /// Last velocity (km/s).
    pub max: f64,
    /// Width of a bin (km/s), above 0.
    pub step: f64,
}
