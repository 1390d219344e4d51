//! A number that says something of the spots before they are integrated out: a number, `"fitted"`, or `"static"`.

use super::number_or_word::{self, NumberOrWord};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

/// A hyperparameter of the field of spots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Hyperparameter {
    /// That for which the profiles are most probable.
    #[default]
    Fitted,
    /// Known.
    Known(f64),
    /// For a lifetime: spots do not change.
    Static,
}

impl Hyperparameter {
    /// Whether it is the default, which configs need not mention.
    pub fn is_default(&self) -> bool {
        *self == Hyperparameter::default()
    }

    /// The number, where it is known.
    pub fn known(self) -> Option<f64> {
        match self {
            Hyperparameter::Known(value) => Some(value),
            Hyperparameter::Fitted | Hyperparameter::Static => None,
        }
    }
}

impl NumberOrWord for Hyperparameter {
    const EXPECTED: &'static str = "a number, \"fitted\", or (a lifetime) \"static\"";
    const WORDS: &'static [(&'static str, Self)] =
        &[("fitted", Hyperparameter::Fitted), ("static", Hyperparameter::Static)];

    fn of(number: f64) -> Self {
        Hyperparameter::Known(number)
    }

    fn number(self) -> Option<f64> {
        self.known()
    }
}

impl Serialize for Hyperparameter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        number_or_word::serialize(*self, serializer)
    }
}

impl<'de> Deserialize<'de> for Hyperparameter {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        number_or_word::deserialize(deserializer)
    }
}

impl JsonSchema for Hyperparameter {
    fn schema_name() -> Cow<'static, str> {
        "Hyperparameter".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number, or \"fitted\": that for which the profiles are most probable. A lifetime may be \
                \"static\" too: spots do not change.",
            "anyOf": [{ "type": "number", "exclusiveMinimum": 0 }, { "const": "fitted" }, { "const": "static" }]
        })
    }
}
