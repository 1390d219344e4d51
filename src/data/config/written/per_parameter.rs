//! Sections of the config with a key for each parameter. Keys and their descriptions are those of the table of
//! parameters.

use crate::model::{PARAMETERS, Parameter, Spec};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{DeserializeSeed, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::marker::PhantomData;
use std::sync::LazyLock;

/// One optional entry for each parameter that may be free.
#[derive(Clone, Debug)]
pub struct PerParameter<T>(BTreeMap<Parameter, T>);

impl<T> PerParameter<T> {
    /// The entry of one parameter.
    pub fn get(&self, parameter: Parameter) -> Option<&T> {
        self.0.get(&parameter)
    }

    /// Whether there is one.
    pub fn has(&self, parameter: Parameter) -> bool {
        self.0.contains_key(&parameter)
    }

    /// Writes it.
    pub fn set(&mut self, parameter: Parameter, entry: T) {
        self.0.insert(parameter, entry);
    }

    /// Those that are there, in the order of [`Parameter::ALL`].
    pub fn entries(&self) -> impl Iterator<Item = (Parameter, &T)> + Clone {
        self.0.iter().map(|(parameter, entry)| (*parameter, entry))
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T> Default for PerParameter<T> {
    fn default() -> Self {
        PerParameter(BTreeMap::new())
    }
}

impl<T> FromIterator<(Parameter, T)> for PerParameter<T> {
    fn from_iter<I: IntoIterator<Item = (Parameter, T)>>(entries: I) -> Self {
        PerParameter(entries.into_iter().collect())
    }
}

impl<T: Serialize> Serialize for PerParameter<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.entries().map(|(parameter, entry)| (parameter.name(), entry)))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for PerParameter<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        static ALL: LazyLock<Vec<&str>> = LazyLock::new(|| PARAMETERS.iter().map(|row| row.key).collect());
        let keys = Keys { name: "PerParameter", keys: &ALL, needs_value: |_| false, entry: PhantomData };
        Ok(PerParameter(deserializer.deserialize_map(keys)?))
    }
}

impl<T: JsonSchema> JsonSchema for PerParameter<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("PerParameter_{}", T::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let entry = |row: &Spec| (row.key, described(generator.subschema_for::<Option<T>>(), row.about));
        section("One optional entry for each parameter that may be free.", PARAMETERS.iter().map(entry))
    }
}

/// The planet's orbit, and that of a second planet if there is one; circular by default. Where a parameter is free, its
/// value here is the start.
#[derive(Clone, Debug, Serialize)]
pub struct Planet(PerParameter<f64>);

impl Planet {
    /// Of these values.
    pub fn of(given: impl IntoIterator<Item = (Parameter, f64)>) -> Self {
        let mut planet = Planet::default();
        given.into_iter().for_each(|(parameter, value)| planet.0.set(parameter, value));
        planet
    }

    /// A value, if it is given.
    pub fn get(&self, parameter: Parameter) -> Option<f64> {
        self.0.get(parameter).copied()
    }

    /// Whether a value is given that is not the usual one.
    pub fn tells(&self, parameter: Parameter) -> bool {
        let usual = has_usual(parameter).then(|| parameter.usual());
        self.get(parameter).is_some_and(|value| Some(value) != usual)
    }

    /// Its keys: those with a usual value first.
    fn rows() -> impl Iterator<Item = &'static Spec> {
        let all = || PARAMETERS.iter().filter(|row| row.config_key.starts_with("planet."));
        let (usual, others) = (all().filter(|row| has_usual(row.parameter)), all());
        usual.chain(others.filter(|row| !has_usual(row.parameter)))
    }
}

/// Whether the planet has a value of it where the config gives none.
fn has_usual(parameter: Parameter) -> bool {
    !parameter.is_optional()
}

impl Default for Planet {
    fn default() -> Self {
        let usual = Planet::rows().map(|row| row.parameter).filter(|p| has_usual(*p));
        Planet(usual.map(|p| (p, p.usual())).collect())
    }
}

impl<'de> Deserialize<'de> for Planet {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        static ALL: LazyLock<Vec<&str>> = LazyLock::new(|| Planet::rows().map(|row| row.key).collect());
        let keys = Keys { name: "Planet", keys: &ALL, needs_value: has_usual, entry: PhantomData };
        Ok(Planet::of(deserializer.deserialize_map(keys)?))
    }
}

impl JsonSchema for Planet {
    fn schema_name() -> Cow<'static, str> {
        "Planet".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let value = |row: &'static Spec| {
            if !has_usual(row.parameter) {
                return (row.key, described(generator.subschema_for::<Option<f64>>(), row.about_value));
            }
            let mut value = described(generator.subschema_for::<f64>(), row.about_value);
            value.insert("default".into(), row.parameter.usual().into());
            (row.key, value)
        };
        section(
            "The planet's orbit, and that of a second planet if there is one; circular by default. Where a \
            parameter is\nfree, its value here is the start.",
            Planet::rows().map(value),
        )
    }
}

fn described(mut schema: Schema, description: &str) -> Schema {
    schema.insert("description".into(), description.into());
    schema
}

/// An object with these keys and no others.
fn section(description: &str, properties: impl Iterator<Item = (&'static str, Schema)>) -> Schema {
    let properties: serde_json::Map<_, _> = properties.map(|(key, entry)| (key.to_owned(), entry.to_value())).collect();
    json_schema!({
        "type": "object",
        "description": description,
        "properties": properties,
        "additionalProperties": false,
    })
}

/// Reads a section. Null stands for nothing, but for a value that the section needs.
struct Keys<T> {
    name: &'static str,
    keys: &'static [&'static str],
    needs_value: fn(Parameter) -> bool,
    entry: PhantomData<T>,
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for Keys<T> {
    type Value = BTreeMap<Parameter, T>;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "struct {}", self.name)
    }

    fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Self::Value, M::Error> {
        let (mut entries, mut seen) = (BTreeMap::new(), BTreeSet::new());
        while let Some(parameter) = map.next_key_seed(Key(self.keys))? {
            if !seen.insert(parameter) {
                return Err(M::Error::duplicate_field(parameter.name()));
            }
            let entry = match (self.needs_value)(parameter) {
                true => Some(map.next_value()?),
                false => map.next_value::<Option<T>>()?,
            };
            entries.extend(entry.map(|entry| (parameter, entry)));
        }
        Ok(entries)
    }
}

/// The name of a parameter, one of those that are allowed.
struct Key(&'static [&'static str]);

impl<'de> DeserializeSeed<'de> for Key {
    type Value = Parameter;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Parameter, D::Error> {
        deserializer.deserialize_identifier(self)
    }
}

impl Visitor<'_> for Key {
    type Value = Parameter;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("field identifier")
    }

    fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Parameter, E> {
        let known = Parameter::from_name(name).filter(|_| self.0.contains(&name));
        known.ok_or_else(|| E::unknown_field(name, self.0))
    }
}
