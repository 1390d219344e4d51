//! The scatter of the profiles' velocity zero points: a number, or `"fitted"`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
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

impl Serialize for VelocityJitter {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            VelocityJitter::Known(kms) => serializer.serialize_f64(*kms),
            VelocityJitter::Fitted => serializer.serialize_str("fitted"),
        }
    }
}

impl<'de> Deserialize<'de> for VelocityJitter {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(JitterVisitor)
    }
}

struct JitterVisitor;

impl de::Visitor<'_> for JitterVisitor {
    type Value = VelocityJitter;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("a number or \"fitted\"")
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<VelocityJitter, E> {
        Ok(VelocityJitter::Known(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<VelocityJitter, E> {
        Ok(VelocityJitter::Known(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<VelocityJitter, E> {
        Ok(VelocityJitter::Known(value as f64))
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<VelocityJitter, E> {
        match value {
            "fitted" => Ok(VelocityJitter::Fitted),
            _ => Err(E::invalid_value(de::Unexpected::Str(value), &self)),
        }
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
