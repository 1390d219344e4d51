//! A number that says something of the spots before they are integrated out: a number, `"fitted"`, or `"static"`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
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

impl Serialize for Hyperparameter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Hyperparameter::Known(value) => serializer.serialize_f64(*value),
            Hyperparameter::Fitted => serializer.serialize_str("fitted"),
            Hyperparameter::Static => serializer.serialize_str("static"),
        }
    }
}

impl<'de> Deserialize<'de> for Hyperparameter {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Visitor)
    }
}

struct Visitor;

impl de::Visitor<'_> for Visitor {
    type Value = Hyperparameter;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a number, \"fitted\", or (a lifetime) \"static\"")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Hyperparameter, E> {
        Ok(Hyperparameter::Known(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Hyperparameter, E> {
        Ok(Hyperparameter::Known(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Hyperparameter, E> {
        Ok(Hyperparameter::Known(value as f64))
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<Hyperparameter, E> {
        match value {
            "fitted" => Ok(Hyperparameter::Fitted),
            "static" => Ok(Hyperparameter::Static),
            _ => Err(E::invalid_value(de::Unexpected::Str(value), &self)),
        }
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
