//! False alarms in `periodogram.json`.

use crate::planets::periodogram::{FalseAlarm, Search};
use serde::Serialize;

/// False-alarm probabilities whose levels are given.
const LEVELS: [f64; 3] = [0.1, 0.01, 0.001];

#[derive(Serialize)]
pub(super) struct FalseAlarmRecord {
    pub delta_ln_l: f64,
    pub probability: f64,
    pub by_draws: f64,
    pub by_extreme_value: f64,
    pub used: &'static str,
    pub draws: usize,
    pub w: f64,
    pub independent_periods: f64,
    pub levels: [LevelRecord; 3],
}

#[derive(Serialize)]
pub(super) struct LevelRecord {
    pub false_alarm_probability: f64,
    pub delta_ln_l: f64,
}

/// Of the highest peak of `search`.
pub(super) fn false_alarm(search: &Search) -> FalseAlarmRecord {
    let alarm: &FalseAlarm = &search.false_alarm;
    let delta_ln_l = search.best().orbit.delta_ln_l;
    let found = alarm.probability(delta_ln_l);
    FalseAlarmRecord {
        delta_ln_l,
        probability: found.value(),
        by_draws: found.by_draws,
        by_extreme_value: found.by_tail,
        used: if found.draws_suffice { "draws" } else { "extreme value" },
        draws: alarm.maxima.len(),
        w: alarm.tail.w,
        independent_periods: alarm.independent_periods(),
        levels: LEVELS.map(|p| LevelRecord { false_alarm_probability: p, delta_ln_l: alarm.level(p) }),
    }
}
