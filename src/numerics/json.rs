//! Additions to JSON: non-finite numbers, which are written as null and read as NaN, and parts of an object that are
//! present with all their keys, or absent.

use serde::de::{DeserializeOwned, Error, IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

/// For numbers that may be NaN, such as an empty mean.
pub fn number_or_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// For keys that are left out where they are zero.
pub fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

/// Keys of an object that are all present or all absent.
pub trait Part: DeserializeOwned {
    /// These keys.
    const KEYS: &'static [&'static str];
}

/// For a flattened part: `None` where none of its keys is present. Otherwise a fault of any key is an error that names
/// it; with plain serde a flattened `Option` would be `None`.
pub fn part<'de, D: Deserializer<'de>, T: Part>(deserializer: D) -> Result<Option<T>, D::Error> {
    let own = deserializer.deserialize_map(Own(T::KEYS))?;
    if own.is_empty() {
        return Ok(None);
    }
    let part = serde_path_to_error::deserialize(Value::Object(own));
    part.map(Some).map_err(|e| match e.path().to_string().as_str() {
        "." => D::Error::custom(e.inner()),
        key => D::Error::custom(format!("{key}: {}", e.inner())),
    })
}

/// Takes these keys out of an object.
struct Own(&'static [&'static str]);

impl<'de> Visitor<'de> for Own {
    type Value = Map<String, Value>;

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Self::Value, A::Error> {
        let mut own = Map::new();
        while let Some(key) = object.next_key::<String>()? {
            match self.0.contains(&&*key) {
                true => drop(own.insert(key, object.next_value()?)),
                false => drop(object.next_value::<IgnoredAny>()?),
            }
        }
        Ok(own)
    }
}

#[cfg(test)]
mod tests {
    use super::{Part, part};
    use serde::Deserialize;
    use serde_json::json;

    #[derive(Debug, PartialEq, Deserialize)]
    struct Whole {
        n: usize,
        #[serde(flatten, deserialize_with = "part")]
        pair: Option<Pair>,
    }

    #[derive(Debug, PartialEq, Deserialize)]
    struct Pair {
        a: f64,
        b: f64,
    }

    impl Part for Pair {
        const KEYS: &'static [&'static str] = &["a", "b"];
    }

    #[test]
    fn a_part_is_there_as_a_whole_or_not_at_all() {
        let read = |json| serde_json::from_value::<Whole>(json).map(|whole| whole.pair).map_err(|e| e.to_string());
        assert_eq!(read(json!({ "n": 1, "c": 0 })), Ok(None));
        assert_eq!(read(json!({ "a": 1, "n": 1, "b": 0.5 })), Ok(Some(Pair { a: 1.0, b: 0.5 })));
        assert_eq!(read(json!({ "n": 1, "a": 1, "b": null })), Err("b: invalid type: null, expected f64".into()));
        assert_eq!(read(json!({ "n": 1, "b": 1 })), Err("missing field `a`".into()));
    }
}
