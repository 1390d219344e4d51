//! Sections of which a config has one, or a list of several.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::DeserializeOwned;
use serde::de::value::MapAccessDeserializer;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::borrow::Cow;
use std::marker::PhantomData;

/// Such a section.
pub trait Section: DeserializeOwned + Serialize + JsonSchema {
    /// Its key.
    const KEY: &'static str;
    /// What one or several of them are called in the JSON Schema, and what they are.
    const SCHEMA: [&'static str; 2];
    /// What is to be said of an empty list.
    const EMPTY: &'static str;
}

/// The sections as written. A list of one is written as that one.
#[derive(Clone, Debug)]
pub struct Listed<T> {
    /// The sections.
    pub sections: Vec<T>,
    /// Whether keys have the number of the section in them.
    listed: bool,
}

impl<T: Section> Listed<T> {
    /// Of these sections, one at least.
    pub fn of(sections: Vec<T>) -> Self {
        Listed { listed: sections.len() > 1, sections }
    }

    /// Where section `s` stands in the config.
    pub fn key(&self, s: usize) -> String {
        if self.listed { format!("{}[{s}]", T::KEY) } else { T::KEY.into() }
    }
}

impl<T: Section> Serialize for Listed<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.sections[..] {
            [one] => one.serialize(serializer),
            several => several.serialize(serializer),
        }
    }
}

impl<'de, T: Section> Deserialize<'de> for Listed<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Visitor(PhantomData))
    }
}

struct Visitor<T>(PhantomData<T>);

impl<'de, T: Section> de::Visitor<'de> for Visitor<T> {
    type Value = Listed<T>;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("an object in braces, or a list of them")
    }

    fn visit_map<A: de::MapAccess<'de>>(self, map: A) -> Result<Listed<T>, A::Error> {
        let one = T::deserialize(MapAccessDeserializer::new(map))?;
        Ok(Listed { sections: vec![one], listed: false })
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut list: A) -> Result<Listed<T>, A::Error> {
        let mut sections = Vec::new();
        while let Some(section) = list.next_element()? {
            sections.push(section);
        }
        match sections.is_empty() {
            true => Err(de::Error::custom(T::EMPTY)),
            false => Ok(Listed { sections, listed: true }),
        }
    }
}

impl<T: Section> JsonSchema for Listed<T> {
    fn schema_name() -> Cow<'static, str> {
        T::SCHEMA[0].into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let section = generator.subschema_for::<T>();
        json_schema!({
            "description": T::SCHEMA[1],
            "anyOf": [section, { "type": "array", "items": section, "minItems": 1 }]
        })
    }
}
