//! The test for spot evolution: ln Z of a field with a finite lifetime compared with that of a static one, with the
//! best orbit in the model on both sides. Without it a planet of 100 m/s alone would appear as evolving spots.
//!
//! A usual static field with the best orbit comes first. Where shorter lifetimes gain nothing the spots do not evolve.
//! Otherwise the static field is fitted, and its lifetime is shortened again, all else kept: where that gains enough
//! the spots evolve, and where it gains nothing they do not. In between, the evolving field is fitted as well, with its
//! own orbit.

use super::Known;
use super::fit::{Fitted, NoFit, fit, share_of_many, usual};
use super::{Assumed, Basis, Marginal};
use crate::field::{Field, FieldError, Kernel, Lifetime};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::Frequencies;
use crate::planets::periodogram::orbits;
use crate::surface::expansion::{Nuisance, STELLAR};
use crate::surface::imaging::Imager;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Spots evolve where that gains more than this in ln Z: odds of 150 to 1.
pub const CHANGES: f64 = 5.0;

/// Lifetimes that are tried, in time bases, from long to short.
const LIFETIMES: [f64; 6] = [8.0, 4.0, 2.0, 1.0, 0.5, 0.25];

/// Below this gain of the best of them a fit will not reach [`CHANGES`].
const NOTHING: f64 = 0.5;

/// Lifetimes are shortened no further where ln Z is this far below the best.
const FAR_BELOW: f64 = 10.0;

/// Whether a season has enough profiles to show evolution.
fn tells(season: &Imager) -> bool {
    const FEWEST: usize = 4;
    season.profiles().count() >= FEWEST
}

/// The comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// ln Z of the best evolving field that was tried relative to that of the best static one.
    pub ln_evidence_gain: f64,
    /// Lifetime of its spots (d).
    pub spot_lifetime_d: f64,
}

impl Change {
    /// Compares both for the profiles of `imager`, all but the orbit as in `values`, marginalised over the `nuisances`:
    /// the season with the strongest evolution. With many profiles a subset comes first, which reveals most evolution
    /// at a small fraction of the cost.
    ///
    /// # Errors
    /// [`NoFit`] where the static field cannot be fitted in some season, and no other one shows evolution.
    pub fn of(
        imager: &Imager,
        values: ParameterValues,
        frequencies: &Frequencies,
        nuisances: &[Nuisance],
        known: Known,
    ) -> Result<Self, NoFit> {
        let among = |imager: &Imager| Change::among(imager, values, frequencies, nuisances, known);
        let of_season = |imager: &Imager| {
            let by_a_share = share_of_many(imager).and_then(|share| among(&share).ok()).filter(Change::is_changing);
            by_a_share.map_or_else(|| among(imager), Ok)
        };
        let mut seasons = imager.seasons();
        if seasons.iter().any(tells) {
            seasons.retain(tells);
        }
        let of_each: Vec<Result<Self, NoFit>> = seasons.iter().map(of_season).collect();
        let most = |a: &Self, b: &Self| a.ln_evidence_gain.total_cmp(&b.ln_evidence_gain);
        let largest = of_each.iter().flatten().copied().max_by(most);
        let failed = of_each.into_iter().find_map(Result::err);
        match (largest, failed) {
            (Some(change), None) => Ok(change),
            (Some(change), Some(_)) if change.is_changing() => Ok(change),
            (_, Some(error)) => Err(error),
            (None, None) => unreachable!("profiles are of some season"),
        }
    }

