//! Whether the best orbit hangs on a choice, in `periodogram.json` and as text.

use super::PeriodogramResult;
use crate::inference::detection::WithoutNight;
use crate::numerics::text::aligned;
use crate::planets::periodogram::CircularOrbit;
use crate::surface::AtTarget;
use serde::{Deserialize, Serialize};

/// Whether the best orbit hangs on a choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobustnessRecord {
    /// K at the best period with other targets.
    pub targets: Vec<TargetRecord>,
    /// K at the best period without each night; empty for profiles of one night.
    pub without_night: Vec<NightRecord>,
}

/// The orbit at the best period with another target chi2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetRecord {
    /// Target, per datum.
    pub chi2_target: f64,
    /// Whether the image reaches it.
    pub reached: bool,
    /// The orbit.
    #[serde(flatten)]
    pub orbit: QuickRecord,
}

/// The orbit at the best period without the profiles of a night.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NightRecord {
    /// First time left out (d).
    pub first_time_d: f64,
    /// Last time left out (d).
    pub last_time_d: f64,
    /// Number of profiles left out.
    pub profiles: usize,
    /// The orbit.
    #[serde(flatten)]
    pub orbit: QuickRecord,
}

/// Null where none is bounded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QuickRecord {
    /// Semi-amplitude (km/s).
    pub k_kms: Option<f64>,
    /// Its error (km/s).
    pub sigma_k_kms: Option<f64>,
    /// Phase (cycles).
    pub phi: Option<f64>,
    /// Gain in ln L.
    pub delta_ln_l: Option<f64>,
}

impl QuickRecord {
    fn of(orbit: Option<CircularOrbit>) -> Self {
        let number = |f: fn(CircularOrbit) -> f64| orbit.map(f);
        QuickRecord {
            k_kms: number(|o| o.k_kms),
            sigma_k_kms: number(|o| o.sigma_k_kms),
            phi: number(|o| o.phi),
            delta_ln_l: number(|o| o.delta_ln_l),
        }
    }
}

impl PeriodogramResult<'_> {
    pub(super) fn robustness_record(&self) -> RobustnessRecord {
        let target = |at: &AtTarget| TargetRecord {
            chi2_target: at.chi2_target,
            reached: at.on_target,
            orbit: QuickRecord::of(at.orbit),
        };
        let night = |night: &WithoutNight| NightRecord {
            first_time_d: night.span_d.0,
            last_time_d: night.span_d.1,
            profiles: night.profiles,
            orbit: QuickRecord::of(night.orbit),
        };
        RobustnessRecord {
            targets: self.robustness.targets.iter().map(target).collect(),
            without_night: self.robustness.nights.iter().map(night).collect(),
        }
    }

    /// K at the best period under other choices, a line each.
    pub(super) fn robustness_table(&self) -> String {
        let mut rows = vec![["at the best period", "k_kms", "sigma", "delta_ln_l"].map(str::to_owned).to_vec()];
        let mut row = |what: String, orbit: Option<CircularOrbit>| {
            let shown = |f: fn(CircularOrbit) -> f64, digits: usize| {
                orbit.map_or_else(|| "-".to_owned(), |orbit| format!("{:.digits$}", f(orbit)))
            };
            rows.push(vec![what, shown(|o| o.k_kms, 4), shown(|o| o.sigma_k_kms, 4), shown(|o| o.delta_ln_l, 2)]);
        };
        for at in &self.robustness.targets {
            let short = if at.on_target { "" } else { " (not reached)" };
            row(format!("target chi2 {:.4}{short}", at.chi2_target), at.orbit);
        }
        for night in &self.robustness.nights {
            row(format!("without night {:.2}, {} profiles", night.span_d.0, night.profiles), night.orbit);
        }
        aligned(&rows)
    }
}
