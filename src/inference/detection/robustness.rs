//! Whether the best orbit depends on a choice: K at a target chi2 3 % lower and higher, and without the profiles of
//! each night.
//!
//! Every K is a closed form at the best period, around a new image at the best orbit: with the other target, or of the
//! remaining profiles. Under a marginal likelihood, profiles are removed from the evidence instead.

use super::{Detection, DetectionSettings, KnownPlanet};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::nights::{NightOffsets, known_beside_offsets, peak_beside_offsets};
use crate::planets::periodogram::{CircularOrbit, Jitters, Peak, SearchSettings, orbits};
use crate::planets::velocities::VelocityQuadratic;
use crate::star::Orbit;
use crate::star::observation::{NIGHT_GAP_D, nights};
use crate::surface::imaging::Imager;
use crate::surface::{At, AtTarget};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Fewest profiles that must remain without a night.
const FEWEST: usize = 5;

/// A difference between targets above this fraction of the standard error gives a warning.
const MOVES: f64 = 0.5;

/// K changes significantly if by more than this many times the change expected from leaving out as many profiles.
const SURPRISE: f64 = 3.0;

/// The orbit without one night.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithoutNight {
    /// Time of its first and last profile (d).
    pub span_d: (f64, f64),
    /// Number of its profiles.
    pub profiles: usize,
    /// The orbit of all others; `None` where none is bounded, or there is no image or evidence.
    pub orbit: Option<CircularOrbit>,
    /// ln p of these profiles given all others, with the orbit that these have at the best period, above that without
    /// a planet.
    pub delta_ln_p: Option<f64>,
}

/// Whether held-out nights are predicted better with the planet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Sum of the Delta ln p of all nights; above 0 where the planet predicts them better.
    pub delta_ln_p: f64,
    /// Its standard deviation, from the scatter between nights.
    pub sigma_delta_ln_p: f64,
    /// Number of nights.
    pub nights: usize,
}

/// The best orbit under other choices, its period kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Robustness {
    /// At the configured target, with all nights.
    pub all: Option<CircularOrbit>,
    /// With the target a little lower, unchanged, and a little higher.
    pub targets: Vec<AtTarget>,
    /// Without each night, in order of time; empty if the profiles are of one night, or too few.
    pub nights: Vec<WithoutNight>,
}

/// The orbit to test.
#[derive(Clone, Copy, Debug)]
pub enum Tried<'a> {
    /// A peak of the search: its period is fixed.
    Peak(&'a Peak),
    /// That of a known planet: all but K is fixed.
    Known(&'a KnownPlanet),
}

impl Tried<'_> {
    /// The orbit with the jitters that `of` gives for velocities.
    fn beside(&self, found: &Detection, q: &VelocityQuadratic, of: &dyn Fn(&VelocityQuadratic) -> Jitters) -> Fitted {
        match self {
            Tried::Peak(peak) => of(&found.known.beside(q)).orbit_at(1.0 / peak.porb_over_prot),
            Tried::Known(planet) => found.known.orbit_of(planet, q, of),
        }
    }

    /// Velocities of such an orbit (km/s); none where K is below 0, as its height is.
    fn velocities(&self, orbit: &CircularOrbit, cycles: &[f64]) -> DVector<f64> {
        let CircularOrbit { k_kms, phi, .. } = *orbit;
        match self {
            Tried::Peak(peak) => {
                let orbit = Orbit { k_kms, porb_over_prot: peak.porb_over_prot, phi };
                DVector::from_iterator(cycles.len(), orbit.velocities_kms(cycles))
            }
            Tried::Known(planet) => k_kms.max(0.0) * planet.ephemeris.unit_velocities(cycles),
        }
    }
}

/// An orbit, where one is bounded.
type Fitted = Option<CircularOrbit>;

