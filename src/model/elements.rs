//! The parameters of each planet, and the conversion of ephemerides in days.
//!
//! A period in days replaces `Porb/Prot`, `P / rotation_period`; the time of an inferior conjunction replaces phi: `phi
//! = (T - epoch) / P - (lambda_c - lambda_max)`, the mean longitudes (cycles) of conjunction and largest velocity, a
//! quarter of a cycle apart for a circular orbit.

use super::parameters::{PARAMETERS, Parameter, Role};
use super::prior::Prior;
use super::values::{Element, ParameterValues};
use crate::star::{Eccentric, Shape};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// The parameters of one planet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Elements {
    /// Index of the planet: 0 or 1.
    pub planet: usize,
    /// Semi-amplitude.
    pub k: Parameter,
    /// Period over rotation period.
    pub ratio: Parameter,
    /// Period (d) in its place.
    pub period: Parameter,
    /// Phase.
    pub phi: Parameter,
    /// Time of an inferior conjunction (d) in its place.
    pub conjunction: Parameter,
    /// Eccentricity and argument of periastron.
    pub shape: [Parameter; 2],
}

/// Rotation period and epoch for days.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    /// Rotation period (d).
    pub rotation_period_d: f64,
    /// Time of rotation cycle 0 (d).
    pub epoch_d: f64,
}

impl Elements {
    /// Those of the planet and of a second one.
    pub const PLANETS: [Elements; 2] = [Elements::of_planet(0), Elements::of_planet(1)];

    const fn of_planet(planet: usize) -> Self {
        Elements {
            planet,
            k: parameter(planet, Element::Amplitude),
            ratio: parameter(planet, Element::Ratio),
            period: parameter(planet, Element::Period),
            phi: parameter(planet, Element::Phase),
            conjunction: parameter(planet, Element::Conjunction),
            shape: [parameter(planet, Element::ShapeCos), parameter(planet, Element::ShapeSin)],
        }
    }

    /// Writes values of free parameters into `values`. Ephemerides are converted here.
    pub fn write(values: &mut ParameterValues, given: impl Iterator<Item = (Parameter, f64)> + Clone, clock: Clock) {
        given.clone().filter(|(p, _)| !p.is_ephemeris()).for_each(|(p, x)| values.set(p, x));
        for (p, x) in given {
            // in the order of all parameters the period comes before the conjunction
            match p.spec().role {
                Role::Orbit(planet, Element::Period) => Elements::PLANETS[planet].set_period(values, x, clock),
                Role::Orbit(planet, Element::Conjunction) => {
                    Elements::PLANETS[planet].set_conjunction(values, x, clock)
                }
                _ => {}
            }
        }
    }

