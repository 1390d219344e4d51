//! The resolved settings: validated, in the units of the parts they are for, nothing left to decide.

use super::number_or::{Automatic, EquivalentWidth, Hyperparameter, OfField, VelocityJitter, ZeroPoint};
use super::{ConfigError, OutlierTreatment, PlanSection, SamplerSettings, SimulatedLight};
use crate::data::simulate::Simulation;
use crate::field::Lifetime;
use crate::maxent::entropy::Entropy;
use crate::model::{FreeParameter, Parameter, ParameterValues};
use crate::sampling::landscape::Grid;
use crate::star::response::{MOST_NODES, MOST_STEPS_PER_BIN, velocity_grid};
use crate::star::{Band, BrightnessModel, StarSettings};
use crate::surface::Known;
use crate::surface::calibration::noise::ErrorSettings;
use crate::surface::nuisances::LineAndContinuum;
use crate::surface::{ObjectiveKind, UnresolvedSpots};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A whole config, resolved.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The config file.
    pub path: PathBuf,
    /// The star, whatever data sets say of it. With [`EquivalentWidth`] "auto" the equivalent width of its line is NaN.
    pub star: StarSettings,
    /// Mass of the star (solar masses), for the minimum mass of the planet.
    pub mass_msun: Option<f64>,
    /// The parameters as the config gives them: the fixed ones, and the start of the free ones.
    pub values: ParameterValues,
    /// The data sets, one at least.
    pub sets: Vec<DataSetSettings>,
    /// The light curves, mostly none.
    pub light_curves: Vec<LightCurveSettings>,
    /// What is planned beside them.
    pub plan: Option<PlanSection>,
    /// Scatter of the profiles' velocity zero points.
    pub velocity_jitter: VelocityJitter,
    /// The Doppler image.
    pub imaging: ImagingSettings,
    /// The free parameters in the order of [`Parameter::ALL`]; may be empty, see [`Settings::require_free`].
    pub free: Vec<FreeParameter>,
    /// The chain.
    pub sampler: SamplerSettings,
    /// The landscape.
    pub grid: Option<GridSettings>,
    /// The config with all defaults filled in and paths as given, for the manifest; it is itself a valid config.
    pub resolved: serde_json::Value,
    /// SHA-256 (hex) of the part of `resolved` that decides the posterior and the chain: all but `$schema`, `grid`,
    /// `plan`, `star.mass_msun`, and `sampler.steps`, `.rhat` and `.ess`, which may change when a chain is resumed.
    pub sha256: String,
}

/// A data set.
#[derive(Clone, Debug)]
pub struct DataSetSettings {
    /// Where it stands in the config.
    pub key: String,
    /// Its name.
    pub name: String,
    /// The star as it sees it; see [`star_for`](crate::data::calibrated::star_for) for one whose line is as strong as
    /// the profiles say: here its equivalent width is NaN.
    pub star: StarSettings,
    /// Where the equivalent width of the line comes from.
    pub equivalent_width: EquivalentWidth,
    /// Where the profiles come from.
    pub source: ObservationSource,
    /// Line and continuum of each profile.
    pub nuisances: Option<LineAndContinuum>,
    /// Velocity that all profiles have too much.
    pub zero_point: ZeroPoint,
    /// Windows of time (d) whose profiles are left out.
    pub exclude: Vec<[f64; 2]>,
}

impl DataSetSettings {
    /// What is simulated.
    pub fn simulation(&self) -> Option<&Simulation> {
        match &self.source {
            ObservationSource::Simulate(simulation) => Some(simulation),
            ObservationSource::Files { .. } => None,
        }
    }

    /// Level of the continuum in its files.
    pub fn continuum_level(&self) -> f64 {
        match self.source {
            ObservationSource::Files { continuum_level, .. } => continuum_level,
            ObservationSource::Simulate(_) => 1.0,
        }
    }
}

/// A light curve.
#[derive(Clone, Debug)]
pub struct LightCurveSettings {
    /// Where it stands in the config.
    pub key: String,
    /// Its name.
    pub name: String,
    /// What of the star looks different in it.
    pub band: Band,
    /// Where it comes from.
    pub source: LightSource,
    /// Gaps longer than this (d) part segments.
    pub segment_gap_d: f64,
    /// Factor on the standard errors.
    pub sigma_scale: f64,
    /// Windows `[start, end]` (d) whose measurements are left out.
    pub exclude: Vec<[f64; 2]>,
    /// What becomes of measurements that no spot explains.
    pub outliers: OutlierTreatment,
}

/// Where a light curve comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum LightSource {
    /// A table, relative to the working directory.
    File(PathBuf),
    /// The star that is simulated.
    Simulate(SimulatedLight),
}

