//! The config: JSON as users write it, or a [`Config`] built in code -> checked, resolved [`Settings`]; and its JSON
//! Schema.
//!
//! Unknown keys are refused, defaults are written once (in `raw`, `raw_parts`, and beside the algorithm they are for),
//! and every error names the file and the key.

mod checks;
mod data_sets;
mod domain;
mod draft;
mod error;
mod identity;
mod listed;
mod number_or;
mod photometry;
mod raw;
mod raw_parts;
mod resolve;
mod resolve_grid;
mod resolve_orbits;
mod resolve_photometry;
mod resolve_sets;
mod resolve_simulation;
mod resolve_star;
mod settings;
mod star;
mod written;

pub use crate::sampling::ensemble::SamplerSettings;
pub use data_sets::ObservationsSection;
pub use draft::{Draft, Sought};
pub use error::ConfigError;
pub use identity::{Difference, first_difference, jitter_difference, section_difference};
pub use number_or::{Automatic, EquivalentWidth, Hyperparameter, OfField, VelocityJitter, ZeroPoint};
pub use photometry::SimulatedLight;
pub use raw_parts::PlanSection;
pub use resolve_grid::MOST_NODES;
pub use settings::{
    DataSetSettings, GridSettings, ImagingSettings, LightCurveSettings, LightSource, ObservationSource, SEASON_GAP_D,
    Settings,
};
pub use star::{Instrument, LimbDarkeningSection, LimbLaw, Line, LineShape, Star};
pub use written::Config;

use std::path::Path;

/// Reads and resolves the config at `path`. Paths in it start from its folder.
///
/// # Errors
/// A file that cannot be read, is not JSON, or has a key that is unknown, missing, or does not make sense.
pub fn load(path: &Path) -> Result<Settings, ConfigError> {
    let bytes = std::fs::read(path).map_err(|source| ConfigError::Read { path: path.into(), source })?;
    from_json(&bytes, path)
}

/// Resolves a config already read; `path` is what errors name and whose folder paths start from.
///
/// # Errors
/// As [`load`], but for reading.
pub fn from_json(json: &[u8], path: &Path) -> Result<Settings, ConfigError> {
    let mut deserializer = serde_json::Deserializer::from_slice(without_mark(json));
    let raw = serde_path_to_error::deserialize(&mut deserializer).map_err(|e| ConfigError::data(path, e))?;
    deserializer.end().map_err(|e| ConfigError::json(path, &e))?;
    resolve::resolve(raw, path).map_err(|fault| fault.within(path))
}

/// Editors on Windows put a byte-order mark first.
fn without_mark(json: &[u8]) -> &[u8] {
    json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json)
}

/// A config as text, laid out for people.
pub fn to_text(config: &serde_json::Value) -> String {
    draft::compact(&format!("{config:#}"))
}

/// The JSON Schema of the config, as it ships in `configs/dimcmc.schema.json`.
pub fn schema() -> String {
    let schema = schemars::schema_for!(raw::Config);
    // `{:#}` of a `Value` is its pretty-printed JSON.
    format!("{:#}\n", schema.as_value())
}
