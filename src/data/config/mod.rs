//! The config: JSON as users write it, or a [`Config`] built in code -> checked, resolved [`Settings`]; and its JSON
//! Schema.
//!
//! A [`Config`] is a `document` of keys. `written` has a type for each section, with its keys, their defaults and their
//! descriptions in the schema; `settings` has, in a file of the same name, the checks and the values that programs use.
//! Defaults of an algorithm are defined beside it. Unknown keys are refused, and every error names the file and the
//! key. `instruments` has the spectrographs that a config may name.

mod document;
mod draft;
mod error;
mod identity;
mod instruments;
mod settings;
mod written;

pub use crate::sampling::ensemble::SamplerSettings;
pub use document::{Config, from_json, to_text};
pub use draft::{Beside, Draft, Sought};
pub use error::ConfigError;
pub use identity::{Difference, first_difference, fit_fingerprint, jitter_difference, section_difference};
pub use instruments::{SPECTROGRAPHS, Spectrograph};
pub use settings::{
    DataSetSettings, FITTED, GridSettings, IndicatorSettings, LightCurveSettings, LightSource, MOST_NODES,
    ObservationSource, PlannedProfiles, Settings, too_long,
};
pub use written::{
    Automatic, EquivalentWidth, EventWindows, Hyperparameter, ImagingSettings, IndicatorSection, Instrument,
    LimbDarkeningSection, LimbLaw, Line, LineShape, Listed, ObservationsSection, OfField, OutlierTreatment,
    PhotometrySection, PlanSection, PlannedLight, SEGMENT_GAP_D, SimulatedLight, Star, USUAL_LIMB_DARKENING,
    USUAL_WAVELENGTH_NM, VelocityDrift, VelocityJitter, ZeroPoint,
};

/// The JSON Schema of the config, as it ships in `configs/dimcmc.schema.json`.
pub fn schema() -> String {
    let schema = schemars::schema_for!(written::Config);
    // `{:#}` of a `Value` is its pretty-printed JSON.
    format!("{:#}\n", schema.as_value())
}
