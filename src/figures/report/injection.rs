//! What is said of orbits that were put into profiles, and of limits found that way.

use super::chapter::{Chapter, Table, number, pairs};
use crate::data::io::truth::InjectedTruth;
use crate::runs::limits::{Limit, LimitsFile};
use crate::star::Orbit;

/// Periods in the table, at most.
const SHOWN: usize = 20;

/// Of `truth.json` beside profiles with an orbit put in.
pub(super) fn injection(truth: &InjectedTruth) -> Chapter {
    let Orbit { k_kms, porb_over_prot, phi } = truth.injected;
    let rows = [("*K* (km/s)", k_kms), ("*P*_{orb}/*P*_{rot}", porb_over_prot), ("phase", phi)];
    let rows = rows.map(|(name, value)| (name, number(value, 4)));
    Chapter {
        heading: "Injection".into(),
        tables: vec![("The orbit put into observed profiles.".into(), pairs(&rows))],
        ..Chapter::default()
    }
}

/// Of `limits.json`.
pub(super) fn limits(file: &LimitsFile) -> Chapter {
    let row = |limit: &Limit| {
        let Limit { period_d, porb_over_prot, k50_kms, k95_kms } = *limit;
        vec![number(period_d, 4), number(porb_over_prot, 3), number(k50_kms, 3), number(k95_kms, 3)]
    };
    let head = ["period (d)", "*P*_{orb}/*P*_{rot}", "*K* (km/s), 50 %", "95 %"].map(str::to_owned).to_vec();
    let rows = file.limits.iter().step_by(file.limits.len().div_ceil(SHOWN).max(1)).map(row).collect();
    let mut tables = vec![("Recovered at 50 and 95 % of the phases.".to_owned(), Table { head, rows })];
    if let Some(agreement) = &file.agreement {
        let rows = [
            ("orbits near the limit", agreement.orbits),
            ("recovered by the shortcut", agreement.by_shortcut),
            ("recovered the whole way", agreement.by_full),
            ("alike", agreement.agree),
        ];
        let rows = rows.map(|(name, count)| (name, count.to_string()));
        tables.push(("The linear shortcut against resampled profiles.".into(), pairs(&rows)));
    }
    Chapter { heading: "Detection limits".into(), tables, warnings: file.warnings.clone(), ..Chapter::default() }
}
