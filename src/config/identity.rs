//! The fingerprint of a config: what must be the same for a chain to be resumed.

use serde_json::Value;
use sha2::{Digest, Sha256};

/// SHA-256 (hex) of the resolved config without what may change on resuming: `$schema`, `grid`, and the sampler's `steps`,
/// `rhat` and `ess`. Independent of the order of keys.
pub(super) fn fingerprint(resolved: &Value) -> String {
    let mut value = resolved.clone();
    if let Some(top) = value.as_object_mut() {
        top.remove("$schema");
        top.remove("grid");
        if let Some(sampler) = top.get_mut("sampler").and_then(Value::as_object_mut) {
            sampler.retain(|key, _| !["steps", "rhat", "ess"].contains(&key.as_str()));
        }
    }
    let mut text = String::new();
    canonical(&value, &mut text);
    format!("{:x}", Sha256::digest(text))
}

/// Compact JSON with sorted keys, whatever the features serde_json was built with.
fn canonical(value: &Value, text: &mut String) {
    match value {
        Value::Object(map) => {
            let mut entries: Vec<_> = map.iter().collect();
            entries.sort_by_key(|(key, _)| *key);
            text.push('{');
            for (key, value) in entries {
                text.push_str(&Value::from(key.as_str()).to_string());
                text.push(':');
                canonical(value, text);
                text.push(',');
            }
            text.push('}');
        }
        Value::Array(items) => {
            text.push('[');
            for item in items {
                canonical(item, text);
                text.push(',');
            }
            text.push(']');
        }
        scalar => text.push_str(&scalar.to_string()),
    }
}
