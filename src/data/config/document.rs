//! A config as a JSON document, before it is checked: read from a file, or built in code key by key; how it is laid out
//! as text, and the path to the checked settings.

use super::error::ConfigError;
use super::settings::{Settings, resolve};
use crate::model::{Parameter, Prior};
use crate::surface::ObjectiveKind;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// What errors name where a config was not read from a file; paths in it start from the working directory.
const NO_FILE: &str = "config";

/// Keys of `imaging` that imply a static map.
const OF_ONE_MAP: [&str; 3] = ["default_spot", "chi2_target", "unresolved_spots"];

/// Longest line of a config as text.
const WIDTH: usize = 110;

/// A config: star, observations, image, free parameters and sampler, by the keys of `docs/reference/config.md`.
///
/// Read from a file, or built key by key; keys of sections are dotted. Nothing is checked before a
/// [`Scene`](crate::Scene) is made of it, but for [`Config::load`] and [`Config::from_json`].
///
/// ```
/// use dimcmc::{Config, Parameter, Prior};
///
/// let config = Config::default()
///     .with("star.rotation_period_d", 2.0)
///     .with("star.vsini_kms", 40.0)
///     .free(Parameter::K, Prior::Uniform { min: 0.0, max: 1.0 });
/// assert_eq!(config.get("parameters.k_kms.max").and_then(|max| max.as_f64()), Some(1.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    json: Value,
    path: PathBuf,
}

impl Default for Config {
    /// Without any key.
    fn default() -> Self {
        Config { json: Value::Object(Map::new()), path: NO_FILE.into() }
    }
}

impl Config {
    /// Reads the config at `path`. Paths in it start from its folder.
    ///
    /// # Errors
    /// A file that cannot be read, is not JSON, or has a key that is unknown, missing, or invalid.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let bytes = std::fs::read(path).map_err(|source| ConfigError::Read { path: path.into(), source })?;
        Config::checked(&bytes, path)
    }

    /// Reads a config in JSON. Paths in it start from the working directory.
    ///
    /// # Errors
    /// As [`Config::load`], except for reading.
    pub fn from_json(json: &str) -> Result<Self, ConfigError> {
        Config::from_json_at(json, NO_FILE.as_ref())
    }

    /// Reads a config in JSON, as if it came from the file at `path`: errors name it, and paths in the config start
    /// from its folder.
    ///
    /// # Errors
    /// As [`Config::load`], except for reading.
    pub fn from_json_at(json: &str, path: &Path) -> Result<Self, ConfigError> {
        Config::checked(json.as_bytes(), path)
    }

    fn checked(bytes: &[u8], path: &Path) -> Result<Self, ConfigError> {
        from_json(bytes, path)?;
        let json = serde_json::from_slice(without_mark(bytes)).map_err(|e| ConfigError::json(path, &e))?;
        Ok(Config { json, path: path.into() })
    }

    /// `json` as if it were read from `path`, unchecked.
    #[doc(hidden)]
    pub fn at(json: Value, path: &Path) -> Self {
        Config { json, path: path.into() }
    }

    /// The same with a value at `key`, such as `"star.vsini_kms"`. Sections that are not there are made.
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        let mut place = &mut self.json;
        for name in key.split('.') {
            if !place.is_object() {
                *place = Value::Object(Map::new());
            }
            place = &mut place[name];
        }
        *place = value.into();
        self
    }

    /// The same with a free parameter. Its value under `star` or `planet` is where a search starts.
    pub fn free(self, parameter: Parameter, prior: Prior) -> Self {
        let prior = serde_json::to_value(prior).expect("a prior is plain data");
        self.with(&format!("parameters.{}", parameter.name()), prior)
    }

    /// The value at `key`, `None` where it is not given.
    pub fn get(&self, key: &str) -> Option<&Value> {
        key.split('.').try_fold(&self.json, |place, name| place.get(name))
    }

    /// The remark on a config that names no objective, whose default differed in older versions.
    pub fn assumed_objective(&self) -> Option<String> {
        if self.get("imaging.objective").is_some() {
            return None;
        }
        let keys: Vec<&str> =
            OF_ONE_MAP.into_iter().filter(|key| self.get(&format!("imaging.{key}")).is_some()).collect();
        let for_it = if keys.is_empty() { String::new() } else { format!(", which {} is for", keys.join(", ")) };
        Some(format!(
            "imaging.objective is not given: it is \"{}\"; older versions took \"{}\"{for_it}; name one of them",
            ObjectiveKind::default().name(),
            ObjectiveKind::Spottedness.name(),
        ))
    }

    /// The file that it was read from, or its placeholder in errors.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// As text, laid out for people.
    pub fn to_json(&self) -> String {
        to_text(&self.json)
    }

    /// With all defaults filled in, as results keep it.
    ///
    /// # Errors
    /// A key that is unknown, missing, or invalid.
    pub fn resolved(&self) -> Result<Value, ConfigError> {
        Ok(self.settings()?.resolved)
    }

    /// Checked, with all defaults.
    ///
    /// # Errors
    /// A key that is unknown, missing, or invalid.
    #[doc(hidden)]
    pub fn settings(&self) -> Result<Settings, ConfigError> {
        from_json(self.json.to_string().as_bytes(), &self.path)
    }
}

