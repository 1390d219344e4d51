//! The paraboloid of a likelihood grid as a file, `paraboloid.json`, or the reason why there is none.

use super::atomic::{WriteError, write_json};
use super::saved::{Saved, square};
use crate::sampling::landscape::{Grid, Paraboloid, Rule, Undefined};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// The content of `paraboloid.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParaboloidFile {
    /// Names of the parameters, in the order of the covariance.
    pub names: Vec<String>,
    /// Why there is no paraboloid; null where there is one.
    pub refused: Option<String>,
    /// The paraboloid.
    #[serde(flatten)]
    pub paraboloid: Option<Paraboloid>,
    /// Which nodes the user asked for.
    pub rule: Rule,
    /// Injected values, for simulated data.
    pub truth: Option<BTreeMap<String, f64>>,
}

impl Saved for ParaboloidFile {
    fn check(&self) -> Result<(), String> {
        let Some(paraboloid) = &self.paraboloid else { return Ok(()) };
        square("covariance", &paraboloid.covariance, self.names.len())?;
        match self.names.iter().find(|name| !paraboloid.parameters.contains_key(*name)) {
            Some(name) => Err(format!("parameters: missing {name}")),
            None => Ok(()),
        }
    }
}

impl ParaboloidFile {
    /// The result `found` around the highest node of a likelihood grid on `grid`.
    pub fn new(
        grid: &Grid,
        rule: Rule,
        truth: Option<&BTreeMap<String, f64>>,
        found: &Result<Paraboloid, Undefined>,
    ) -> Self {
        let refused = found.as_ref().err().map(Undefined::to_string);
        let names = grid.names().map(str::to_owned).collect();
        ParaboloidFile { names, refused, paraboloid: found.as_ref().ok().cloned(), rule, truth: truth.cloned() }
    }

    /// Writes it to `path`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write_json(path, self)
    }
}

/// The user's choice of nodes when the file at `path` was written; the default where there is none.
pub fn rule(path: &Path) -> Rule {
    let text = std::fs::read(path).ok();
    text.and_then(|text| serde_json::from_slice(&text).ok()).map(|file: ParaboloidFile| file.rule).unwrap_or_default()
}
