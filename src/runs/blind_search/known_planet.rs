//! A planet of known ephemeris: its mass is a question of one number, K.
//!
//! No other period is searched for it, so that the false-alarm probability is that of one period and one sign: how
//! often a star without a planet has a K as many standard errors above zero at the ephemeris as given: its errors make
//! planets harder to see, not false ones more frequent. K and its limit, with the planet in the model, are over all
//! ephemerides within the errors (`docs/method.md` section 4): a tenth of an orbit beside the true one, K would come
//! out by a fifth too small.

use crate::data::ephemeris::Ephemeris;
use crate::data::scene::Scene;
use crate::inference::detection::{Detection, DetectionSettings};
use crate::model::{Clock, Elements, ParameterValues, for_blind_search};
use crate::planets::mixture::{Mixture, Part};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::{Remark, Signal, UNBOUNDED, Verdict};
use crate::surface::At;
use nalgebra::DVector;

/// Ephemerides are tried within so many standard errors.
const REACH: f64 = 3.5;

/// So many periods and so many conjunctions: a step is at most a hundredth of an orbit.
const NODES: usize = 71;

/// What is said of a planet.
#[derive(Clone, Debug)]
pub struct KnownPlanet {
    /// Whether it is the first or the only planet of the config.
    pub is_first: bool,
    /// What is said of it.
    pub verdict: Verdict,
}

/// The planets of known ephemeris in the config of `scene`, beside what a blind search found. `remarks` are on the
/// star.
pub fn known_planets(
    scene: &Scene,
    settings: &DetectionSettings,
    found: &Detection,
    remarks: &[Remark],
) -> Vec<KnownPlanet> {
    let known = Elements::PLANETS.iter().filter_map(|of| Ephemeris::of(&scene.settings, of));
    known
        .map(|ephemeris| KnownPlanet {
            is_first: ephemeris.of == &Elements::PLANETS[0],
            verdict: verdict(scene, settings, found, &ephemeris, remarks),
        })
        .collect()
}

fn verdict(
    scene: &Scene,
    settings: &DetectionSettings,
    found: &Detection,
    ephemeris: &Ephemeris,
    remarks: &[Remark],
) -> Verdict {
    let (of, clock) = (ephemeris.of, scene.space.clock());
    let [first, _] = &Elements::PLANETS;
    let config = scene.settings.values;
    // the planet in the place of the first one: velocities are counted from zero there
    let mut values = for_blind_search(config, &scene.settings.free);
    let free = |p| scene.settings.free.iter().any(|f| f.parameter == p);
    values.first.shape = config.orbit(of.planet).and_then(|orbit| orbit.shape).filter(|_| !free(of.shape[0]));
    first.set_period(&mut values, ephemeris.period_d[0], clock);
    first.set_conjunction(&mut values, ephemeris.conjunction_d[0], clock);
    let alone = amplitude(&found.planet_free.quadratic, &values);
    values.set(first.k, alone[0].max(0.0));
    let at = At { imager: &scene.imager, values, nuisances: &settings.nuisances };
    match settings.surface.model().linearise(at, Some(&found.planet_free)) {
        Ok(here) => {
            let Some(k) = over_errors(&here.quadratic, &values, ephemeris, clock) else {
                return Verdict::not_judged(UNBOUNDED);
            };
            let [k_kms, sigma_k_kms] = k.moments();
            let signal = Signal { period_d: ephemeris.period_d[0], sigma_period_d: None, k_kms, sigma_k_kms };
            Verdict::of_known(alone, signal, k.upper95(), remarks)
        }
        Err(error) => Verdict::not_judged(format!("at the known ephemeris, {error}")),
    }
}

