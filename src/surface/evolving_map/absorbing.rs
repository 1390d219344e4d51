//! Fields of spots that absorb more of an orbit than the most probable field.
//!
//! Without a planet in the model, a fit of the field absorbs part of its orbit in spots. On two stars without a jitter
//! (24 and 34 profiles, spot lifetimes of 9 and 40 d) orbits of 0.1 to 0.4 km/s shortened the lifetime by factors of
//! 1.1 to 20; the slope rose by 0.3 for each factor of e, and the amplitude stayed. With the lifetime given, slope and
//! amplitude rose together. So fields lie on one line, and a few steps along it suffice.

use super::climb::{assumed_at, limits, place};
use super::{Fitted, Known, Marginal};
use crate::surface::imaging::Imager;
use std::f64::consts::LN_2;
use std::sync::Arc;

/// A step in ln amplitude, slope and ln lifetime.
const STEP: [f64; 3] = [0.0, 0.2, -LN_2];

/// The same where the lifetime is given.
const STEP_OF_GIVEN_LIFETIME: [f64; 3] = [0.1, 0.4, 0.0];

/// The last step lowers ln Z by at most this: an orbit of Delta ln L 40 costs the star without a planet half of it.
const FALL: f64 = 100.0;

impl Fitted {
    /// Results `of` the star with fields that absorb less and more: one step back, the fitted field, and steps onwards.
    /// `known` parameters are fixed, and so there may be only that field.
    ///
    /// # Errors
    /// Those of `of`. Where no star with a field is found, there are no further steps.
    pub(super) fn absorbing<T, E>(
        &self,
        imager: &Imager,
        known: &Known,
        of: impl Fn(&Marginal) -> Result<T, E>,
    ) -> Result<Vec<T>, E> {
        let here = &self.marginal;
        let (free, limits) = (known.free(&here.assumed), limits(known));
        let (step, leading) = match free {
            [_, _, true, _] => (STEP, 2),
            [_, true, ..] => (STEP_OF_GIVEN_LIFETIME, 1),
            _ => (STEP_OF_GIVEN_LIFETIME, 0),
        };
        let next = |from: &Marginal, sign: f64| {
            let mut to = place(&from.assumed);
            (0..3).filter(|i| free[*i]).for_each(|i| to[i] += sign * step[i]);
            let (low, high) = limits[leading];
            if !free[leading] || !(low..=high).contains(&to[leading]) {
                return None;
            }
            (0..3).filter(|i| free[*i]).for_each(|i| to[i] = to[i].clamp(limits[i].0, limits[i].1));
            let there = assumed_at(to, &from.assumed);
            let at = |nearby: Option<&Marginal>| {
                Marginal::new(imager, &here.basis, Arc::clone(&here.design), here.values, there, nearby)
            };
            at(Some(from)).or_else(|_| at(None)).ok()
        };
        let mut all: Vec<T> = next(here, -1.0).iter().map(&of).collect::<Result<_, E>>()?;
        all.push(of(here)?);
        let onwards =
            |from: &Marginal| next(from, 1.0).filter(|further| known.height(further) > known.height(here) - FALL);
        // with many profiles each star takes hundreds of megabytes: one is kept
        let mut further = onwards(here);
        while let Some(there) = further {
            all.push(of(&there)?);
            further = onwards(&there);
        }
        Ok(all)
    }
}
