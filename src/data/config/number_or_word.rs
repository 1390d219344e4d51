//! A number, or one of a few words in its place: `"auto"`, `"fitted"`.

use serde::{Deserializer, Serializer, de};
use std::marker::PhantomData;

/// What is written as a number or as a word.
pub(super) trait NumberOrWord: Copy + PartialEq + 'static {
    /// What is expected, for errors.
    const EXPECTED: &'static str;
    /// The words with what they stand for.
    const WORDS: &'static [(&'static str, Self)];

    /// What a number stands for.
    fn of(number: f64) -> Self;

    /// The number, where it is one.
    fn number(self) -> Option<f64>;
}

pub(super) fn serialize<T: NumberOrWord, S: Serializer>(value: T, serializer: S) -> Result<S::Ok, S::Error> {
    match T::WORDS.iter().find(|(_, meaning)| *meaning == value) {
        Some((word, _)) => serializer.serialize_str(word),
        None => serializer.serialize_f64(value.number().unwrap_or(f64::NAN)),
    }
}

pub(super) fn deserialize<'de, T: NumberOrWord, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    deserializer.deserialize_any(Visitor(PhantomData))
}

struct Visitor<T>(PhantomData<T>);

impl<T: NumberOrWord> de::Visitor<'_> for Visitor<T> {
    type Value = T;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(T::EXPECTED)
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<T, E> {
        Ok(T::of(value))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<T, E> {
        Ok(T::of(value as f64))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<T, E> {
        Ok(T::of(value as f64))
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<T, E> {
        let meaning = T::WORDS.iter().find(|(word, _)| *word == value).map(|(_, meaning)| *meaning);
        meaning.ok_or_else(|| E::invalid_value(de::Unexpected::Str(value), &self))
    }
}
