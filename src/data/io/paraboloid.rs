//! The paraboloid of a landscape as a file: `paraboloid.json`, or in it why there is none.

use super::atomic::{WriteError, write_json};
use crate::sampling::landscape::{Grid, Paraboloid, Rule, Undefined};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The content of `paraboloid.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParaboloidFile<'a> {
    /// Names of the parameters, in the order of the covariance.
    pub names: Vec<&'a str>,
    /// Why there is no paraboloid; null where there is one.
    pub refused: Option<String>,
    /// The paraboloid.
    #[serde(flatten)]
    pub paraboloid: Option<&'a Paraboloid>,
    /// Which nodes the user asked for.
    pub rule: Rule,
    /// Injected values, for simulated data.
    pub truth: Option<&'a BTreeMap<String, f64>>,
}

impl<'a> ParaboloidFile<'a> {
    /// What was `found` around the highest node of a landscape on `grid`.
    pub fn new(
        grid: &'a Grid,
        rule: Rule,
        truth: Option<&'a BTreeMap<String, f64>>,
        found: &'a Result<Paraboloid, Undefined>,
    ) -> Self {
        let refused = found.as_ref().err().map(Undefined::to_string);
        ParaboloidFile { names: grid.names().collect(), refused, paraboloid: found.as_ref().ok(), rule, truth }
    }

    /// Writes it to `path`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write_json(path, self)
    }
}

/// What the user asked for when the file at `path` was written; the default where there is none.
pub fn rule(path: &Path) -> Rule {
    #[derive(Deserialize)]
    struct Asked {
        rule: Rule,
    }
    let text = std::fs::read(path).ok();
    text.and_then(|text| serde_json::from_slice(&text).ok()).map(|asked: Asked| asked.rule).unwrap_or_default()
}
