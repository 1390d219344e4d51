//! What every result says of where it came from.

use serde::Serialize;

/// Config, data and program that made a result.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: &'static str,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// SHA-256 (hex) of the part of the config that decides the posterior and the chain.
    pub config_sha256: String,
    /// The config with all defaults filled in.
    pub config: serde_json::Value,
}