/// Where the profiles come from.
// there is one of them in a config
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub enum ObservationSource {
    /// Files.
    Files {
        /// The list, relative to the working directory.
        path: PathBuf,
        /// First and last velocity to use (km/s, after subtraction of VRAD); all bins if `None`.
        velocity_range_kms: Option<(f64, f64)>,
        /// Factor on every sigma, 1 where that is left to the observations.
        sigma_scale: f64,
        /// Level of the continuum in the files: what is read is divided by it.
        continuum_level: f64,
        /// What the observations are to say of their errors.
        errors: ErrorSettings,
    },
    /// A simulation.
    Simulate(Simulation),
}

/// A longer gap between profiles (d) begins another season, unless the config has another number.
pub const SEASON_GAP_D: f64 = 60.0;

/// The Doppler image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImagingSettings {
    /// Pixels of the image, 100 to 2,000,000 (approximately: rings hold whole numbers of pixels).
    pub pixels: usize,
    /// What the pixels of the image hold.
    #[serde(skip_serializing_if = "BrightnessModel::is_default")]
    pub brightness: BrightnessModel,
    /// Spot filling factor of a pixel that the data say nothing about, above 0 and below 0.5; an image of bright and
    /// dark pixels has no use for it.
    pub default_spot: f64,
    /// Target chi2 per datum, above 0. "auto": the highest value below which the radial velocities that are left over,
    /// observed minus modelled, stop shrinking, at the config's values.
    pub chi2_target: Automatic,
    /// What a reconstruction is judged by.
    pub objective: ObjectiveKind,
    /// With objectives of a star that does not change: a longer gap between profiles (d), above 0, begins another
    /// season, which has a map of its own. If not given, 60.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub season_gap_d: Option<f64>,
    /// In place of `season_gap_d`: the seasons as `[start, end]` (d), one after the other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub seasons: Vec<[f64; 2]>,
    /// With objective "marginal-likelihood": standard deviation of the spot filling factor before the data, from 0.01
    /// to 1.5.
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_amplitude: Hyperparameter,
    /// With objective "marginal-likelihood": how fast the spots' power falls with the degree of the harmonics, from 0
    /// (small spots) to 3 (large ones).
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_slope: Hyperparameter,
    /// With objective "marginal-likelihood": degree of the harmonics below which the spots' power does not rise any
    /// more, from 0 (a power law all the way) to 30. If not given, 0 or 7 (spots of 10 to 25 degrees, here and there),
    /// whichever has the higher evidence; 0 with a number as `spot_slope`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spot_break_degree: Option<f64>,
    /// With objective "marginal-likelihood": how long spots live, from 0.3 to 3000 d, or "static".
    #[serde(skip_serializing_if = "Hyperparameter::is_default")]
    pub spot_lifetime_d: Hyperparameter,
    /// What the chain takes the spots that the map leaves over for. Landscapes and optima take them as the entropy has
    /// them.
    pub unresolved_spots: UnresolvedSpots,
    /// Line and continuum of each profile by itself, integrated out: standard deviations of their Gaussian priors
    /// around 0, from 0 (no nuisance) to 10.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nuisances: Option<LineAndContinuum>,
}

impl Default for ImagingSettings {
    fn default() -> Self {
        ImagingSettings {
            pixels: 2000,
            brightness: BrightnessModel::default(),
            default_spot: 1e-4,
            chi2_target: Automatic::Number(0.97),
            objective: ObjectiveKind::default(),
            season_gap_d: None,
            seasons: Vec::new(),
            spot_amplitude: Hyperparameter::Word(OfField::Fitted),
            spot_slope: Hyperparameter::Word(OfField::Fitted),
            spot_break_degree: None,
            spot_lifetime_d: Hyperparameter::Word(OfField::Fitted),
            unresolved_spots: UnresolvedSpots::default(),
            nuisances: None,
        }
    }
}

impl ImagingSettings {
    /// Entropy of the image.
    pub fn entropy(&self) -> Entropy {
        match self.brightness {
            BrightnessModel::Spots => Entropy::new(self.default_spot),
            BrightnessModel::BrightAndDark => Entropy::BrightAndDark,
        }
    }
}

/// The landscape.
#[derive(Clone, Debug, PartialEq)]
pub struct GridSettings {
    /// Its nodes, the axes in the order of [`Parameter::ALL`].
    pub grid: Grid,
    /// The parameters on its axes, in the same order, with the priors of the search for the reference: those under
    /// `parameters`, or uniform along the axis. All other parameters are fixed at their values in the config. The
    /// priors do not enter the landscape.
    pub free: Vec<FreeParameter>,
}

impl Settings {
    /// The free parameters, for commands that cannot do without.
    ///
    /// # Errors
    /// If there is none.
    pub fn require_free(&self) -> Result<&[FreeParameter], ConfigError> {
        match &self.free[..] {
            [] => Err(self.fault("parameters", "no parameter is free: give at least one of them a prior")),
            free => Ok(free),
        }
    }

