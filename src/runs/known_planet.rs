//! A planet of known ephemeris: its mass is a question of one number, K.
//!
//! No other period is searched for it, so that the false-alarm probability is that of one period and one sign: how
//! often a star without a planet has a K as many standard errors above zero. The limit is that of K with the planet in
//! the model. Errors of the ephemeris, at most a tenth of an orbit, change K by less than 2 % and are left out here; a
//! chain has them.

use crate::data::ephemeris::Ephemeris;
use crate::data::scene::Scene;
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::{Remark, Signal, Verdict};
use crate::posterior::detection::{Detection, DetectionSettings, View};
use crate::posterior::objective::{Elements, ParameterValues, for_blind_search};
use nalgebra::DVector;

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
    for (to, from) in first.shape.into_iter().zip(of.shape) {
        values[to] = if free(from) { f64::NAN } else { config[from] };
    }
    first.set_period(&mut values, ephemeris.period_d[0], clock);
    first.set_conjunction(&mut values, ephemeris.conjunction_d[0], clock);
    let alone = amplitude(&found.planet_free.quadratic, &values);
    values[first.k] = alone[0].max(0.0);
    let signal = |[k_kms, sigma_k_kms]: [f64; 2]| Signal { period_d: ephemeris.period_d[0], k_kms, sigma_k_kms };
    match View::new(&scene.imager, values, settings, Some(&found.planet_free)) {
        Ok(view) => Verdict::of_known(alone, signal(amplitude(&view.quadratic, &values)), remarks),
        Err(error) => Verdict::not_judged(format!("at the known ephemeris, {error}")),
    }
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
