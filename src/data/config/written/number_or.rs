//! A number, or one of a few words in its place: `"auto"`, `"fitted"`, `"static"`.

use crate::surface::ObjectiveKind;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::marker::PhantomData;

/// A number, or a word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NumberOr<W> {
    /// The number.
    Number(f64),
    /// The word.
    Word(W),
}

/// A number that may be left to the observations.
pub type Automatic = NumberOr<Auto>;
/// Equivalent width of the local line; automatic: the mean area of the observed profiles.
pub type EquivalentWidth = Automatic;
/// RV jitter of the profiles (km/s), 0 for none; fitted: fitted to the profiles, at the config's values.
pub type VelocityJitter = NumberOr<FittedJitter>;
/// RV offset of a data set (km/s), 0 for none; fitted: marginalised over.
pub type ZeroPoint = NumberOr<FittedOffset>;
/// A hyperparameter of the field of spots; fitted: at the maximum of the marginal likelihood.
pub type Hyperparameter = NumberOr<OfField>;

/// A number of the star; fitted: at the maximum of the marginal likelihood.
pub type OfStar = NumberOr<FittedStar>;

/// "fitted", of a number of the star.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedStar;

/// "auto".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Auto;

/// "fitted", of a velocity jitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedJitter;

/// "fitted", of a velocity offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedOffset;

/// What a hyperparameter may be in place of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OfField {
    /// That for which the profiles are most probable.
    Fitted,
    /// For a lifetime: spots do not change.
    Static,
}

/// What may stand in place of a number.
pub trait Word: Copy + PartialEq + 'static {
    /// The words with what they stand for.
    const WORDS: &'static [(&'static str, Self)];
    /// What is expected, for errors.
    const EXPECTED: &'static str;
    /// Name and description in the JSON Schema.
    const SCHEMA: [&'static str; 2];

    /// The bounds of a number there.
    fn bounds() -> Value;
}

impl Word for Auto {
    const WORDS: &'static [(&'static str, Self)] = &[("auto", Auto)];
    const EXPECTED: &'static str = "a number or \"auto\"";
    const SCHEMA: [&'static str; 2] = ["Automatic", "A number above 0, or \"auto\": measured on the observations."];

    fn bounds() -> Value {
        json!({ "exclusiveMinimum": 0 })
    }
}

impl Word for FittedJitter {
    const WORDS: &'static [(&'static str, Self)] = &[("fitted", FittedJitter)];
    const EXPECTED: &'static str = "a number or \"fitted\"";
    const SCHEMA: [&'static str; 2] =
        ["VelocityJitter", "A number from 0 to 100 (km/s), or \"fitted\": fitted to the profiles."];

    fn bounds() -> Value {
        json!({ "minimum": 0, "maximum": 100 })
    }
}

impl Word for FittedOffset {
    const WORDS: &'static [(&'static str, Self)] = &[("fitted", FittedOffset)];
    const EXPECTED: &'static str = "a number or \"fitted\"";
    const SCHEMA: [&'static str; 2] = [
        "ZeroPoint",
        "A number from -100 to 100 (km/s), or \"fitted\": marginalised \
    over.",
    ];

    fn bounds() -> Value {
        json!({ "minimum": -100, "maximum": 100 })
    }
}

impl Word for FittedStar {
    const WORDS: &'static [(&'static str, Self)] = &[("fitted", FittedStar)];
    const EXPECTED: &'static str = "a number or \"fitted\"";
    const SCHEMA: [&'static str; 2] =
        ["FittedStar", "A number, or \"fitted\": at the maximum of the marginal likelihood."];

    fn bounds() -> Value {
        json!({})
    }
}

impl Word for OfField {
    const WORDS: &'static [(&'static str, Self)] = &[("fitted", OfField::Fitted), ("static", OfField::Static)];
    const EXPECTED: &'static str = "a number, \"fitted\", or (a lifetime) \"static\"";
    const SCHEMA: [&'static str; 2] = [
        "Hyperparameter",
        "A number, or \"fitted\": at the maximum of the marginal likelihood. A lifetime may be \"static\", too.",
    ];

    fn bounds() -> Value {
        json!({ "exclusiveMinimum": 0 })
    }
}

impl Automatic {
    /// Left to the observations.
    pub const AUTO: Self = NumberOr::Word(Auto);
}

impl VelocityJitter {
    /// Left to the profiles.
    pub const FITTED: Self = NumberOr::Word(FittedJitter);

    /// That of a config which gives none.
    pub fn usual(objective: ObjectiveKind) -> Self {
        if objective.properties().marginalises { Self::FITTED } else { Self::default() }
    }

    /// As configs mention it: none is left out where that is usual.
    pub fn mentioned(self, objective: ObjectiveKind) -> Option<Self> {
        Some(self).filter(|jitter| objective.properties().marginalises || !jitter.is_default())
    }
}

impl Default for OfStar {
    fn default() -> Self {
        NumberOr::Word(FittedStar)
    }
}

impl Default for VelocityJitter {
    fn default() -> Self {
        NumberOr::Number(0.0)
    }
}

impl ZeroPoint {
    /// Fitted.
    pub const FITTED: Self = NumberOr::Word(FittedOffset);
}

impl Default for ZeroPoint {
    fn default() -> Self {
        NumberOr::Number(0.0)
    }
}

impl Default for Hyperparameter {
    fn default() -> Self {
        NumberOr::Word(OfField::Fitted)
    }
}

impl<W> NumberOr<W> {
    /// The number, where it is one.
    pub fn number(self) -> Option<f64> {
        match self {
            NumberOr::Number(number) => Some(number),
            NumberOr::Word(_) => None,
        }
    }

    /// Whether it is a word.
    pub fn is_word(&self) -> bool {
        matches!(self, NumberOr::Word(_))
    }

    /// Whether it is the default, which configs need not mention.
    pub fn is_default(&self) -> bool
    where
        W: PartialEq,
        Self: Default,
    {
        *self == Self::default()
    }
}

impl<W: Word> Serialize for NumberOr<W> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            NumberOr::Number(number) => serializer.serialize_f64(*number),
            NumberOr::Word(given) => {
                let word = W::WORDS.iter().find(|(_, meaning)| meaning == given);
                serializer.serialize_str(word.expect("every word is listed").0)
            }
        }
    }
}

impl<'de, W: Word> Deserialize<'de> for NumberOr<W> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Visitor(PhantomData))
    }
}

struct Visitor<W>(PhantomData<W>);

impl<W: Word> de::Visitor<'_> for Visitor<W> {
    type Value = NumberOr<W>;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(W::EXPECTED)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<NumberOr<W>, E> {
        Ok(NumberOr::Number(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<NumberOr<W>, E> {
        Ok(NumberOr::Number(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<NumberOr<W>, E> {
        Ok(NumberOr::Number(value as f64))
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<NumberOr<W>, E> {
        let word = W::WORDS.iter().find(|(word, _)| *word == value);
        word.map(|(_, word)| NumberOr::Word(*word)).ok_or_else(|| E::invalid_value(de::Unexpected::Str(value), &self))
    }
}

impl<W: Word> JsonSchema for NumberOr<W> {
    fn schema_name() -> Cow<'static, str> {
        W::SCHEMA[0].into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let mut number = W::bounds();
        number["type"] = json!("number");
        let words = W::WORDS.iter().map(|(word, _)| json!({ "const": word }));
        let any: Vec<Value> = std::iter::once(number).chain(words).collect();
        json_schema!({ "description": W::SCHEMA[1], "anyOf": any })
    }
}
