//! Rotation of the star from the config of a result.

use serde_json::Value;

/// Rotation period and time of cycle 0 (d) of a resolved config.
pub(super) fn ephemeris(config: &Value) -> Option<(f64, f64)> {
    let number = |key: &str| config.pointer(&format!("/star/{key}")).and_then(Value::as_f64);
    Some((number("rotation_period_d")?, number("epoch_d").unwrap_or(0.0)))
}
