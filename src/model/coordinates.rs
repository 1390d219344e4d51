//! Free parameters, their joint prior, and the sampling coordinates that samplers and optimisers move in.
//!
//! Where K and phi of a planet are both free they become `(K cos, K sin)` of the mean longitude at mid-time
//! (`docs/method.md` section 5): K near 0 and the wrap of phi are then no special cases, and the angle is uncorrelated
//! with the period and the eccentricity. The coordinates of eccentricity stay `sqrt(e) cos(omega), sqrt(e) sin(omega)`.

use super::elements::{Clock, Elements};
use super::parameters::{Parameter, Step, turning};
use super::prior::Prior;
use super::values::ParameterValues;
use crate::star::stability::{self, Unstable};
use std::f64::consts::{PI, TAU};

/// A free parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeParameter {
    /// The parameter.
    pub parameter: Parameter,
    /// Its prior, in the units of its name.
    pub prior: Prior,
}

/// The free parameters of a problem, and the values of the fixed ones.
#[derive(Clone, Debug)]
pub struct ParameterSpace {
    /// The free parameters in the order of [`Parameter::ALL`].
    free: Vec<FreeParameter>,
    /// Values of all; those of the free ones are the start of a search.
    values: ParameterValues,
    names: Vec<String>,
    /// Rotation cycle in the middle of the time base, and its length.
    mid_cycle: f64,
    time_base_cycles: f64,
    /// Rotation cycles of the longest season; seasons have separate maps.
    season_cycles: f64,
    /// Rotation period and epoch for ephemerides.
    clock: Clock,
    /// Mass of the star (solar masses), where known, for the stability of two planets.
    mass_msun: Option<f64>,
    /// Planets of which K and phi are free.
    polar: Vec<Polar>,
    /// Planets of which the eccentricity is free: positions of its two parameters, and the largest eccentricity.
    discs: Vec<(usize, usize, f64)>,
}

/// Positions of K and phi among the free parameters.
#[derive(Clone, Copy, Debug)]
struct Polar {
    k: usize,
    phi: usize,
    of: &'static Elements,
}

/// The prior of a planet's period over the rotation period among free parameters.
pub fn period_prior(free: &[FreeParameter], of: &Elements, clock: Clock) -> Option<Prior> {
    let prior = |p: Parameter| free.iter().find(|f| f.parameter == p).map(|f| f.prior);
    prior(of.ratio).or_else(|| Some(prior(of.period)?.in_units_of(clock.rotation_period_d)))
}

/// Values for a blind search: circular orbits, and no second planet if one is sought as well.
pub fn for_blind_search(mut values: ParameterValues, free: &[FreeParameter]) -> ParameterValues {
    values.first.shape = None;
    if free.iter().any(|f| Elements::of(f.parameter).is_some_and(|of| of.planet > 0)) {
        values.second = None;
    }
    values
}

/// Smallest K (km/s) at which the Jacobian of the polar coordinates differs from that at K = 0.
const SMALLEST_K_KMS: f64 = 1e-9;

