//! Checks of every JSON file of results before it is used again: it may have been edited or truncated.

use serde::de::DeserializeOwned;
use serde_json::Value;

/// Larger finite numbers are not results of this program and cannot be plotted.
pub const LARGEST: f64 = 1e100;

/// Keys of numbers above 0, anywhere in the file.
const POSITIVE: [&str; 5] = ["period_d", "rotation_period_d", "porb_over_prot", "min_period_d", "max_period_d"];

/// Configs are checked on resolving.
const CONFIG: &str = "config";

/// The content of a JSON file that is read again.
pub trait Saved: DeserializeOwned {
    /// Checks that its parts are consistent.
    ///
    /// # Errors
    /// The key at fault, and its error.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }
}

impl Saved for serde_json::Map<String, Value> {}

/// Checks that all numbers of a file are possible output of the program.
///
/// # Errors
/// The first key with another number.
pub fn check_numbers(value: &Value) -> Result<(), String> {
    walk(value, &mut Vec::new())
}

fn walk(value: &Value, way: &mut Vec<String>) -> Result<(), String> {
    let mut step = |key: String, value: &Value| {
        way.push(key);
        let checked = walk(value, way);
        way.pop();
        checked
    };
    match value {
        Value::Object(all) => {
            all.iter().filter(|(key, _)| *key != CONFIG).try_for_each(|(key, value)| step(key.clone(), value))
        }
        Value::Array(all) => all.iter().enumerate().try_for_each(|(k, value)| step(k.to_string(), value)),
        Value::Number(number) => {
            let number = number.as_f64().unwrap_or(f64::INFINITY);
            let is_positive = way.last().is_some_and(|key| POSITIVE.contains(&key.as_str()));
            match () {
                () if number.abs() > LARGEST => Err(format!("{}: {number:e} is out of range", way.join("."))),
                () if is_positive && number <= 0.0 => Err(format!("{}: {number} must be above 0", way.join("."))),
                () => Ok(()),
            }
        }
        _ => Ok(()),
    }
}

/// Checks that a list has as many entries as another one.
///
/// # Errors
/// Another length.
pub fn as_many(key: &str, found: usize, expected: usize, of: &str) -> Result<(), String> {
    match found == expected {
        true => Ok(()),
        false => Err(format!("{key}: {found} entries instead of {expected}, as many as {of}")),
    }
}

/// Checks that a matrix is square, with a row for each of `n` names.
///
/// # Errors
/// Another shape.
pub fn square(key: &str, matrix: &[Vec<f64>], n: usize) -> Result<(), String> {
    as_many(key, matrix.len(), n, "names")?;
    matrix.iter().try_for_each(|row| as_many(key, row.len(), n, "names"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_beyond_sense_are_named_by_key() {
        let wrong = |value: Value| check_numbers(&value).unwrap_err();
        assert_eq!(wrong(json!({ "best": { "k_kms": 1e300 } })), "best.k_kms: 1e300 is out of range");
        assert_eq!(wrong(json!({ "peaks": [{ "period_d": -1 }] })), "peaks.0.period_d: -1 must be above 0");
        check_numbers(&json!({ "config": { "period_d": -1 }, "k_kms": -1, "sd": null })).unwrap();
    }
}
