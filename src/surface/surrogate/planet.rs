//! One planet in the surrogate: the coordinates in which the velocities are linear, and the draws of the others.
//!
//! For a circular orbit with K and phi free the velocities are linear in `(K cos, K sin)` of the mean longitude at
//! mid-time, at each period. For an eccentric orbit they are linear in `(K cos(omega), K sin(omega))` at each period,
//! eccentricity e and mean anomaly M at mid-time, and `dx dy d(sqrt(e) cos(omega)) d(sqrt(e) sin(omega))` is half of
//! `dA dB dM de`. Where the time of a conjunction is a parameter they are linear in K at each period, time and shape,
//! which are drawn from their priors.

use crate::model::{Clock, Elements, Parameter, ParameterSpace, ParameterValues, Prior};
use crate::star::kepler::true_anomaly;
use crate::star::{Eccentric, Orbit, Shape};
use nalgebra::DMatrix;
use rand::{Rng, RngCore};
use std::f64::consts::TAU;

/// The coordinates of a planet in which the velocities are not linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nonlinear {
    /// Period over rotation period.
    pub period: f64,
    /// Eccentricity; 0 where it is not free.
    pub e: f64,
    /// Mean anomaly at mid-time, or argument of periastron where a conjunction is a parameter (rad).
    pub angle: f64,
    /// Time of the conjunction (d) where it is a parameter.
    pub conjunction_d: f64,
}

/// A planet with positions of its parameters among the sampling coordinates.
#[derive(Clone, Debug)]
pub(super) struct Planet {
    of: &'static Elements,
    k: usize,
    /// Position of phi; `None` where a conjunction is a parameter.
    phi: Option<usize>,
    conjunction: Option<(usize, Prior)>,
    /// Position of the period and the ratio of its unit, or its value where it is fixed.
    period: Result<(usize, f64), f64>,
    period_prior: Option<Prior>,
    shape: Option<([usize; 2], f64)>,
    clock: Clock,
    mid_cycle: f64,
    fixed: ParameterValues,
}

impl Planet {
    /// `None` where the velocities are linear in none of the planet's parameters.
    pub fn new(space: &ParameterSpace, of: &'static Elements, mid_cycle: f64) -> Option<Self> {
        let position = |p: Parameter| space.free().iter().position(|f| f.parameter == p);
        let (k, phi) = (position(of.k)?, position(of.phi));
        let conjunction = position(of.conjunction).map(|i| (i, space.free()[i].prior));
        let fixed = space.values_at(&space.start());
        let shape = position(of.shape[0]).zip(position(of.shape[1])).map(|(i, j)| {
            let largest = match space.free()[i].prior {
                Prior::Disc { max_eccentricity } => max_eccentricity,
                _ => 1.0,
            };
            ([i, j], largest)
        });
        let is_ellipse = shape.is_none() && of.shape(&fixed) != Shape::default();
        if (phi.is_none() && conjunction.is_none()) || (phi.is_some() && is_ellipse) {
            return None;
        }
        let clock = space.clock();
        let ratio = position(of.ratio).map(|i| (i, 1.0));
        let period = ratio.or(position(of.period).map(|i| (i, clock.rotation_period_d))).ok_or(fixed[of.ratio]);
        let period_prior = space.period_prior(of);
        Some(Planet { of, k, phi, conjunction, period, period_prior, shape, clock, mid_cycle, fixed })
    }

    /// Positions of its parameters.
    pub fn positions(&self) -> Vec<usize> {
        let shape = self.shape.iter().flat_map(|(positions, _)| *positions);
        let period = self.period.iter().map(|(i, _)| *i);
        [self.k].into_iter().chain(self.phi).chain(self.conjunction.map(|c| c.0)).chain(period).chain(shape).collect()
    }

    /// Positions of K and phi, for a circular orbit with both free.
    pub fn plain(&self) -> Option<[usize; 2]> {
        self.phi.filter(|_| self.shape.is_none()).map(|phi| [self.k, phi])
    }

    /// Number of linear coordinates.
    pub fn columns(&self) -> usize {
        if self.phi.is_some() { 2 } else { 1 }
    }

    /// Position of K, where it is the linear coordinate itself.
    pub fn ray(&self) -> Option<usize> {
        self.phi.is_none().then_some(self.k)
    }

    /// Whether periods are drawn from a table.
    pub fn has_table(&self) -> bool {
        self.phi.is_some()
    }

    /// The prior of its period, or its value.
    pub fn period(&self) -> Result<Prior, f64> {
        match (self.period, self.period_prior) {
            (Ok(_), Some(prior)) => Ok(prior),
            (Err(fixed), _) => Err(fixed),
            (Ok(_), None) => unreachable!("a free period has a prior"),
        }
    }

    /// A circular orbit of that period, at the best of the priors in all else.
    pub fn circle(&self, period: f64) -> Nonlinear {
        let conjunction_d = self.conjunction.map_or(0.0, |(_, prior)| prior.centre());
        Nonlinear { period, e: 0.0, angle: 0.0, conjunction_d }
    }

    /// The centre of draws without a table: its priors.
    pub fn central_period(&self) -> f64 {
        self.period().map_or_else(|fixed| fixed, |prior| prior.centre())
    }

    /// Shapes that a search tries beside the circular one.
    pub fn ellipses(&self, period: f64) -> Vec<Nonlinear> {
        let circle = self.circle(period);
        let Some((_, largest)) = self.shape else { return vec![circle] };
        let angle = |k: i32| TAU * f64::from(k) / 16.0;
        let shapes = [0.02, 0.2, 0.5].into_iter().flat_map(|e| (0..16).map(move |k| (e, angle(k))));
        shapes.map(|(e, angle)| Nonlinear { e: e * largest, angle, ..circle }).collect()
    }

