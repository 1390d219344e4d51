//! `observations`: one data set, or a list of them; and the zero point of a set's velocities.

use super::number_or_word::{self, NumberOrWord};
use super::raw_parts::ObservationsSection;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::borrow::Cow;

/// The data sets as written. A list of one is written as that one.
#[derive(Clone, Debug)]
pub(super) struct DataSets {
    pub sections: Vec<ObservationsSection>,
    /// Whether keys have the number of the set in them.
    listed: bool,
}

impl DataSets {
    /// Where set `s` stands in the config.
    pub fn key(&self, s: usize) -> String {
        if self.listed { format!("observations[{s}]") } else { "observations".into() }
    }
}

impl Serialize for DataSets {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.sections[..] {
            [one] => one.serialize(serializer),
            several => several.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for DataSets {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Visitor)
    }
}

struct Visitor;

impl<'de> de::Visitor<'de> for Visitor {
    type Value = DataSets;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("an object in braces, or a list of them")
    }

    fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<DataSets, A::Error> {
        let one = ObservationsSection::deserialize(MapAccessDeserializer::new(map))?;
        Ok(DataSets { sections: vec![one], listed: false })
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<DataSets, A::Error> {
        let mut sections = Vec::new();
        while let Some(section) = list.next_element()? {
            sections.push(section);
        }
        match sections.is_empty() {
            true => Err(de::Error::custom("the list is empty, one data set at least is needed")),
            false => Ok(DataSets { sections, listed: true }),
        }
    }
}

impl JsonSchema for DataSets {
    fn schema_name() -> Cow<'static, str> {
        "DataSets".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let section = generator.subschema_for::<ObservationsSection>();
        json_schema!({
            "description": "One data set, or a list of several of one star.",
            "anyOf": [section, { "type": "array", "items": section, "minItems": 1 }]
        })
    }
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
