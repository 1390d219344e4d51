//! The config as users write it: names, units and defaults. Doc comments here are the descriptions of the JSON Schema.
//!
//! Those of planets and parameters are in `per_parameter`; sections of their own in `star`, `data_sets`, `photometry`
//! and `raw_parts`.

use super::data_sets::DataSets;
use super::listed::Listed;
use super::per_parameter::{PerParameter, Planet};
use super::photometry::PhotometrySection;
use super::raw_parts::{Grid, PlanSection, PriorSection};
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