    /// The velocities of unit linear coordinates, at cycles from mid-time.
    pub fn fill(&self, at: &Nonlinear, cycles: &[f64], columns: &mut DMatrix<f64>, first: usize) {
        for (k, cycle) in cycles.iter().enumerate() {
            let angle = TAU * cycle / at.period;
            match (self.phi, self.shape) {
                (Some(_), None) => {
                    // K cos(angle + angle at mid-time)
                    let (sin, cos) = angle.sin_cos();
                    (columns[(k, first)], columns[(k, first + 1)]) = (cos, -sin);
                }
                (Some(_), Some(_)) => {
                    let (cos, sin) = true_anomaly(angle + at.angle, at.e);
                    (columns[(k, first)], columns[(k, first + 1)]) = (cos + at.e, -sin);
                }
                (None, _) => columns[(k, first)] = self.unit(at).velocity_kms(cycle + self.mid_cycle),
            }
        }
    }

    /// The orbit of K = 1 with that conjunction.
    fn unit(&self, at: &Nonlinear) -> Eccentric {
        let mut values = self.fixed;
        values.set(self.of.ratio, at.period);
        if self.shape.is_some() {
            let shape = Shape::new(at.e, at.angle);
            values.orbit_mut(self.of.planet).shape = Some(shape);
        }
        self.of.set_conjunction(&mut values, at.conjunction_d, self.clock);
        let planet = self.of.orbit(&values);
        Eccentric { orbit: Orbit { k_kms: 1.0, ..planet.orbit }, ..planet }
    }

    /// Both kinds of coordinates at a position.
    pub fn split(&self, position: &[f64]) -> (Nonlinear, Vec<f64>) {
        let period = self.period.map_or_else(|fixed| fixed, |(i, unit)| position[i] / unit);
        let conjunction_d = self.conjunction.map_or(0.0, |(i, _)| position[i]);
        let circle = Nonlinear { period, e: 0.0, angle: 0.0, conjunction_d };
        let shape =
            self.shape.map(|([i, j], _)| (position[i].hypot(position[j]).powi(2), position[j].atan2(position[i])));
        match (self.phi, shape) {
            (Some(phi), None) => (circle, vec![position[self.k], position[phi]]),
            (Some(phi), Some((e, omega))) => {
                let (x, y) = (position[self.k], position[phi]);
                let (k, angle) = (x.hypot(y), y.atan2(x) - omega);
                (Nonlinear { e, angle, ..circle }, vec![k * omega.cos(), k * omega.sin()])
            }
            (None, None) => (circle, vec![position[self.k]]),
            (None, Some((e, angle))) => (Nonlinear { e, angle, ..circle }, vec![position[self.k]]),
        }
    }

    /// Writes both kinds of coordinates into a position.
    pub fn write(&self, at: &Nonlinear, linear: &[f64], position: &mut [f64]) {
        if let Ok((i, unit)) = self.period {
            position[i] = at.period * unit;
        }
        if let Some((i, _)) = self.conjunction {
            position[i] = at.conjunction_d;
        }
        match (self.phi, self.shape) {
            (Some(phi), None) => (position[self.k], position[phi]) = (linear[0], linear[1]),
            (Some(phi), Some(([i, j], _))) => {
                let (k, omega) = (linear[0].hypot(linear[1]), linear[1].atan2(linear[0]));
                let shape = Shape::new(at.e, omega);
                let longitude = at.angle + omega;
                (position[self.k], position[phi]) = (k * longitude.cos(), k * longitude.sin());
                (position[i], position[j]) = (shape.sqrt_e_cos_omega, shape.sqrt_e_sin_omega);
            }
            (None, shape) => {
                position[self.k] = linear[0];
                if let Some(([i, j], _)) = shape {
                    let shape = Shape::new(at.e, at.angle);
                    (position[i], position[j]) = (shape.sqrt_e_cos_omega, shape.sqrt_e_sin_omega);
                }
            }
        }
    }

    /// All but a period from a table (where `period` is given), and ln of the density with which it is drawn.
    pub fn draw(&self, period: Option<f64>, rng: &mut dyn RngCore) -> (Nonlinear, f64) {
        let mut at = self.circle(period.unwrap_or(0.0));
        if period.is_none() {
            at.period = self.period().map_or_else(|fixed| fixed, |prior| prior.sample(&mut &mut *rng));
        }
        if let Some((_, prior)) = self.conjunction {
            at.conjunction_d = prior.sample(&mut &mut *rng);
        }
        if let Some((_, largest)) = self.shape {
            // small eccentricities rather than large ones
            at.e = largest * rng.random::<f64>().powi(2);
            at.angle = TAU * rng.random::<f64>();
        }
        (at, self.log_draw(&at, period.is_none()))
    }

    /// ln of the density of [`Planet::draw`].
    pub fn log_draw(&self, at: &Nonlinear, with_period: bool) -> f64 {
        let mut sum = 0.0;
        if let (true, Ok(prior)) = (with_period, self.period()) {
            sum += prior.log_density(at.period);
        }
        if let Some((_, prior)) = self.conjunction {
            sum += prior.log_density(at.conjunction_d);
        }
        if let Some((_, largest)) = self.shape {
            sum -= 0.5 * (largest * at.e.max(f64::MIN_POSITIVE)).ln();
        }
        sum
    }
}
