//! Planets whose ephemeris is known: a period and the time of a conjunction, each with its uncertainty or fixed.

use super::{Clock, Element, Elements, FreeParameter, Parameter, ParameterValues, Prior, period_prior};
use crate::star::Shape;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// A known ephemeris.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ephemeris {
    /// Index of the planet: 0 or 1.
    pub planet: usize,
    /// Time of a conjunction (d) and its standard error.
    pub conjunction_d: [f64; 2],
    /// Period (d) and its standard error.
    pub period_d: [f64; 2],
    /// Shape of the orbit; circular where it is not given, or free.
    pub shape: Option<Shape>,
    /// Rotation period and epoch for days.
    pub clock: Clock,
}

impl Ephemeris {
    /// The ephemerides of planets whose conjunction has a normal prior, and whose period has one or is fixed at that of
    /// `values`.
    pub fn all(free: &[FreeParameter], values: &ParameterValues, clock: Clock) -> Vec<Self> {
        Elements::PLANETS.iter().filter_map(|of| Ephemeris::new(of, free, values, clock)).collect()
    }

    fn new(of: &Elements, free: &[FreeParameter], values: &ParameterValues, clock: Clock) -> Option<Self> {
        let prior = |p: Parameter| free.iter().find(|f| f.parameter == p).map(|f| f.prior);
        let Some(Prior::Normal { mean, sd, .. }) = prior(of.conjunction) else { return None };
        let unit = clock.rotation_period_d;
        let period_d = match period_prior(free, of, clock) {
            None => [of.period_d(values, clock), 0.0],
            Some(Prior::Normal { mean, sd, .. }) => [mean * unit, sd * unit],
            Some(_) => return None,
        };
        let is_free = prior(of.shape[0]).is_some();
        let shape = values.orbit(of.planet).and_then(|orbit| orbit.shape).filter(|_| !is_free);
        Some(Ephemeris { planet: of.planet, conjunction_d: [mean, sd], period_d, shape, clock })
    }

    /// The parameters of its planet.
    pub fn of(&self) -> &'static Elements {
        &Elements::PLANETS[self.planet]
    }

    /// Standard error of the phase at a time (orbital cycles).
    pub fn phase_error(&self, time_d: f64) -> f64 {
        let ([conjunction, conjunction_sd], [period, period_sd]) = (self.conjunction_d, self.period_d);
        conjunction_sd.hypot((time_d - conjunction) / period * period_sd) / period
    }

    /// Writes the orbit of semi-amplitude `k_kms` into `values`, at the given ephemeris.
    pub fn write(&self, k_kms: f64, values: &mut ParameterValues) {
        self.write_at(self.period_d[0], self.conjunction_d[0], values);
        values.set(self.of().k, k_kms);
    }

    fn write_at(&self, period_d: f64, conjunction_d: f64, values: &mut ParameterValues) {
        values.orbit_mut(self.planet).shape = self.shape;
        self.of().set_period(values, period_d, self.clock);
        self.of().set_conjunction(values, conjunction_d, self.clock);
    }

    /// Velocities (km/s) of an orbit of K = 1 km/s at the given ephemeris, at rotation `cycles`.
    pub fn unit_velocities(&self, cycles: &[f64]) -> DVector<f64> {
        self.unit_velocities_at(self.period_d[0], self.conjunction_d[0], cycles)
    }

    /// The same with that period and conjunction (d).
    pub fn unit_velocities_at(&self, period_d: f64, conjunction_d: f64, cycles: &[f64]) -> DVector<f64> {
        let mut values = ParameterValues::of_eight([0.0; 8]);
        self.write_at(period_d, conjunction_d, &mut values);
        let orbit = values.orbit_mut(self.planet);
        orbit.set(Element::Amplitude, 1.0);
        let orbit = orbit.eccentric();
        DVector::from_iterator(cycles.len(), cycles.iter().map(|cycle| orbit.velocity_kms(*cycle)))
    }
}
