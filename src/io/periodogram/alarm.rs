//! False alarms in `periodogram.json`.

use crate::periodogram::false_alarm::Amplitude;
use crate::periodogram::{FalseAlarm, Search};
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
    pub null_model: &'static str,
    pub draws: usize,
    /// Largest variance of a whitened amplitude, and longest mean.
    pub kappa: f64,
    pub mean: f64,
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
    let largest = |f: fn(&Amplitude) -> f64| alarm.tail.amplitudes.iter().map(f).fold(0.0, f64::max);
    FalseAlarmRecord {
        delta_ln_l,
        probability: found.value(),
        by_draws: found.by_draws,
        by_extreme_value: found.by_tail,
        used: if found.draws_suffice { "draws" } else { "extreme value" },
        null_model: alarm.model.name(),
        draws: alarm.maxima.len(),
        kappa: largest(|a| a.kappa),
        mean: largest(|a| a.mean),
        w: alarm.tail.w,
        independent_periods: alarm.independent_periods(),
        levels: LEVELS.map(|p| LevelRecord { false_alarm_probability: p, delta_ln_l: alarm.level(p) }),
    }
}
