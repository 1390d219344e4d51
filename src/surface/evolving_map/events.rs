//! Profiles that all others do not predict: flares, prominences, cosmic rays, moonlight. Their uncertainties are
//! increased until they are consistent with the prediction (`docs/method.md` section 9).
//!
//! chi2 of a profile given all others has a closed form. The uncertainties of a profile that is worse than the usual
//! one by more than chance allows are multiplied by the square root of the ratio; then the field is fitted again,
//! because the jitter had absorbed the event, until no profile fails. A jitter is fitted even where the config has one:
//! a planet moves every profile, and is no event.

use super::fit::fit;
use super::star::DEGREE;
use super::{Assumed, Basis, Design, Fitted, Known, Marginal, NoFit};
use crate::model::{Parameter, ParameterValues};
use crate::numerics::quantile::middle;
use crate::surface::checks::chi2_exceeds;
use crate::surface::imaging::Imager;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// With fewer profiles the outlier cannot be identified.
const FEWEST: usize = 8;

/// A profile is an event where chance makes one this bad among all of them as rarely as this.
const RARE: f64 = 1e-3;

/// Iterations of identifying and fitting: each identifies those that are nearly as bad as the worst one.
const ROUNDS: usize = 10;
const ALIKE: f64 = 0.6;

/// Uncertainties of an event are large enough where its chi2 is below this, relative to the usual profile.
const STILL: f64 = 1.2;

/// A user's statement on a profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ByHand {
    /// None.
    #[default]
    Open,
    /// It is an event.
    Event,
    /// It is not an event.
    Sound,
}

/// Smallest factor on the uncertainties of an event that a user names.
const LEAST_BY_HAND: f64 = 3.0;

/// A profile that all others do not predict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// The number of the profile, from 1.
    pub profile: usize,
    /// Its time (d).
    pub time_d: f64,
    /// Factor on its uncertainties.
    pub sigma_factor: f64,
    /// chi2 per datum given all others, with the original uncertainties, relative to the usual profile; 1 where a user
    /// names it.
    pub excess: f64,
    /// Probability that chance alone makes a profile this bad; 1 where a user names it.
    pub p_value: f64,
}

/// The profiles that the others do not predict, for a star at `values` with a field like `near`, given the user's
/// statements `by_hand` in their order.
///
/// # Errors
/// [`NoFit`].
pub fn events(
    imager: &Imager,
    mut values: ParameterValues,
    known: &Known,
    near: Assumed,
    by_hand: &[ByHand],
) -> Result<Vec<Event>, NoFit> {
    values.set(Parameter::K, 0.0);
    let times_d: Vec<f64> = imager.profiles().map(|(time_d, ..)| time_d).collect();
    let by_user = |(k, by_hand): (usize, &ByHand)| {
        let (profile, time_d, sigma_factor) = (k + 1, times_d[k], LEAST_BY_HAND);
        (*by_hand == ByHand::Event).then_some(Event { profile, time_d, sigma_factor, excess: 1.0, p_value: 1.0 })
    };
    let mut found: Vec<Option<Event>> = by_hand.iter().enumerate().map(by_user).collect();
    let count = found.len();
    if count < FEWEST {
        return Ok(found.into_iter().flatten().collect());
    }
    let basis = Arc::new(Basis::coarse(&imager.grid, DEGREE));
    let design = Arc::new(Design::new(imager, &basis, &values.state()));
    let with_jitter = Known { jitter_kms: None, ..*known };
    let mut near = Fitted::near(Marginal::new(imager, &basis, design, values, near, None)?);
    for round in 0..ROUNDS {
        let factor = |event: &Option<Event>| event.as_ref().map_or(1.0, |event| event.sigma_factor);
        let of_all = imager.with_larger_errors(&found.iter().map(factor).collect::<Vec<_>>());
        if round > 0 || known.jitter_kms.is_some() {
            near = fit(&of_all, &basis, values, with_jitter, Some(&near))?;
        }
        let ratios = over_usual(&of_all, &near.marginal.predicted_chi2(&of_all)?);
        let chance = |k: usize| chi2_exceeds(ratios[k].0 * ratios[k].1, ratios[k].1);
        let fails = |k: &usize| by_hand[*k] == ByHand::Open && found[*k].is_none() && chance(*k) < RARE / count as f64;
        let failing: Vec<usize> = (0..count).filter(fails).collect();
        let worst = failing.iter().map(|k| ratios[*k].0).fold(1.0, f64::max);
        let mut is_settled = failing.is_empty();
        // after the first factors, uncertainties may still be too small
        for (event, (ratio, _)) in found.iter_mut().zip(&ratios).filter_map(|(event, of)| Some((event.as_mut()?, of))) {
            is_settled &= *ratio < STILL;
            event.sigma_factor *= ratio.sqrt().max(1.0);
        }
        // an event makes its neighbours look like events
        for k in failing.into_iter().filter(|k| ratios[*k].0 - 1.0 > ALIKE * (worst - 1.0)) {
            let (excess, time_d) = (ratios[k].0, times_d[k]);
            let (profile, sigma_factor, p_value) = (k + 1, excess.sqrt(), chance(k));
            found[k] = Some(Event { profile, time_d, sigma_factor, excess, p_value });
        }
        if is_settled {
            break;
        }
    }
    Ok(found.into_iter().flatten().collect())
}

/// chi2 per datum of each profile relative to that of the median profile of its data set, and its number of independent
/// data.
fn over_usual(imager: &Imager, chi2: &[f64]) -> Vec<(f64, f64)> {
    let data: Vec<f64> = imager.profiles().map(|(_, _, bins)| bins as f64).collect();
    let of_set = |set: std::ops::Range<usize>| {
        let usual = middle(set.clone().map(|k| chi2[k] / data[k]).collect());
        set.map(move |k| (k, usual)).collect::<Vec<_>>()
    };
    let sets = imager.profiles_of_sets().into_iter().filter(|set| !set.is_empty());
    let of = |(k, usual): (usize, f64)| (chi2[k] / data[k] / usual, data[k] / imager.data.correlated_bins);
    sets.flat_map(of_set).map(of).collect()
}