    /// The landscape, for the command that cannot do without.
    ///
    /// # Errors
    /// If the config has no `grid`.
    pub fn require_grid(&self) -> Result<&GridSettings, ConfigError> {
        self.grid.as_ref().ok_or_else(|| self.fault("grid", "missing, a landscape needs its axes"))
    }

    /// Whether profiles of `star` in velocity bins of `step_kms` can be computed at `values`.
    ///
    /// # Errors
    /// If the local line is so narrow, or the star so fast, that the velocity grid grows out of hand.
    pub fn check_velocity_grid(
        &self,
        star: &StarSettings,
        values: &ParameterValues,
        step_kms: f64,
    ) -> Result<(), ConfigError> {
        let (steps, nodes) = velocity_grid(star, &values.state(), step_kms);
        if steps.is_nan() || steps > MOST_STEPS_PER_BIN {
            let sigma = star.line.sigma_kms;
            let problem = format!("{sigma} (with the instrument) is too narrow for velocity bins of {step_kms} km/s");
            return Err(self.fault("star.line.sigma_kms", &problem));
        }
        if nodes.is_nan() || nodes > MOST_NODES {
            let vsini = values[Parameter::Vsini];
            let problem = format!(
                "{vsini} km/s, at the pole or the equator, takes {nodes:.1e} steps of a fraction of the line's width, \
                over \
                 {MOST_NODES}: see star.domega_rad_d, star.line.sigma_kms and the velocity bins too"
            );
            return Err(self.fault("star.vsini_kms", &problem));
        }
        Ok(())
    }

    /// The config with other observations in place of its own, those of each data set in a list at `path_of` it; cut
    /// and errors of observed ones stay.
    pub fn with_observations(&self, path_of: impl Fn(&DataSetSettings) -> String) -> serde_json::Value {
        let mut config = self.resolved.clone();
        if let Some(top) = config.as_object_mut() {
            top.remove("$schema");
        }
        self.with_light_curves_from_here(&mut config);
        let sections = match &mut config["observations"] {
            serde_json::Value::Array(sections) => sections.iter_mut().collect(),
            one => vec![one],
        };
        for (section, set) in sections.into_iter().zip(&self.sets) {
            if let Some(section) = section.as_object_mut() {
                section.remove("simulate");
                section.insert("path".into(), path_of(set).into());
            }
        }
        config
    }

    /// Tables of light curves by paths that hold from anywhere; simulated ones, which go with simulated profiles, are
    /// left out.
    fn with_light_curves_from_here(&self, config: &mut serde_json::Value) {
        let Some(written) = config.get("photometry").cloned() else { return };
        let sections = written.as_array().cloned().unwrap_or_else(|| vec![written]);
        let tables = sections.into_iter().zip(&self.light_curves).filter_map(|(mut section, curve)| {
            let LightSource::File(path) = &curve.source else { return None };
            section["path"] = std::path::absolute(path).unwrap_or_else(|_| path.clone()).to_str()?.into();
            Some(section)
        });
        let tables: Vec<serde_json::Value> = tables.collect();
        match (tables.is_empty(), config.as_object_mut()) {
            (true, Some(top)) => drop(top.remove("photometry")),
            _ => config["photometry"] = tables.into(),
        }
    }

    /// The faculae of a simulated star, as the config has them.
    pub fn faculae_as_written(&self) -> Option<serde_json::Value> {
        let observations = &self.resolved["observations"];
        let first = observations.get(0).unwrap_or(observations);
        first["simulate"].get("faculae").cloned()
    }

    /// What is known of the field of spots before the profiles, where maps are integrated over.
    pub fn known_field(&self) -> Known {
        let ImagingSettings { spot_amplitude, spot_slope, spot_lifetime_d, .. } = self.imaging;
        let priors = Parameter::FIELD.map(|p| self.free.iter().find(|f| f.parameter == p).map(|f| f.prior));
        // a number beside a prior is where a chain starts
        let number = |i: usize, given: Hyperparameter| given.number().filter(|_| priors[i].is_none());
        Known {
            amplitude: number(0, spot_amplitude),
            slope: number(1, spot_slope),
            break_degree: self.imaging.spot_break_degree,
            lifetime: match spot_lifetime_d {
                Hyperparameter::Word(OfField::Static) => Some(Lifetime::Static),
                days => number(2, days).map(Lifetime::Days),
            },
            priors,
            jitter_kms: self.velocity_jitter.number(),
        }
    }

    /// That something is wrong with a key.
    pub fn fault(&self, key: &str, problem: &str) -> ConfigError {
        ConfigError::Key { path: self.path.clone(), key: key.into(), problem: problem.into() }
    }
}
