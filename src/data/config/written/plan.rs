//! `plan`: what is planned, as users write it. Doc comments here are the descriptions of the JSON Schema.

use super::listed::Section;
use crate::data::simulate::{Schedule, Site};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Profiles that are planned beside those of `observations`, for the command `plan` alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanSection {
    /// Name of the data set that they belong to, whose bins and offset they share; the last one, if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// When they are taken.
    #[serde(default)]
    pub schedule: Schedule,
    /// Times of the profiles (d), on the time scale of the observations, in place of `schedule`, `first_d` and `site`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times_d: Option<Vec<f64>>,
    /// Time of the first night (d), on the time scale of the observations; the day after the last profile, if not
    /// given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_d: Option<f64>,
    /// Signal-to-noise ratio of each bin, above 0; that of the observed profiles, if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub snr: Option<f64>,
    /// From where: profiles are spread over the time in which the star is observable, in place of
    /// `schedule.night_hours`, and nights in which it is not are left out. Times must then be Julian dates, or such
    /// less `time_zero_jd`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub site: Option<Site>,
    /// Photometry from the first to the last of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photometry: Option<PlannedLight>,
}

/// A light curve that is planned beside profiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlannedLight {
    /// Name of the light curve in whose band it is; the last one, if not given, or the star's own band.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Time between measurements (d), above 0.
    pub cadence_d: f64,
    /// Standard error of a measurement, in units of the mean flux, above 0.
    pub sigma: f64,
}

impl Section for PlanSection {
    const KEY: &'static str = "plan";
    const SCHEMA: [&'static str; 2] = ["Plan", "Profiles planned for one data set, or a list of several."];
    const EMPTY: &'static str = "the list is empty, leave plan out where nothing is planned";
}
