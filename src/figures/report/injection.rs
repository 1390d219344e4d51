//! What is said of orbits that were put into profiles, and of limits found that way.

use super::chapters::{number, pairs, texts};
use super::{Chapter, Table};
use serde_json::Value;

/// Periods in the table, at most.
const SHOWN: usize = 20;

/// Of `truth.json` beside profiles with an orbit put in.
pub(super) fn injection(truth: &Value) -> Chapter {
    let value = |key: &str| number(truth, &format!("/injected/{key}"), 4);
    let rows =
        [("*K* (km/s)", value("k_kms")), ("*P*_{orb}/*P*_{rot}", value("porb_over_prot")), ("phase", value("phi"))];
    Chapter {
        heading: "Injection".into(),
        tables: vec![("The orbit put into observed profiles.".into(), pairs(&rows))],
        ..Chapter::default()
    }
}

/// Of `limits.json`.
pub(super) fn limits(file: &Value) -> Chapter {
    let limits = file.get("limits").and_then(Value::as_array).cloned().unwrap_or_default();
    let row = |limit: &Value| {
        [("/period_d", 4), ("/porb_over_prot", 3), ("/k50_kms", 3), ("/k95_kms", 3)]
            .map(|(key, digits)| number(limit, key, digits))
            .to_vec()
    };
    let head = ["period (d)", "*P*_{orb}/*P*_{rot}", "*K* (km/s), 50 %", "95 %"].map(str::to_owned).to_vec();
    let rows = limits.iter().step_by(limits.len().div_ceil(SHOWN).max(1)).map(row).collect();
    let mut tables = vec![("Recovered at 50 and 95 % of the phases.".to_owned(), Table { head, rows })];
    if file.get("agreement").is_some_and(Value::is_object) {
        let count = |key: &str| number(file, &format!("/agreement/{key}"), 0);
        let rows = [
            ("orbits near the limit", count("orbits")),
            ("recovered by the shortcut", count("by_shortcut")),
            ("recovered the whole way", count("by_full")),
            ("alike", count("agree")),
        ];
        tables.push(("The linear shortcut against resampled profiles.".into(), pairs(&rows)));
    }
    Chapter { heading: "Detection limits".into(), tables, warnings: texts(file, "warnings"), ..Chapter::default() }
}
