//! A number that may be left to the program: `"auto"`.

use super::number_or_word::{self, NumberOrWord};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;

/// A number, or what the observations say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Automatic {
    /// A number.
    Fixed(f64),
    /// It is measured.
    Auto,
}

impl Automatic {
    /// The number, where it is one.
    pub fn number(self) -> Option<f64> {
        match self {
            Automatic::Fixed(number) => Some(number),
            Automatic::Auto => None,
        }
    }
}

impl NumberOrWord for Automatic {
    const EXPECTED: &'static str = "a number or \"auto\"";
    const WORDS: &'static [(&'static str, Self)] = &[("auto", Automatic::Auto)];

    fn of(number: f64) -> Self {
        Automatic::Fixed(number)
    }

    fn number(self) -> Option<f64> {
        Automatic::number(self)
    }
}

impl Serialize for Automatic {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        number_or_word::serialize(*self, serializer)
    }
}

impl<'de> Deserialize<'de> for Automatic {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        number_or_word::deserialize(deserializer)
    }
}

impl JsonSchema for Automatic {
    fn schema_name() -> Cow<'static, str> {
        "Automatic".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A number above 0, or \"auto\": what the observations say.",
            "anyOf": [{ "type": "number", "exclusiveMinimum": 0 }, { "const": "auto" }]
        })
    }
}
