//! `indicators`: activity indicators as users write them. Doc comments here are the descriptions of the JSON Schema.

use super::listed::Section;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// An activity indicator: H alpha, S, a longitudinal field, a colour.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IndicatorSection {
    /// Name of the indicator, in results: letters, digits, `-`, `_` and `.`. "indicator" if not given, of several
    /// "indicator1", "indicator2", ...
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// A text table, relative to the folder of this config, with a header: time (d), value and its uncertainty, as
    /// `time,value,sigma`, or other names: the value is `value`, or the first column that is no time, uncertainty or
    /// flag. Times are in the system of the profiles, unless the column name gives another.
    pub path: PathBuf,
    /// Windows of time `[start, end]` (d) whose values are left out: flares.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<[f64; 2]>,
}

impl Section for IndicatorSection {
    const KEY: &'static str = "indicators";
    const SCHEMA: [&'static str; 2] = ["Indicators", "One activity indicator, or a list of several."];
    const EMPTY: &'static str = "the list is empty, leave indicators out where there is none";
}