/// Tests an orbit of `found`, with all other parameters from `values`. Under a marginal likelihood there are no
/// targets; without a night the field and the expansion point are the last ones.
pub fn robustness(
    imager: &Imager,
    mut values: ParameterValues,
    settings: &DetectionSettings,
    found: &Detection,
    tried: Tried,
) -> Robustness {
    found.known.write(&mut values);
    let mut alone = values;
    if found.known.first().is_none() {
        values.set(Parameter::K, found.best.orbit.k_kms);
        values.set(Parameter::PorbOverProt, found.best.porb_over_prot);
        values.set(Parameter::Phi, found.best.orbit.phi);
        alone = values;
        alone.set(Parameter::K, 0.0);
    }
    let orbit = |quadratic: &VelocityQuadratic| match tried {
        Tried::Peak(peak) => orbits::at(&found.known.beside(quadratic), 1.0 / peak.porb_over_prot).orbit,
        Tried::Known(_) => tried.beside(found, quadratic, &Jitters::none),
    };
    let times_d = imager.times_d();
    let mut nights = nights(&times_d, NIGHT_GAP_D);
    nights.retain(|night| times_d.len() - night.len() >= FEWEST);
    if nights.len() < 2 {
        nights.clear();
    }
    nights.iter_mut().for_each(|night| night.sort_unstable());
    let (surface, at) = (settings.surface.model(), At { imager, values, nuisances: &settings.nuisances });
    let targets = surface.at_other_targets(at, &orbit);
    let without = surface.without_each(at, found.last(), &nights, &orbit);
    // Delta ln L is that of the blind search: around a star without a planet, with the jitter found there
    let alone = At { values: alone, ..at };
    let star = found.without_jitter.as_ref().map_or(&found.planet_free, |without| &without.here);
    let of_all = &*match tried {
        Tried::Peak(_) => found.known.beside(&star.quadratic),
        Tried::Known(planet) => found.known.beside_others(planet, &star.quadratic),
    };
    let of_all = match (&found.without_jitter, tried) {
        (Some(star), Tried::Peak(_)) => star.beside(of_all),
        // the effect of nightly offsets is reported separately
        (Some(star), Tried::Known(_)) => star.beside_found(of_all),
        (None, _) => Jitters::none(of_all),
    };
    let jitters = |quadratic: &VelocityQuadratic| match (&found.without_jitter, tried) {
        (Some(star), Tried::Peak(_)) => star.of_some_beside(quadratic, &of_all),
        (Some(star), Tried::Known(_)) => star.beside_found(quadratic),
        (None, _) => Jitters::none(quadratic),
    };
    let blind = |quadratic: &VelocityQuadratic| match &found.without_jitter {
        Some(_) => tried.beside(found, quadratic, &jitters),
        None => orbit(quadratic),
    };
    let heights = surface.at_other_targets(alone, &blind).into_iter().map(|at| at.orbit);
    let targets = targets.into_iter().zip(heights);
    let targets = targets.map(|(at, blind)| AtTarget { orbit: with_height(at.orbit, blind), ..at }).collect();
    let heights = surface.without_each(alone, star, &nights, &blind);
    // ln p of a night given all others is the difference of two heights of one orbit
    let held_out = |of_others: Fitted| {
        let orbit = of_others?;
        Some(of_all.delta_ln_l(&tried.velocities(&orbit, &star.quadratic.cycles)) - orbit.delta_ln_l)
    };
    let without = without.into_iter().zip(heights);
    let without = without.map(|(orbit, blind)| (with_height(orbit, blind), held_out(blind)));
    let all = with_height(orbit(&found.last().quadratic), blind(&star.quadratic));
    let without = nights.iter().zip(without).map(|(night, (orbit, delta_ln_p))| {
        let times = || night.iter().map(|&k| times_d[k]);
        WithoutNight {
            span_d: (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)),
            profiles: night.len(),
            orbit,
            delta_ln_p,
        }
    });
    Robustness { all, targets, nights: without.collect() }
}

