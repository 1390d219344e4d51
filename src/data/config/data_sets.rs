//! `observations`: one data set, or a list of them; and the zero point of a set's velocities.

use super::listed::{Listed, Section};
use super::number_or_word::{self, NumberOrWord};
use super::raw_parts::ObservationsSection;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

/// The data sets as written.
pub(super) type DataSets = Listed<ObservationsSection>;

impl Section for ObservationsSection {
    const KEY: &'static str = "observations";
    const SCHEMA: [&'static str; 2] = ["DataSets", "One data set, or a list of several of one star."];
    const EMPTY: &'static str = "the list is empty, one data set at least is needed";
}

/// The velocity zero point of a data set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ZeroPoint {
    /// Known (km/s); 0 for none.
    Known(f64),
    /// One number of all profiles of the set, integrated out.
    Fitted,
}

impl Default for ZeroPoint {
    fn default() -> Self {
        ZeroPoint::Known(0.0)
    }
}

impl ZeroPoint {
    /// Whether it is the default, which configs need not mention.
    pub fn is_default(&self) -> bool {
        *self == ZeroPoint::default()
    }
}

impl NumberOrWord for ZeroPoint {
    const EXPECTED: &'static str = "a number or \"fitted\"";
    const WORDS: &'static [(&'static str, Self)] = &[("fitted", ZeroPoint::Fitted)];

    fn of(number: f64) -> Self {
        ZeroPoint::Known(number)
    }

    fn number(self) -> Option<f64> {
        match self {
            ZeroPoint::Known(number) => Some(number),
            ZeroPoint::Fitted => None,
        }
    }
}

impl Serialize for ZeroPoint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        number_or_word::serialize(*self, serializer)
    }
}

impl<'de> Deserialize<'de> for ZeroPoint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        number_or_word::deserialize(deserializer)
    }
}

impl JsonSchema for ZeroPoint {
    fn schema_name() -> Cow<'static, str> {
        "ZeroPoint".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number from -100 to 100 (km/s), or \"fitted\": integrated out.",
            "anyOf": [{ "type": "number", "minimum": -100, "maximum": 100 }, { "const": "fitted" }]
        })
    }
}
