//! The config: JSON as users write it, or a [`Config`] built in code -> checked, resolved [`Settings`]; and its JSON
//! Schema.
//!
//! As written: `raw` and its sections (`star`, `data_sets`, `photometry`, `raw_parts`), which are read and written.
//! Checked: `resolve` and its parts make `settings` of it. Unknown keys are refused, defaults are written once (in the
//! sections, and beside the algorithm they are for), and every error names the file and the key.

mod checks;
mod data_sets;
mod domain;
mod draft;
mod error;
mod identity;
mod listed;
mod number_or;
mod per_parameter;
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
pub use photometry::{OutlierTreatment, SimulatedLight};
pub use raw_parts::PlanSection;
pub use resolve_grid::MOST_NODES;
pub use settings::{
    DataSetSettings, GridSettings, ImagingSettings, LightCurveSettings, LightSource, ObservationSource, SEASON_GAP_D,
    Settings,
};
pub use star::{Instrument, LimbDarkeningSection, LimbLaw, Line, LineShape, Star};
pub use written::{Config, from_json, to_text};

/// The JSON Schema of the config, as it ships in `configs/dimcmc.schema.json`.
pub fn schema() -> String {
    let schema = schemars::schema_for!(raw::Config);
    // `{:#}` of a `Value` is its pretty-printed JSON.
    format!("{:#}\n", schema.as_value())
}