/// Resolves a config in JSON; `path` is what errors name and whose folder paths in it start from.
///
/// # Errors
/// Text that is not JSON, or has a key that is unknown, missing, or invalid.
pub fn from_json(json: &[u8], path: &Path) -> Result<Settings, ConfigError> {
    let mut deserializer = serde_json::Deserializer::from_slice(without_mark(json));
    let written = serde_path_to_error::deserialize(&mut deserializer).map_err(|e| ConfigError::data(path, e))?;
    deserializer.end().map_err(|e| ConfigError::json(path, &e))?;
    resolve(written, path).map_err(|fault| fault.within(path))
}

/// Editors on Windows put a byte-order mark first.
fn without_mark(json: &[u8]) -> &[u8] {
    json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json)
}

/// A config as text, laid out for people.
pub fn to_text(config: &Value) -> String {
    compact(&format!("{config:#}"))
}

/// Indented JSON with every object and list that fits on one line put on one line, but for the outermost.
pub(super) fn compact(pretty: &str) -> String {
    let lines: Vec<&str> = pretty.lines().collect();
    let indent = |line: &str| line.len() - line.trim_start().len();
    let (mut text, mut k) = (String::new(), 0);
    while k < lines.len() {
        let opens = k > 0 && lines[k].ends_with(['{', '[']);
        let closes = |j: &usize| opens && indent(lines[*j]) == indent(lines[k]);
        let whole = (k + 1..lines.len()).find(closes).map(|end| (end, joined(&lines[k..=end])));
        match whole.filter(|(_, line)| line.chars().count() <= WIDTH) {
            Some((end, line)) => {
                text += &line;
                k = end + 1;
            }
            None => {
                text += lines[k];
                k += 1;
            }
        }
        text.push('\n');
    }
    text
}

/// An object or a list on one line: braces with a space inside, brackets without.
fn joined(lines: &[&str]) -> String {
    let mut line = lines[0].to_string();
    for next in &lines[1..] {
        let next = next.trim_start();
        let tight = line.ends_with('[') || next.starts_with(']');
        line += if tight { "" } else { " " };
        line += next;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::compact;

    #[test]
    fn what_fits_stands_on_one_line() {
        let long = "x".repeat(100);
        let value =
            serde_json::json!({ "a": { "b": [1, 2], "c": "{" }, "d": [], "e": { "f": long, "g": { "h": null } } });
        let text = compact(&serde_json::to_string_pretty(&value).unwrap());
        let expected = format!(
            "{{\n  \"a\": {{ \"b\": [1, 2], \"c\": \"{{\" }},\n  \"d\": [],\n  \"e\": {{\n    \"f\": \"{long}\",\n    \
             \"g\": {{ \"h\": null }}\n  }}\n}}\n"
        );
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
