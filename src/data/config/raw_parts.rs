//! More of the config as users write it: priors, plan, grid axes, and the types they are made of.

use super::per_parameter::PerParameter;
use crate::data::simulate::Schedule;
use crate::model::PriorKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A prior. Which of the other keys belong to it depends on its kind.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PriorSection {
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

/// Profiles that are planned beside those of `observations`, for the command `plan` alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanSection {
    /// When they are taken.
    #[serde(default)]
    pub schedule: Schedule,
    /// Time of the first night (d), on the time scale of the observations; the day after the last profile, if not
    /// given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_d: Option<f64>,
    /// Signal-to-noise ratio of each bin, above 0; that of the observed profiles, if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub snr: Option<f64>,
}

/// The landscape that `dimcmc grid` computes: ln L of the reconstructions, without priors. All parameters without an
/// axis are fixed at their values under `star` and `planet`, those with a prior too.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Grid {
    /// One to three axes `[min, max, n]`: n nodes (2 or more) from min to max, both included, 1,000,000 nodes in all at
    /// most. An axis of `phi` may wrap around 0 or 1 (nodes are written in [0, 1)); where it spans a whole period, as
    /// [0, 1, n], max is the same place as min and is left out.
    pub axes: PerParameter<(f64, f64, usize)>,
}
