//! Numbers in JSON: what is not finite is written as null, and comes back as NaN.

use serde::{Deserialize, Deserializer};

/// For numbers that may be none, such as a mean over nothing.
pub fn number_or_null<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}
