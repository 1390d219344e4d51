//! False alarms in `periodogram.json`.

use crate::numerics::json::number_or_null;
use crate::planets::periodogram::{FalseAlarm, Search};
use serde::{Deserialize, Serialize};

/// False-alarm probabilities whose levels are given.
const LEVELS: [f64; 3] = [0.1, 0.01, 0.001];

/// How often a star without a planet shows as high a peak.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FalseAlarmRecord {
    /// Height of the peak.
    pub delta_ln_l: f64,
    /// The probability, by what is `used`.
    #[serde(deserialize_with = "number_or_null")]
    pub probability: f64,
    /// The share of draws with as high a peak.
    pub by_draws: f64,
    /// What the distribution of highest peaks says.
    #[serde(deserialize_with = "number_or_null")]
    pub by_extreme_value: f64,
    /// `draws` or `extreme value`.
    pub used: String,
    /// Number of draws.
    pub draws: usize,
    /// Effective bandwidth of the search (Baluev 2008).
    #[serde(deserialize_with = "number_or_null")]
    pub w: f64,
    /// How many independent periods there are.
    #[serde(deserialize_with = "number_or_null")]
    pub independent_periods: f64,
    /// Heights of usual probabilities.
    pub levels: [LevelRecord; 3],
}

/// A height that chance reaches with some probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelRecord {
    /// The probability.
    pub false_alarm_probability: f64,
    /// The height.
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
        used: if found.draws_suffice { "draws" } else { "extreme value" }.into(),
        draws: alarm.maxima.len(),
        w: alarm.tail.w,
        independent_periods: alarm.independent_periods(),
        levels: LEVELS.map(|p| LevelRecord { false_alarm_probability: p, delta_ln_l: alarm.level(p) }),
    }
}