    /// Those of the planet that a parameter belongs to.
    pub fn of(parameter: Parameter) -> Option<&'static Elements> {
        match parameter.spec().role {
            Role::Orbit(planet, _) => Some(&Elements::PLANETS[planet]),
            _ => None,
        }
    }

    /// All of them, in the order of [`Parameter::ALL`].
    pub fn all(&self) -> [Parameter; 7] {
        let Elements { k, ratio, period, phi, conjunction, shape: [cos, sin], .. } = *self;
        [k, ratio, period, phi, conjunction, cos, sin]
    }

    /// Eccentricity and argument of periastron.
    pub fn shape(&self, values: &ParameterValues) -> Shape {
        values.orbit(self.planet).and_then(|orbit| orbit.shape).unwrap_or_default()
    }

    /// The orbit of an existing planet.
    ///
    /// # Panics
    /// If there is none.
    pub fn orbit(&self, values: &ParameterValues) -> Eccentric {
        values.orbit(self.planet).expect("a planet that is there").eccentric()
    }

    /// Writes a period in days into `values`.
    pub fn set_period(&self, values: &mut ParameterValues, period_d: f64, clock: Clock) {
        values.set(self.ratio, period_d / clock.rotation_period_d);
    }

    /// Writes the time of a conjunction into `values`, whose period and shape are set.
    pub fn set_conjunction(&self, values: &mut ParameterValues, time_d: f64, clock: Clock) {
        let cycles = (time_d - clock.epoch_d) / self.period_d(values, clock);
        values.set(self.phi, (cycles - to_conjunction(&self.shape(values))).rem_euclid(1.0));
    }

    /// The period in days.
    pub fn period_d(&self, values: &ParameterValues, clock: Clock) -> f64 {
        values[self.ratio] * clock.rotation_period_d
    }

    /// The conjunction (d) nearest to `near`.
    pub fn conjunction_d(&self, values: &ParameterValues, clock: Clock, near: f64) -> f64 {
        let period = self.period_d(values, clock);
        let phase = values[self.phi] + to_conjunction(&self.shape(values));
        let turns = ((near - clock.epoch_d) / period - phase).round();
        clock.epoch_d + period * (turns + phase)
    }

    /// The value of any parameter with the given prior, if it is set; for a conjunction the one nearest to the middle
    /// of the prior.
    pub fn value(parameter: Parameter, prior: &Prior, values: &ParameterValues, clock: Clock) -> Option<f64> {
        match parameter.spec().role {
            Role::Orbit(planet, element @ (Element::Period | Element::Conjunction)) => {
                values.orbit(planet)?;
                let of = &Elements::PLANETS[planet];
                Some(match element {
                    Element::Period => of.period_d(values, clock),
                    _ => of.conjunction_d(values, clock, prior.centre()),
                })
            }
            _ => values.get(parameter),
        }
    }
}

/// The parameter for this element of a planet's orbit.
const fn parameter(planet: usize, element: Element) -> Parameter {
    let mut i = 0;
    while i < PARAMETERS.len() {
        if let Role::Orbit(of, own) = PARAMETERS[i].role
            && of == planet
            && own as usize == element as usize
        {
            return PARAMETERS[i].parameter;
        }
        i += 1;
    }
    panic!("each planet has all of them")
}

/// From the largest radial velocity to the inferior conjunction (orbital cycles).
pub fn to_conjunction(shape: &Shape) -> f64 {
    shape.longitude(FRAC_PI_2) - shape.longitude(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLOCK: Clock = Clock { rotation_period_d: 3.0, epoch_d: 2_459_000.25 };

    #[test]
    fn an_ephemeris_leads_to_the_orbit_and_back() {
        for elements in &Elements::PLANETS {
            for (e, omega) in [(0.0, 0.0), (0.2, 1.0), (0.7, -2.0)] {
                let mut values = ParameterValues::of_eight([0.1, 1.7, 0.5, 2.0, 0.0, 38.0, 40.0, 0.0]);
                let shape = Shape::new(e, omega);
                values.set(elements.k, 0.1);
                values.orbit_mut(elements.planet).shape = Some(shape);
                elements.set_period(&mut values, 4.93, CLOCK);
                elements.set_conjunction(&mut values, 2_459_321.125, CLOCK);
                assert!((elements.period_d(&values, CLOCK) - 4.93).abs() < 1e-12);
                let back = elements.conjunction_d(&values, CLOCK, 2_459_322.0);
                assert!((back - 2_459_321.125).abs() < 1e-8, "{back}");
                // there the velocity falls through that of the centre of mass
                let orbit = elements.orbit(&values);
                let velocity = |t: f64| orbit.velocity_kms((t - CLOCK.epoch_d) / 3.0);
                assert!((velocity(back) - 0.1 * e * omega.cos()).abs() < 1e-8);
                assert!(velocity(back + 0.01) < velocity(back - 0.01));
            }
        }
    }

    #[test]
    fn every_parameter_of_an_orbit_belongs_to_one_planet() {
        for (planet, elements) in Elements::PLANETS.iter().enumerate() {
            assert_eq!(elements.planet, planet);
            assert!(elements.all().iter().all(|p| Elements::of(*p) == Some(elements)));
        }
        let orbital: Vec<Parameter> = Parameter::ALL.into_iter().filter(|p| p.is_orbital()).collect();
        let listed: Vec<Parameter> = Elements::PLANETS.iter().flat_map(Elements::all).collect();
        assert_eq!(orbital, listed);
    }
}
