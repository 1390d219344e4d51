//! A config before it is checked: read from JSON, or built in code key by key.

use super::{ConfigError, Settings, from_json, to_text, without_mark};
use crate::model::{Parameter, Prior};
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// What errors name where a config was not read from a file; paths in it start from the working directory.
const NO_FILE: &str = "config";

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
    /// A file that cannot be read, is not JSON, or has a key that is unknown, missing, or does not make sense.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let bytes = std::fs::read(path).map_err(|source| ConfigError::Read { path: path.into(), source })?;
        Config::checked(&bytes, path)
    }

    /// Reads a config that is at hand as JSON. Paths in it start from the working directory.
    ///
    /// # Errors
    /// As [`Config::load`], but for reading.
    pub fn from_json(json: &str) -> Result<Self, ConfigError> {
        Config::from_json_at(json, NO_FILE.as_ref())
    }

    /// Reads a config that is at hand as JSON, as if it came from the file at `path`: errors name it, and paths in the
    /// config start from its folder.
    ///
    /// # Errors
    /// As [`Config::load`], but for reading.
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

    /// The file that it was read from, or what errors name in its place.
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
    /// A key that is unknown, missing, or does not make sense.
    pub fn resolved(&self) -> Result<Value, ConfigError> {
        Ok(self.settings()?.resolved)
    }

    /// Checked, with all defaults.
    ///
    /// # Errors
    /// A key that is unknown, missing, or does not make sense.
    #[doc(hidden)]
    pub fn settings(&self) -> Result<Settings, ConfigError> {
        from_json(self.json.to_string().as_bytes(), &self.path)
    }
}
