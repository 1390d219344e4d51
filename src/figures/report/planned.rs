//! The text on a planned campaign.

use super::chapter::{Chapter, Table, Tone, number};
use crate::runs::plan::{AfterRecord, ExpectedRecord, PlanFile, ScheduleRecord};

/// Decimals of velocities (km/s).
const DIGITS: usize = 4;

/// For `plan.json`.
pub(super) fn chapter(file: &PlanFile) -> Chapter {
    let best = file.best();
    let sentences = best.sentences(file.false_alarm_probability);
    let mut verdicts: Vec<(Tone, String)> = sentences.into_iter().map(|text| (Tone::Neutral, text)).collect();
    let mut tables = Vec::new();
    if file.schedules.len() > 1 {
        verdicts.insert(0, (Tone::Neutral, format!("The best schedule: {}.", best.name)));
        tables.push(("Schedules, medians over all periods.".to_owned(), compared(&file.schedules)));
    }
    let row = |after: &AfterRecord| {
        let counts = [after.nights, after.profiles].map(|n| n.to_string());
        let numbers = [after.sigma_k_kms, after.k50_kms, after.k95_kms].map(|k| number(k, DIGITS));
        counts.into_iter().chain(numbers).collect()
    };
    let rows = best.after.iter().map(row).collect();
    tables.push((
        format!("{}: medians over all periods.", best.name),
        Table { head: head(&["nights", "profiles"]), rows },
    ));
    let row = |at: &ExpectedRecord| {
        let numbers = [at.sigma_k_kms, at.k50_kms, at.k95_kms].map(|k| number(k, DIGITS));
        std::iter::once(at.period_d.to_string()).chain(numbers).collect()
    };
    let rows = best.periods.iter().map(row).collect();
    tables.push(("After all nights.".to_owned(), Table { head: head(&["period (d)"]), rows }));
    Chapter { heading: "Plan".into(), verdicts, tables, ..Chapter::default() }
}

fn head(first: &[&str]) -> Vec<String> {
    let last = ["*σ*_{K} (km/s)", "*K* detected, 50 %", "95 %"];
    first.iter().chain(&last).map(|name| (*name).to_owned()).collect()
}

fn compared(schedules: &[ScheduleRecord]) -> Table {
    let row = |schedule: &ScheduleRecord| {
        let whole = schedule.whole();
        let count = |n: fn(&AfterRecord) -> usize| whole.map_or_else(String::new, |whole| n(whole).to_string());
        let k = |k: fn(&AfterRecord) -> Option<f64>| number(whole.and_then(k), DIGITS);
        vec![
            schedule.name.clone(),
            count(|whole| whole.nights),
            count(|whole| whole.profiles),
            k(|whole| whole.sigma_k_kms),
            k(|whole| whole.k50_kms),
            k(|whole| whole.k95_kms),
        ]
    };
    Table { head: head(&["schedule", "nights", "profiles"]), rows: schedules.iter().map(row).collect() }
}
