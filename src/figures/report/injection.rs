//! Injected orbits, and detection limits by injection and recovery.

use super::chapter::Tone;
use super::chapter::{Chapter, Table, number, pairs};
use crate::data::io::truth::InjectedTruth;
use crate::runs::limits::{Limit, LimitsFile};
use crate::star::Orbit;

/// Largest number of periods in the table.
const SHOWN: usize = 20;

/// For `truth.json` with profiles that have an injected orbit.
pub(super) fn injection(truth: &InjectedTruth) -> Chapter {
    let Orbit { k_kms, porb_over_prot, phi } = truth.injected;
    let rows = [("*K* (km/s)", k_kms), ("*P*_{orb}/*P*_{rot}", porb_over_prot), ("phase", phi)];
    let rows = rows.map(|(name, value)| (name, number(value, 4)));
    Chapter {
        heading: "Injection".into(),
        tables: vec![("The injected orbit.".into(), pairs(&rows))],
        ..Chapter::default()
    }
}

/// For `limits.json`.
pub(super) fn limits(file: &LimitsFile) -> Chapter {
    let unit = file.unit();
    let row = |limit: &Limit| {
        let Limit { period_d, porb_over_prot, k50_kms, k95_kms } = *limit;
        vec![number(period_d, 4), number(porb_over_prot, 3), unit.cell(k50_kms), unit.cell(k95_kms)]
    };
    let k = format!("*K* ({}), 50 %", unit.name);
    let head = ["period (d)", "*P*_{orb}/*P*_{rot}", &k, "95 %"].map(str::to_owned).to_vec();
    let rows = file.limits.iter().step_by(file.limits.len().div_ceil(SHOWN).max(1)).map(row).collect();
    let diagnostics = vec![("K recovered at 50 and 95 % of the phases.".to_owned(), Table { head, rows })];
    let mut tables = Vec::new();
    if let Some(agreement) = &file.agreement {
        let rows = [
            ("orbits near the limit", agreement.orbits),
            ("recovered by the linearised search", agreement.by_shortcut),
            ("recovered by the full pipeline", agreement.by_full),
            ("same result", agreement.agree),
        ];
        let rows = rows.map(|(name, count)| (name, count.to_string()));
        tables.push((
            "The linearised search compared with the full pipeline on resampled profiles.".into(),
            pairs(&rows),
        ));
    }
    Chapter {
        heading: "Detection limits".into(),
        verdicts: vec![(Tone::Neutral, file.sentence())],
        tables,
        warnings: file.warnings.clone(),
        diagnostics,
        ..Chapter::default()
    }
}
