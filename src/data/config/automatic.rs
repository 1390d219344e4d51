//! A number that may be left to the program: `"auto"`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
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
    /// The number; NaN where it is still to be measured.
    pub fn value(self) -> f64 {
        match self {
            Automatic::Fixed(value) => value,
            Automatic::Auto => f64::NAN,
        }
    }
}

impl Serialize for Automatic {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Automatic::Fixed(value) => serializer.serialize_f64(*value),
            Automatic::Auto => serializer.serialize_str("auto"),
        }
    }
}

impl<'de> Deserialize<'de> for Automatic {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AutomaticVisitor)
    }
}

struct AutomaticVisitor;

impl de::Visitor<'_> for AutomaticVisitor {
    type Value = Automatic;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a number or \"auto\"")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Automatic, E> {
        Ok(Automatic::Fixed(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Automatic, E> {
        Ok(Automatic::Fixed(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Automatic, E> {
        Ok(Automatic::Fixed(value as f64))
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<Automatic, E> {
        match value {
            "auto" => Ok(Automatic::Auto),
            _ => Err(E::invalid_value(de::Unexpected::Str(value), &self)),
        }
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
