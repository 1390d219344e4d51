//! Test for another rotation period than the given one: ln Z at other periods.
//!
//! At a wrong rotation period no map lasts. The fitted lifetime of the spots falls until maps of single nights explain
//! the profiles, each by itself, and such maps absorb planets, too. So where the lifetime is too short for maps to
//! agree, other periods are tried with long-lived spots; where ln Z is highest the field is fitted, as at the given
//! period.

use super::fit::{fit, share_of_many};
use super::{Assumed, Basis, Design, Known, Marginal};
use crate::field::{Field, Kernel, Lifetime};
use crate::model::ParameterValues;
use crate::surface::imaging::Imager;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Spots that live this many rotations constrain the rotation period to a few per cent: it cannot be wrong by more.
const LASTING: f64 = 6.0;

/// Largest factor on the rotation period that is tried, and its inverse.
const FURTHEST: f64 = 2.5;

/// Steps in ln of the period, the lifetimes in rotations for which they are fine enough, and how many of the highest
/// periods are then refined.
const COARSE: (f64, f64, usize) = (0.05, 4.0, 3);
const FINER: [(f64, f64, usize); 2] = [(0.0125, 12.0, 1), (0.004, 24.0, 1)];

/// Finer steps to either side of them.
const STEPS: i32 = 4;

/// Harmonics up to this degree: enough to find the period, at a third of the cost.
const DEGREE: usize = 22;

/// The gain in ln Z that another period requires: odds of 20,000 to 1.
const GAIN: f64 = 10.0;

/// A period that differs by more, in ln, is another one. On the star of `tests/data/newcomer/planet.json` sigma_K is
/// 0.016 km/s at an error of 1 %, as at the right period (0.015), and 0.025 at 3 %.
const FAR: f64 = 0.02;

/// A rotation period with which the spots last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherRotation {
    /// The period (d).
    pub rotation_period_d: f64,
    /// The given period (d).
    pub given_period_d: f64,
    /// ln Z there relative to the given one.
    pub ln_evidence_gain: f64,
    /// Lifetimes of the spots (d), there and with the given one.
    pub spot_lifetime_d: [f64; 2],
}

impl OtherRotation {
    /// The period with which the profiles of `imager` are far more probable than with that in `values`, where the field
    /// is `near` this one; `None` where the spots last, their lifetime is given, or no period is better.
    pub fn of(imager: &Imager, values: ParameterValues, near: Assumed, known: Known) -> Option<Self> {
        let given_period_d = TAU / values.star.omega_eq_rad_d;
        let lifetime_d = near.field.kernel.lifetime.days()?;
        if known.lifetime.is_some() || lifetime_d > LASTING * given_period_d {
            return None;
        }
        let turning = |period_d: f64| {
            let mut values = values.without_planet();
            values.star.omega_eq_rad_d = TAU / period_d;
            values
        };
        let (share, basis) = (share_of_many(imager), Arc::new(Basis::coarse(&imager.grid, DEGREE)));
        let fewer = share.as_ref().unwrap_or(imager);
        // ln Z with spots that live so many rotations
        let height = |period_d: f64, rotations: f64| {
            let lifetime = Lifetime::Days(known.within(2, rotations * period_d));
            let field = Field { spectrum: known.spectrum(), kernel: Kernel::of(lifetime) };
            let assumed = known.assumed(field, 0.0);
            let values = turning(period_d);
            let design = Arc::new(Design::new(fewer, &basis, &values.state()));
            Marginal::new(fewer, &basis, design, values, assumed, None).map_or(f64::NEG_INFINITY, |m| m.ln_evidence())
        };
        let scan = |periods: Vec<f64>, rotations: f64| -> Vec<(f64, f64)> {
            periods.into_par_iter().with_max_len(1).map(|period| (period, height(period, rotations))).collect()
        };
        let around = |period_d: f64, step: f64, steps: i32| {
            (-steps..=steps).map(move |i| period_d * (step * f64::from(i)).exp())
        };
        let (step, rotations, closer) = COARSE;
        let all = around(given_period_d, step, (FURTHEST.ln() / step) as i32).collect();
        let mut highest = peaks(&scan(all, rotations), closer);
        for (step, rotations, closer) in FINER {
            let beside = highest.iter().flat_map(|period| around(*period, step, STEPS)).collect();
            highest = peaks(&scan(beside, rotations), closer);
        }
        let rotation_period_d = *highest.first()?;
        let fitted = |period_d: f64, start| fit(imager, &basis, turning(period_d), Known { start, ..known }, None).ok();
        let (here, there) = (fitted(given_period_d, Some(near.into()))?, fitted(rotation_period_d, None)?);
        let found = OtherRotation {
            rotation_period_d,
            given_period_d,
            ln_evidence_gain: there.ln_evidence - here.ln_evidence,
            spot_lifetime_d: [there, here].map(|at| at.marginal.assumed.field.kernel.lifetime.days().unwrap_or(0.0)),
        };
        (found.ln_evidence_gain > GAIN && found.spot_lifetime_d[0] > 0.0).then_some(found)
    }

    /// Whether it differs by so much that maps with the given one do not constrain velocities.
    pub fn is_far(&self) -> bool {
        (self.rotation_period_d / self.given_period_d).ln().abs() > FAR
    }

    /// The message.
    pub fn sentence(&self) -> String {
        let OtherRotation { rotation_period_d, given_period_d, ln_evidence_gain, spot_lifetime_d: [there, here] } =
            self;
        format!(
            "a rotation period of {rotation_period_d:.3} d fits better than {given_period_d:.3} d (Δln Z = \
            {ln_evidence_gain:.0}; spot lifetime {there:.1} d, not {here:.2} d): correct star.rotation_period_d"
        )
    }
}

/// The highest of the periods at which ln Z is not lower than at its neighbours, at most so many.
fn peaks(scan: &[(f64, f64)], most: usize) -> Vec<f64> {
    let at = |i: usize| scan[i].1;
    let is_peak =
        |&i: &usize| at(i).is_finite() && (i == 0 || at(i) >= at(i - 1)) && (i + 1 == scan.len() || at(i) >= at(i + 1));
    let mut peaks: Vec<(f64, f64)> = (0..scan.len()).filter(is_peak).map(|i| scan[i]).collect();
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    peaks.into_iter().take(most).map(|of| of.0).collect()
}