impl ParameterSpace {
    /// The space of the given free parameters, the rest fixed at `values`; times span `time_base_cycles` around
    /// `mid_cycle`.
    pub fn new(
        mut free: Vec<FreeParameter>,
        values: ParameterValues,
        mid_cycle: f64,
        time_base_cycles: f64,
        rotation_period_d: f64,
    ) -> Self {
        free.sort_by_key(|f| f.parameter);
        let position = |p: Parameter| free.iter().position(|f| f.parameter == p);
        let polar = |of: &'static Elements| position(of.k).zip(position(of.phi)).map(|(k, phi)| Polar { k, phi, of });
        let disc = |of: &'static Elements| {
            let (i, j) = position(of.shape[0]).zip(position(of.shape[1]))?;
            match free[i].prior {
                Prior::Disc { max_eccentricity } => Some((i, j, max_eccentricity)),
                _ => None,
            }
        };
        let names = free.iter().map(|f| f.parameter.name().to_string()).collect();
        ParameterSpace {
            polar: Elements::PLANETS.iter().filter_map(polar).collect(),
            discs: Elements::PLANETS.iter().filter_map(disc).collect(),
            clock: Clock { rotation_period_d, epoch_d: 0.0 },
            mass_msun: None,
            names,
            free,
            values,
            mid_cycle,
            time_base_cycles,
            season_cycles: time_base_cycles,
        }
    }

    /// The same with the time of rotation cycle 0 (d), from which conjunctions are counted, and the mass of the star
    /// (solar masses), which decides on the stability of two planets.
    pub fn of_star(mut self, epoch_d: f64, mass_msun: Option<f64>) -> Self {
        self.clock.epoch_d = epoch_d;
        self.mass_msun = mass_msun;
        self
    }

    /// The same with this length (rotation cycles) of the longest season; seasons have separate maps.
    pub fn of_seasons(self, season_cycles: f64) -> Self {
        ParameterSpace { season_cycles, ..self }
    }

    /// Rotation period and epoch for ephemerides.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// The prior of a planet's period over the rotation period, whichever parameter of the period is free; `None` where
    /// it is fixed.
    pub fn period_prior(&self, of: &Elements) -> Option<Prior> {
        period_prior(&self.free, of, self.clock)
    }

    /// Whether two planets are stable; a single one always is.
    ///
    /// # Errors
    /// [`Unstable`].
    pub fn check_stability(&self, values: &ParameterValues) -> Result<(), Unstable> {
        let motion = values.motion();
        let Some(second) = motion.second else { return Ok(()) };
        stability::check(&motion.first, &second, self.clock.rotation_period_d, self.mass_msun)
    }

    /// The same with the field of `values` where that is fixed.
    pub fn with_field_of(mut self, values: &ParameterValues) -> Self {
        let own = self.values;
        self.values.field = values.field;
        for p in self.free.iter().map(|f| f.parameter).filter(|p| p.is_of_field()) {
            own.get(p).into_iter().for_each(|value| self.values.set(p, value));
        }
        self
    }

    /// Number of free parameters.
    pub fn dimension(&self) -> usize {
        self.free.len()
    }

    /// Their names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The free parameters.
    pub fn free(&self) -> &[FreeParameter] {
        &self.free
    }

    /// Values of all parameters at `theta`.
    pub fn values_at(&self, theta: &[f64]) -> ParameterValues {
        let mut values = self.values;
        Elements::write(&mut values, self.free.iter().map(|f| f.parameter).zip(theta.iter().copied()), self.clock);
        values
    }

    /// The free ones among `values`.
    ///
    /// # Panics
    /// If one of them is not given.
    pub fn theta_of(&self, values: &ParameterValues) -> Vec<f64> {
        let given = |f: &FreeParameter| match self.value_among(f, values) {
            Some(value) => value,
            None => panic!("{} is not given", f.parameter.name()),
        };
        self.free.iter().map(given).collect()
    }

    /// The value of a free parameter among `values`, if it is given.
    pub fn value_among(&self, free: &FreeParameter, values: &ParameterValues) -> Option<f64> {
        Elements::value(free.parameter, &free.prior, values, self.clock)
    }

    /// Where a search starts: the free parameters as given.
    pub fn start(&self) -> Vec<f64> {
        self.theta_of(&self.values)
    }

    /// Logarithm of the prior density at `theta`; minus infinity outside, and where two planets would be unstable.
    pub fn log_prior(&self, theta: &[f64]) -> f64 {
        let own = |(f, &x): (&FreeParameter, &f64)| match f.prior {
            Prior::Disc { .. } => 0.0,
            prior => prior.log_density(x),
        };
        let mut sum: f64 = self.free.iter().zip(theta).map(own).sum();
        for &(i, j, largest) in &self.discs {
            let e = theta[i].powi(2) + theta[j].powi(2);
            sum += if e <= largest && e < 1.0 { -(PI * largest).ln() } else { f64::NEG_INFINITY };
        }
        if sum > f64::NEG_INFINITY && self.has_two_planets() && self.check_stability(&self.values_at(theta)).is_err() {
            return f64::NEG_INFINITY;
        }
        sum
    }

    fn has_two_planets(&self) -> bool {
        self.values.second.is_some()
    }

    /// A draw from the prior.
    pub fn sample_prior(&self, rng: &mut impl rand::Rng) -> Vec<f64> {
        const TRIES: usize = 1000;
        let mut draw = || -> Vec<f64> {
            let mut theta: Vec<f64> = self.free.iter().map(|f| f.prior.sample(rng)).collect();
            for &(i, j, largest) in &self.discs {
                let (radius, angle) = ((largest * rng.random::<f64>()).sqrt(), TAU * rng.random::<f64>());
                (theta[i], theta[j]) = (radius * angle.cos(), radius * angle.sin());
            }
            theta
        };
        let first = draw();
        if !self.has_two_planets() {
            return first;
        }
        let allowed = |theta: &Vec<f64>| self.log_prior(theta).is_finite();
        std::iter::once(first.clone()).chain((0..TRIES).map(|_| draw())).find(allowed).unwrap_or(first)
    }

    /// Which free parameters are periodic (phase of the orbit).
    pub fn periodic(&self) -> Vec<bool> {
        self.free.iter().map(|f| f.prior == Prior::Periodic).collect()
    }

    /// Mean longitude at mid-time (rad) without phi, of a planet whose period and shape are in `theta`.
    fn mid_angle(&self, of: &Elements, theta: &[f64]) -> f64 {
        let values = self.values_at(theta);
        TAU * self.mid_cycle / values[of.ratio] + TAU * of.shape(&values).longitude(0.0)
    }

    /// Internal coordinates of `theta`.
    pub fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        let own = |(f, x): (&FreeParameter, &f64)| f.parameter.to_sampling(*x);
        let mut x: Vec<f64> = self.free.iter().zip(theta).map(own).collect();
        for &Polar { k, phi, of } in &self.polar {
            let (sin, cos) = (self.mid_angle(of, theta) - TAU * theta[phi]).sin_cos();
            (x[k], x[phi]) = (theta[k] * cos, theta[k] * sin);
        }
        x
    }

    /// Written coordinates of `internal`, periodic ones wrapped.
    pub fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        let mut theta = internal.to_vec();
        for &Polar { k, phi, of } in &self.polar {
            let (x, y) = (internal[k], internal[phi]);
            theta[k] = x.hypot(y);
            theta[phi] = (self.mid_angle(of, internal) - y.atan2(x)) / TAU;
            // phi has period 1 whatever its prior: shift it into the bounds of the prior
            let (lowest, _) = self.free[phi].prior.bounds();
            theta[phi] -= (theta[phi] - lowest.max(-1e6)).floor();
        }
        for (f, x) in self.free.iter().zip(&mut theta) {
            *x = f.prior.wrap(f.parameter.to_physical(*x));
        }
        theta
    }

    /// ln |d(written) / d(internal)| at `theta`: `d(K, phi) = dx dy / (2 pi K)`, and logarithms of the field.
    pub fn log_jacobian(&self, theta: &[f64]) -> f64 {
        let own: f64 = self.free.iter().zip(theta).map(|(f, x)| f.parameter.log_jacobian(*x)).sum();
        self.polar.iter().fold(own, |sum, polar| sum - (TAU * theta[polar.k].max(SMALLEST_K_KMS)).ln())
    }

    /// Bounds of the priors in sampling coordinates, infinite for those that form velocities of an orbit; with a margin
    /// for rounding.
    pub fn sampling_bounds(&self) -> Vec<(f64, f64)> {
        const ROUNDING: f64 = 1e-12;
        let inside = |low: f64, high: f64| match ROUNDING * (high - low) {
            margin if margin.is_finite() => (low + margin, high - margin),
            _ => (low, high),
        };
        let of_prior = |f: &FreeParameter| match f.prior {
            Prior::Periodic => (f64::NEG_INFINITY, f64::INFINITY),
            prior => {
                let (low, high) = prior.bounds();
                inside(f.parameter.to_sampling(low), f.parameter.to_sampling(high))
            }
        };
        let mut bounds: Vec<(f64, f64)> = self.free.iter().map(of_prior).collect();
        for polar in &self.polar {
            bounds[polar.k] = (f64::NEG_INFINITY, f64::INFINITY);
            bounds[polar.phi] = (f64::NEG_INFINITY, f64::INFINITY);
        }
        bounds
    }

    /// Steps of the sampling coordinates over which profiles change by about a percent of their features: the scale of
    /// numerical derivatives and of a first trust region.
    pub fn scales(&self) -> Vec<f64> {
        let season_d = self.season_cycles.max(0.1) * self.clock.rotation_period_d;
        let scale = |f: &FreeParameter| {
            let period = || self.values[Elements::of(f.parameter).expect("a parameter of an orbit").ratio];
            // in half the time base
            let ratio = |orbits: f64| orbits * period() * period() / (0.5 * self.time_base_cycles).max(0.1);
            match f.parameter.spec().step {
                Step::Fixed(step) => step,
                Step::Relative(part) => part * self.values[f.parameter],
                Step::Turn(times) => times * turning(0.5 * season_d),
                Step::Ratio(orbits) => ratio(orbits),
                Step::Period(orbits) => self.clock.rotation_period_d * ratio(orbits),
                Step::Time(orbits) => orbits * self.clock.rotation_period_d * period(),
            }
        };
        self.free.iter().map(scale).collect()
    }
}

#[cfg(test)]
mod tests;
