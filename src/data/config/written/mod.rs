//! The config as users write it: names, units and defaults, a type for each section. Doc comments here are the
//! descriptions of the JSON Schema.
//!
//! What is made of a section is in the file of `settings` that has the same name: of planets in `orbits`, of priors in
//! `parameters`, of simulations in `simulation`.

mod imaging;
mod indicators;
mod listed;
mod number_or;
mod observations;
mod per_parameter;
mod photometry;
mod plan;
mod star;

pub use imaging::ImagingSettings;
pub use indicators::IndicatorSection;
pub use listed::Listed;
pub use number_or::{Automatic, EquivalentWidth, Hyperparameter, OfField, VelocityJitter, ZeroPoint};
pub use observations::{EventWindows, EventsKey, EventsWord, ObservationsSection, SimulateSection, VelocitySection};
pub use per_parameter::{PerParameter, Planet};
pub use photometry::{OutlierTreatment, PhotometrySection, SEGMENT_GAP_D, SimulatedLight};
pub use plan::{PlanSection, PlannedLight};
pub use star::{
    Instrument, LimbDarkeningSection, LimbLaw, Line, LineShape, RegionsSection, Star, USUAL_LIMB_DARKENING,
    USUAL_WAVELENGTH_NM, VelocityDrift,
};

use crate::model::{Parameter, PriorKind};
use crate::sampling::ensemble::SamplerSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Configuration of dimcmc: a star, its observations (or how to simulate them), and what is to be inferred.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "dimcmc configuration")]
pub struct Config {
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
    /// The line profiles, observed or simulated: either `path` or `simulate`; or a list of data sets.
    pub observations: Listed<ObservationsSection>,
    /// Light curves of the star, with objective "marginal-likelihood": one, or a list.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photometry: Option<Listed<PhotometrySection>>,
    /// Activity indicators, with objective "marginal-likelihood": one, or a list. Each is `level + slope t + gain f(t)`
    /// with the filling factor f of the visible disc; gain and jitter are fitted to the values, and an indicator
    /// without a significant gain is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub indicators: Option<Listed<IndicatorSection>>,
    /// Profiles to be planned beside the observations: of one data set, or a list.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<Listed<PlanSection>>,
    /// The Doppler image.
    #[serde(default)]
    pub imaging: ImagingSettings,
    /// The free parameters with their priors; all others are fixed at the values under `star` and `planet`.
    #[serde(default)]
    pub parameters: PerParameter<PriorSection>,
    /// The chain.
    #[serde(default)]
    pub sampler: SamplerSettings,
    /// The likelihood grid of `dimcmc grid`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<Grid>,
}

impl Config {
    /// Whether a parameter has a prior or an axis.
    pub fn is_free(&self, parameter: Parameter) -> bool {
        self.parameters.has(parameter) || self.has_axis(parameter)
    }

    /// The number of the star at a dotted key; `None` where a word stands there.
    pub fn number_at(&self, key: &str) -> Option<f64> {
        let star = serde_json::to_value(&self.star).expect("a section of the config is JSON");
        let path = key.strip_prefix("star.").expect("a key of the star").split('.');
        path.fold(&star, |section, name| &section[name]).as_f64()
    }

    /// Whether it has an axis.
    pub fn has_axis(&self, parameter: Parameter) -> bool {
        self.grid.as_ref().is_some_and(|grid| grid.axes.has(parameter))
    }
}

/// A prior. Which of the other keys belong to it depends on its kind.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PriorSection {
    /// Kind of the prior.
    pub prior: PriorKind,
    /// Lower bound; needed for uniform and log-uniform (there above 0), optional for normal and isotropic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Upper bound, above the lower one; needed for uniform and log-uniform, optional for normal and isotropic. Of a
    /// unit-disc prior, optional: the largest eccentricity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// Mean of a normal prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// Standard deviation of a normal prior, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
}

impl PriorSection {
    /// The section that stands for a uniform or log-uniform prior.
    pub fn even(prior: PriorKind, (min, max): (f64, f64)) -> Self {
        PriorSection { prior, min: Some(min), max: Some(max), mean: None, sd: None }
    }
}

/// The likelihood grid of `dimcmc grid`: ln L of the maps, without priors. Parameters without an axis are fixed at
/// their values under `star` and `planet`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// One to three axes `[min, max, n]`: n nodes (2 or more) from min to max, both included, 1,000,000 nodes in all at
    /// most. An axis of `phi` may wrap around 0 or 1 (nodes are written in [0, 1)); where it spans a whole period, as
    /// [0, 1, n], max is the same place as min and is left out.
    pub axes: PerParameter<(f64, f64, usize)>,
}