impl Detection {
    /// Effect of nightly RV offsets beyond the range of the search on the highest peak, if it is a candidate with a
    /// fitted jitter.
    pub fn peak_beside_nights(&self, settings: SearchSettings) -> Option<NightOffsets> {
        let star = self.without_jitter.as_ref().filter(|_| self.is_candidate())?;
        let velocities = self.known.beside(&star.here.quadratic);
        let (peak, jitter) = (1.0 / self.blind.best().porb_over_prot, (star.found_kms, star.stability_kms));
        let found =
            peak_beside_offsets(&velocities, star.nights.as_ref()?, jitter, (peak, &self.frequencies), settings)?;
        Some(found).filter(|found| found.sigma_kms > self.blind.false_alarm.night_kms)
    }

    /// The same for a known planet that would be a candidate: like its significance, from the star without it.
    pub fn known_beside_nights(&self, planet: &KnownPlanet, settings: SearchSettings) -> Option<NightOffsets> {
        let alone = self.alone.as_ref().filter(|_| planet.is_candidate())?;
        let star = alone.without_jitter.as_ref()?;
        let velocities = self.known.beside_others(planet, &star.here.quadratic);
        let (unit, jitter) =
            (planet.ephemeris.unit_velocities(&velocities.cycles), (star.found_kms, star.stability_kms));
        known_beside_offsets(&velocities, star.nights.as_ref()?, jitter, &unit, settings)
    }
}

/// An orbit with the Delta ln L of another.
fn with_height(orbit: Option<CircularOrbit>, other: Option<CircularOrbit>) -> Option<CircularOrbit> {
    Some(CircularOrbit { delta_ln_l: other?.delta_ln_l, ..orbit? })
}

impl Robustness {
    /// How much better held-out nights are predicted with the planet; `None` for less than two.
    pub fn held_out(&self) -> Option<HeldOut> {
        let all: Vec<f64> = self.nights.iter().filter_map(|night| night.delta_ln_p).collect();
        let (nights, sum) = (all.len(), all.iter().sum::<f64>());
        let mean = sum / nights as f64;
        let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (nights as f64 - 1.0);
        let sigma_delta_ln_p = (nights as f64 * variance).sqrt();
        (nights > 1).then_some(HeldOut { delta_ln_p: sum, sigma_delta_ln_p, nights })
    }

    /// Difference of K between targets in standard errors, where large enough for a warning.
    pub fn target_matters(&self) -> Option<f64> {
        let orbits: Vec<CircularOrbit> = self.targets.iter().filter_map(|at| at.orbit).collect();
        let middle = self.all?;
        let apart = |orbit: &CircularOrbit| (orbit.k_kms - middle.k_kms).abs() / middle.sigma_k_kms;
        let largest = orbits.iter().map(apart).fold(0.0, f64::max);
        (largest > MOVES).then_some(largest)
    }

    /// Nights that drive the result: without one of the first K moves by more than the profiles left out explain,
    /// without one of the others ln L of the orbit falls from above to below `level`.
    pub fn decisive_nights(&self, level: f64) -> [Vec<&WithoutNight>; 2] {
        let Some(all) = self.all else { return [Vec::new(), Vec::new()] };
        let moves = |night: &&WithoutNight| {
            night.orbit.is_none_or(|orbit| {
                // for nested data the variance of the difference is the difference of the variances
                let by_chance = (orbit.sigma_k_kms.powi(2) - all.sigma_k_kms.powi(2)).max(0.0).sqrt();
                (orbit.k_kms - all.k_kms).abs() > SURPRISE * by_chance.max(0.3 * all.sigma_k_kms)
            })
        };
        let loses = |night: &&WithoutNight| {
            night.orbit.is_some_and(|orbit| all.delta_ln_l > level && orbit.delta_ln_l <= level)
        };
        let (moving, rest): (Vec<_>, Vec<_>) = self.nights.iter().partition(moves);
        [moving, rest.into_iter().filter(loses).collect()]
    }
}

#[cfg(test)]
mod tests;
