//! The scatter of the profiles' velocity zero points: a number, or `"fitted"`.

use super::number_or_word::{self, NumberOrWord};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

/// Standard deviation of the velocity zero points of the profiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VelocityJitter {
    /// Known (km/s); 0 for none.
    Known(f64),
    /// What the profiles say, at the config's values.
    Fitted,
}

impl Default for VelocityJitter {
    fn default() -> Self {
        VelocityJitter::Known(0.0)
    }
}

impl VelocityJitter {
    /// Whether it is the default, which configs need not mention.
    pub fn is_default(&self) -> bool {
        *self == VelocityJitter::default()
    }
}

impl NumberOrWord for VelocityJitter {
    const EXPECTED: &'static str = "a number or \"fitted\"";
    const WORDS: &'static [(&'static str, Self)] = &[("fitted", VelocityJitter::Fitted)];

    fn of(number: f64) -> Self {
        VelocityJitter::Known(number)
    }

    fn number(self) -> Option<f64> {
        match self {
            VelocityJitter::Known(number) => Some(number),
            _ => None,
        }
    }
}

impl Serialize for VelocityJitter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        number_or_word::serialize(*self, serializer)
    }
}

impl<'de> Deserialize<'de> for VelocityJitter {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        number_or_word::deserialize(deserializer)
    }
}

impl JsonSchema for VelocityJitter {
    fn schema_name() -> Cow<'static, str> {
        "VelocityJitter".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number from 0 to 100 (km/s), or \"fitted\": what the profiles say.",
            "anyOf": [{ "type": "number", "minimum": 0, "maximum": 100 }, { "const": "fitted" }]
        })
    }
}