/// K over all ephemerides within their errors: of each, its prior and how well its orbit fits. None where the profiles
/// do not bound it.
fn over_errors(
    quadratic: &VelocityQuadratic,
    values: &ParameterValues,
    ephemeris: &Ephemeris,
    clock: Clock,
) -> Option<Mixture> {
    let [first, _] = &Elements::PLANETS;
    let mut parts = Vec::new();
    for (period_d, of_period) in within(ephemeris.period_d) {
        for (conjunction_d, of_conjunction) in within(ephemeris.conjunction_d) {
            let mut values = *values;
            first.set_period(&mut values, period_d, clock);
            first.set_conjunction(&mut values, conjunction_d, clock);
            let [mean, sd] = amplitude(quadratic, &values);
            // the integral over all K of how well the orbit fits
            parts.push(Part { ln_weight: of_period + of_conjunction + 0.5 * (mean / sd).powi(2) + sd.ln(), mean, sd });
        }
    }
    Mixture::new(parts)
}

/// Numbers within the errors, [`REACH`] standard errors to both sides, each with ln of its prior; one where there is no
/// error.
fn within([mean, sd]: [f64; 2]) -> Vec<(f64, f64)> {
    if sd == 0.0 {
        return vec![(mean, 0.0)];
    }
    let deviate = |j: usize| REACH * (2.0 * j as f64 / (NODES - 1) as f64 - 1.0);
    (0..NODES).map(deviate).map(|z| (mean + sd * z, -0.5 * z * z)).collect()
}

/// K and its standard error of the first planet's orbit, all but K as in `values`.
fn amplitude(quadratic: &VelocityQuadratic, values: &ParameterValues) -> [f64; 2] {
    let [first, _] = &Elements::PLANETS;
    let mut orbit = first.orbit(values);
    orbit.orbit.k_kms = 1.0;
    let unit = quadratic.cycles.iter().map(|cycle| orbit.velocity_kms(*cycle));
    let unit = DVector::from_iterator(quadratic.len(), unit);
    let information = unit.dot(&(&quadratic.information * &unit));
    [quadratic.gradient.dot(&unit) / information, information.sqrt().recip()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameter;
    use nalgebra::DMatrix;

    /// 30 velocities with errors of 0.05 km/s of a planet of 0.1 km/s, whose conjunction comes two standard errors
    /// after the one that is given, 0.16 orbits: there K is a half of what it is.
    #[test]
    fn an_ephemeris_that_is_off_leaves_k_as_it_is() {
        let clock = Clock { rotation_period_d: 2.0, epoch_d: 0.0 };
        let [first, _] = &Elements::PLANETS;
        let mut values = ParameterValues::of_eight([0.1, 2.5, 0.0, 3.0, 0.0, 60.0, 30.0, 0.0]);
        let ephemeris = Ephemeris { of: first, conjunction_d: [7.0, 0.4], period_d: [5.0, 0.0] };
        let cycles: Vec<f64> = (0..30).map(|k| 0.37 * f64::from(k)).collect();
        first.set_conjunction(&mut values, 7.8, clock);
        let orbit = first.orbit(&values);
        let information = DMatrix::identity(30, 30) / 0.05f64.powi(2);
        let gradient = &information * DVector::from_iterator(30, cycles.iter().map(|c| orbit.velocity_kms(*c)));
        let quadratic = VelocityQuadratic { cycles, gradient, information };
        first.set_conjunction(&mut values, 7.0, clock);
        values.set(Parameter::K, 0.1);
        let [there, _] = amplitude(&quadratic, &values);
        let k = over_errors(&quadratic, &values, &ephemeris, clock).unwrap();
        let [mean, sd] = k.moments();
        assert!((there / 0.1 - 0.54).abs() < 0.03, "{there}");
        assert!((mean - 0.1).abs() < sd && sd < 0.02, "{mean} +- {sd}");
        let known = Ephemeris { conjunction_d: [7.0, 0.0], ..ephemeris };
        let [alone, _] = over_errors(&quadratic, &values, &known, clock).unwrap().moments();
        assert!((alone - there).abs() < 1e-12);
        assert!(k.upper95() > 0.11 && k.upper95() < 0.14, "{}", k.upper95());
    }
}