    fn among(
        imager: &Imager,
        values: ParameterValues,
        frequencies: &Frequencies,
        nuisances: &[Nuisance],
        known: Known,
    ) -> Result<Self, NoFit> {
        let basis = Arc::new(Basis::rough(&imager.grid));
        let with_best_orbit = |near: &Marginal| with_best_orbit(near, imager, values, frequencies, nuisances);
        let time_base_d = imager.time_base_cycles() * imager.star.rotation_period_d;
        let shortened = |still: &Fitted| shortened(imager, &basis, still, time_base_d);
        let unchanging = known.unchanging();
        let alone = usual(imager, &basis, values.without_planet(), unchanging, None)?;
        let values = with_best_orbit(&alone.marginal)?;
        let still = usual(imager, &basis, values, unchanging, Some(&alone.marginal))?;
        if let Some(best) = shortened(&still)?.filter(|best| best.gain < NOTHING) {
            return Ok(best.change());
        }
        let still = fit(imager, &basis, values, unchanging, Some(&still))?;
        let Some(best) = shortened(&still)? else {
            return Ok(Change { ln_evidence_gain: f64::NEG_INFINITY, spot_lifetime_d: time_base_d });
        };
        if !(NOTHING..=CHANGES).contains(&best.gain) {
            return Ok(best.change());
        }
        let known = Known { lifetime: None, ..known };
        let values = with_best_orbit(&best.marginal)?;
        let (change, near) = (best.change(), Fitted::near(best.marginal));
        let Ok(changing) = fit(imager, &basis, values, known, Some(&near)) else { return Ok(change) };
        let gain = changing.ln_evidence - still.ln_evidence;
        Ok(match changing.marginal.assumed.field.kernel.lifetime.days() {
            Some(lifetime_d) if gain > best.gain => Change { ln_evidence_gain: gain, spot_lifetime_d: lifetime_d },
            _ => change,
        })
    }

    /// Whether the spots evolve.
    pub fn is_changing(&self) -> bool {
        self.ln_evidence_gain > CHANGES
    }

    /// The message where they do.
    pub fn sentence(&self) -> String {
        format!(
            "significant spot evolution (Δln Z = {:.0}, spot lifetime ≈ {:.2} d) invalidates the static-map model: use \
            imaging.objective: \"marginal-likelihood\"",
            self.ln_evidence_gain, self.spot_lifetime_d
        )
    }
}

/// The best of the lifetimes.
struct Shortened {
    lifetime_d: f64,
    gain: f64,
    marginal: Marginal,
}

impl Shortened {
    fn change(&self) -> Change {
        Change { ln_evidence_gain: self.gain, spot_lifetime_d: self.lifetime_d }
    }
}

/// The lifetime with the highest ln Z, all else as in `still`; `None` where no lifetime has maps.
fn shortened(
    imager: &Imager,
    basis: &Arc<Basis>,
    still: &Fitted,
    time_base_d: f64,
) -> Result<Option<Shortened>, FieldError> {
    let Marginal { values, design, assumed, .. } = &still.marginal;
    let mut best: Option<Shortened> = None;
    let mut last = still.marginal.clone();
    for lifetime_d in LIFETIMES.map(|bases| bases * time_base_d) {
        let kernel = Kernel::of(Lifetime::Days(lifetime_d));
        let field = Field { kernel, ..assumed.field };
        let at =
            |nearby| Marginal::new(imager, basis, Arc::clone(design), *values, Assumed { field, ..*assumed }, nearby);
        let Ok(marginal) = at(Some(&last)).or_else(|_| at(None)) else { continue };
        let gain = marginal.ln_evidence() - still.ln_evidence;
        last = marginal.clone();
        match &best {
            // slight evolution already is too much
            None if gain < -CHANGES => {
                best = Some(Shortened { lifetime_d, gain, marginal });
                break;
            }
            Some(best) if gain < best.gain - FAR_BELOW => break,
            Some(best) if gain <= best.gain => {}
            _ => best = Some(Shortened { lifetime_d, gain, marginal }),
        }
    }
    Ok(best)
}

/// `values` with the best orbit, the field as in `near`.
fn with_best_orbit(
    near: &Marginal,
    imager: &Imager,
    mut values: ParameterValues,
    frequencies: &Frequencies,
    nuisances: &[Nuisance],
) -> Result<ParameterValues, FieldError> {
    let stellar: Vec<Parameter> = nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect();
    let quadratic = near.expansion(imager, &stellar)?.velocities(nuisances);
    let trials = orbits::scan(&quadratic, &frequencies.per_cycle);
    let best = trials
        .iter()
        .filter_map(|trial| Some((trial.frequency, trial.orbit?)))
        .max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l));
    let Some((frequency, orbit)) = best else { return Ok(values.without_planet()) };
    values.set(Parameter::K, orbit.k_kms);
    values.set(Parameter::PorbOverProt, 1.0 / frequency);
    values.set(Parameter::Phi, orbit.phi);
    Ok(values)
}
