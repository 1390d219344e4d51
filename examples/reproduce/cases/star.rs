//! The paper's star as a config, and its changes for an experiment.

use serde_json::Value;

/// The config of the star, with the setup of all rows.
const PAPER: &str = include_str!("../../../configs/paper_grid.json");

/// The star of all rows.
pub fn paper() -> Value {
    let mut config: Value = serde_json::from_str(PAPER).expect("the config of the paper's star is JSON");
    let top = config.as_object_mut().expect("a config is an object");
    top.remove("$schema");
    top.remove("grid");
    config
}

/// `config` with other values at keys given as JSON pointers (`/planet/k_kms`); sections that are missing are made.
pub fn with(mut config: Value, changes: &[(&str, Value)]) -> Value {
    for (pointer, value) in changes {
        let mut place = &mut config;
        for key in pointer.split('/').skip(1) {
            place = &mut place[key];
        }
        *place = value.clone();
    }
    config
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn keys_are_changed_and_sections_made() {
        let star = with(paper(), &[("/planet/k_kms", json!(0.2)), ("/observations/simulate/truth/phi", json!(0.3))]);
        assert_eq!(star["planet"]["k_kms"], 0.2);
        assert_eq!(star["observations"]["simulate"]["truth"]["phi"], 0.3);
        assert_eq!(star["planet"]["phi"], 0.5, "the others stay");
    }
}
