//! Profiles that all others do not predict: flares, prominences, cosmic rays, the Moon. Their errors become so much
//! larger that they are predicted (`docs/method.md` section 9).
//!
//! chi2 of a profile given all others is in closed form. A profile that is worse than the usual one by more than chance
//! allows has its errors multiplied by the square root of the ratio; then the field is fitted anew, for the jitter of
//! all profiles was theirs, until no profile is left that fails. A jitter is fitted even where the config has one: a
//! planet moves every profile, and is no event.

use super::fit::fit;
use super::{Assumed, Basis, Design, Fitted, Known, Marginal, NoFit};
use crate::model::{Parameter, ParameterValues};
use crate::surface::checks::chi2_exceeds;
use crate::surface::imaging::Imager;
use std::sync::Arc;

/// Degree of the harmonics.
const DEGREE: usize = 18;

/// Fewer profiles do not tell which of them is unusual.
const FEWEST: usize = 8;

/// A profile is an event where chance makes one so bad among all of them as rarely as this.
const RARE: f64 = 1e-3;

/// Rounds of naming and fitting: in each one those are named that are nearly as bad as the worst one.
const ROUNDS: usize = 10;
const ALIKE: f64 = 0.6;

/// What a user says of a profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ByHand {
    /// Nothing.
    #[default]
    Open,
    /// That it is an event.
    Event,
    /// That it is none.
    Sound,
}

/// Errors of an event that a user names are multiplied by this at least.
const LEAST_BY_HAND: f64 = 3.0;

/// A profile with errors of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unpredicted {
    /// Which, from 0.
    pub profile: usize,
    /// Factor on its errors.
    pub factor: f64,
    /// chi2 per datum as all others predict it, with errors as they were, over that of the usual profile.
    pub excess: f64,
    /// Probability that chance alone makes a profile so bad.
    pub chance: f64,
}

/// The profiles that the others do not predict, for a star at `values` with a field like `near`, what is known of them
/// `by_hand` in their order.
///
/// # Errors
/// [`NoFit`].
pub fn events(
    imager: &Imager,
    mut values: ParameterValues,
    known: &Known,
    near: Assumed,
    by_hand: &[ByHand],
) -> Result<Vec<Unpredicted>, NoFit> {
    values.set(Parameter::K, 0.0);
    let count = imager.profiles().count();
    let mut factors: Vec<f64> =
        (0..count).map(|k| if by_hand[k] == ByHand::Event { LEAST_BY_HAND } else { 1.0 }).collect();
    let mut found: Vec<Unpredicted> = Vec::new();
    if count < FEWEST {
        return Ok(named(found, &factors));
    }
    let basis = Basis::coarse(&imager.grid, DEGREE);
    let design = Arc::new(Design::new(imager, &basis, &values.state()));
    let known_without_jitter = Known { jitter_kms: None, ..*known };
    let mut marginal = Marginal::new(imager, &basis, design, values, near, None)?;
    for round in 0..ROUNDS {
        let of_all = imager.with_larger_errors(&factors);
        if round > 0 || known.jitter_kms.is_some() {
            let start = Fitted::near(marginal);
            marginal = fit(&of_all, &basis, values, known_without_jitter, Some(&start))?.marginal;
        }
        let ratios = over_usual(&of_all, &marginal.predicted_chi2(&of_all, &basis)?);
        let mut is_settled = true;
        let chance = |k: usize| chi2_exceeds(ratios[k].0 * ratios[k].1, ratios[k].1);
        let fails = |k: usize| by_hand[k] == ByHand::Open && factors[k] == 1.0 && chance(k) < RARE / count as f64;
        let worst = (0..count).filter(|k| fails(*k)).map(|k| ratios[k].0).fold(1.0, f64::max);
        // an event makes its neighbours look like some
        let is_named = |k: &usize| fails(*k) && ratios[*k].0 - 1.0 > ALIKE * (worst - 1.0);
        let named: Vec<(usize, f64)> = (0..count).filter(is_named).map(|k| (k, chance(k))).collect();
        for k in 0..count {
            let ratio = ratios[k].0;
            let known = found.iter().any(|event| event.profile == k);
            if known || factors[k] > 1.0 {
                // as it was named, its errors may still be too small
                is_settled &= ratio < 1.2;
                factors[k] *= ratio.sqrt().max(1.0);
            } else if let Some((_, chance)) = named.iter().find(|(named, _)| *named == k) {
                found.push(Unpredicted { profile: k, factor: 1.0, excess: ratio, chance: *chance });
                factors[k] = ratio.sqrt();
                is_settled = false;
            }
        }
        if is_settled {
            break;
        }
    }
    Ok(named(found, &factors))
}

/// Those with larger errors, in order.
fn named(found: Vec<Unpredicted>, factors: &[f64]) -> Vec<Unpredicted> {
    let of = |(profile, factor): (usize, &f64)| {
        let named = found.iter().find(|event| event.profile == profile);
        let named = named.copied().unwrap_or(Unpredicted { profile, factor: 1.0, excess: 1.0, chance: 1.0 });
        (*factor > 1.0).then_some(Unpredicted { factor: *factor, ..named })
    };
    factors.iter().enumerate().filter_map(of).collect()
}

/// Of each profile chi2 per datum over that of the median profile of its data set, and its number of independent data.
fn over_usual(imager: &Imager, chi2: &[f64]) -> Vec<(f64, f64)> {
    let data: Vec<f64> = imager.profiles().map(|(_, _, bins)| bins as f64).collect();
    let of_set = |set: std::ops::Range<usize>| {
        let mut all: Vec<f64> = set.clone().map(|k| chi2[k] / data[k]).collect();
        all.sort_by(f64::total_cmp);
        let usual = all[all.len() / 2];
        set.map(move |k| (k, usual)).collect::<Vec<_>>()
    };
    let sets = imager.profiles_of_sets().into_iter().filter(|set| !set.is_empty());
    let of = |(k, usual): (usize, f64)| (chi2[k] / data[k] / usual, data[k] / imager.data.correlated_bins);
    sets.flat_map(of_set).map(of).collect()
}
