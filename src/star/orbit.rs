//! The reflex velocity of the star (Petit et al. 2015, section 2.2, and `docs/method.md` section 1).
//!
//! On a circular orbit `V(t) = K cos(2 pi (E / P - phi))` with `E` the rotation cycle and `P = Porb/Prot`; phi = 0 puts
//! the largest receding velocity at E = 0. On an eccentric one `V = K (cos(nu + omega) + e cos omega)`, nu the true
//! anomaly, and phi is the mean anomaly (cycles) from E = 0 to the largest velocity, at nu = -omega: the same time.
//! Two planets move the star by the sum of both.

use super::kepler::{mean_anomaly, true_anomaly};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A circular orbit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Orbit {
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Orbital period over the rotation period.
    pub porb_over_prot: f64,
    /// Phase (orbital cycles) of the largest receding velocity after E = 0.
    pub phi: f64,
}

impl Orbit {
    /// Radial velocity (km/s, positive receding) at rotation cycle `cycle`.
    pub fn velocity_kms(&self, cycle: f64) -> f64 {
        self.k_kms * (TAU * (cycle / self.porb_over_prot - self.phi)).cos()
    }

    /// The same at several rotation cycles.
    pub fn velocities_kms<'a>(&'a self, cycles: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        cycles.iter().map(|&cycle| self.velocity_kms(cycle))
    }
}

/// Eccentricity e and argument of periastron omega of the star's orbit, as `sqrt(e) cos(omega)` and `sqrt(e)
/// sin(omega)`. Both are 0 for a circular orbit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// `sqrt(e) cos(omega)`.
    pub sqrt_e_cos_omega: f64,
    /// `sqrt(e) sin(omega)`.
    pub sqrt_e_sin_omega: f64,
}

impl Shape {
    /// The shape of an eccentricity and an argument of periastron (rad).
    pub fn new(e: f64, omega: f64) -> Self {
        Shape { sqrt_e_cos_omega: e.sqrt() * omega.cos(), sqrt_e_sin_omega: e.sqrt() * omega.sin() }
    }

    /// Eccentricity.
    pub fn eccentricity(&self) -> f64 {
        self.sqrt_e_cos_omega.powi(2) + self.sqrt_e_sin_omega.powi(2)
    }

    /// Argument of periastron (rad), in (-pi, pi]; 0 for a circular orbit.
    pub fn omega(&self) -> f64 {
        self.sqrt_e_sin_omega.atan2(self.sqrt_e_cos_omega)
    }

    fn is_circle(&self) -> bool {
        self.sqrt_e_cos_omega == 0.0 && self.sqrt_e_sin_omega == 0.0
    }

    /// Mean longitude (mean anomaly and omega together, in orbital cycles) where the angle from the node is `from_node`
    /// (rad): 0 for the largest radial velocity, pi / 2 for the inferior conjunction.
    pub fn longitude(&self, from_node: f64) -> f64 {
        match self.is_circle() {
            true => from_node / TAU,
            false => {
                let (e, omega) = (self.eccentricity(), self.omega());
                let longitude = (mean_anomaly(from_node - omega, e) + omega) / TAU;
                // in the cycle of the angle itself: the two differ by less than half a cycle
                longitude - (longitude - from_node / TAU).round()
            }
        }
    }
}

/// An orbit of any eccentricity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eccentric {
    /// Amplitude, period, and phase of the largest receding velocity.
    pub orbit: Orbit,
    /// Eccentricity and argument of periastron.
    pub shape: Shape,
}

impl Eccentric {
    /// Radial velocity (km/s, positive receding) at rotation cycle `cycle`.
    pub fn velocity_kms(&self, cycle: f64) -> f64 {
        let Eccentric { orbit, shape } = self;
        if shape.is_circle() {
            return orbit.velocity_kms(cycle);
        }
        let (e, omega) = (shape.eccentricity(), shape.omega());
        let from_maximum = TAU * (cycle / orbit.porb_over_prot - orbit.phi);
        let (cos, sin) = true_anomaly(from_maximum + mean_anomaly(-omega, e), e);
        let (sin_omega, cos_omega) = omega.sin_cos();
        orbit.k_kms * (cos * cos_omega - sin * sin_omega + e * cos_omega)
    }
}

impl From<Orbit> for Eccentric {
    fn from(orbit: Orbit) -> Self {
        Eccentric { orbit, shape: Shape::default() }
    }
}

/// The reflex motion by planets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// By the planet.
    pub first: Eccentric,
    /// By a second one.
    pub second: Option<Eccentric>,
}

impl Motion {
    /// Radial velocity (km/s, positive receding) at rotation cycle `cycle`.
    pub fn velocity_kms(&self, cycle: f64) -> f64 {
        let first = self.first.velocity_kms(cycle);
        self.second.map_or(first, |second| first + second.velocity_kms(cycle))
    }

    /// The same at several rotation cycles.
    pub fn velocities_kms<'a>(&'a self, cycles: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        cycles.iter().map(|&cycle| self.velocity_kms(cycle))
    }

    /// The orbits.
    pub fn orbits(&self) -> impl Iterator<Item = Eccentric> {
        [Some(self.first), self.second].into_iter().flatten()
    }
}

impl From<Orbit> for Motion {
    fn from(orbit: Orbit) -> Self {
        Motion { first: orbit.into(), second: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORBIT: Orbit = Orbit { k_kms: 0.1, porb_over_prot: 1.7, phi: 0.3 };

    /// Newton's law of gravity integrated in small steps, independent of all formulas here: velocity along the line of
    /// sight of a star whose orbit is seen edge-on, periastron at time 0.
    fn integrated(e: f64, omega: f64, times: &[f64]) -> Vec<f64> {
        // unit of length: the semi-major axis; of time: the period over 2 pi; at periastron
        let (mut x, mut y) = (1.0 - e, 0.0);
        let (mut vx, mut vy) = (0.0, ((1.0 + e) / (1.0 - e)).sqrt());
        let mut t = 0.0;
        let h = 2e-5;
        let mut found = Vec::new();
        for &time in times {
            while t < time {
                let pull = |x: f64, y: f64| (x * x + y * y).powf(-1.5);
                let half = [vx - 0.5 * h * x * pull(x, y), vy - 0.5 * h * y * pull(x, y)];
                (x, y) = (x + h * half[0], y + h * half[1]);
                (vx, vy) = (half[0] - 0.5 * h * x * pull(x, y), half[1] - 0.5 * h * y * pull(x, y));
                t += h;
            }
            // z = r sin(nu + omega), positive away from the observer; K = 1 / sqrt(1 - e^2) here
            found.push((vx * omega.sin() + vy * omega.cos()) * (1.0 - e * e).sqrt());
        }
        found
    }

    #[test]
    fn velocities_are_those_of_gravity() {
        for (e, omega) in [(0.1, 0.4), (0.5, -2.0), (0.7, 3.0)] {
            let times: Vec<f64> = (1..12).map(|k| 0.5 * f64::from(k)).collect();
            let shape = Shape::new(e, omega);
            // delay of periastron after the maximum
            let from_maximum = -mean_anomaly(-omega, e) / TAU;
            let orbit = Orbit { k_kms: 1.0, porb_over_prot: 1.7, phi: 0.3 };
            let eccentric = Eccentric { orbit, shape };
            for (time, wanted) in times.iter().zip(integrated(e, omega, &times)) {
                let cycle = 1.7 * (0.3 + from_maximum + time / TAU);
                let found = eccentric.velocity_kms(cycle);
                assert!((found - wanted).abs() < 2e-4, "{e} {omega} {time}: {found} {wanted}");
            }
        }
    }

    #[test]
    fn phi_is_the_largest_velocity_and_conjunction_the_fall_through_zero() {
        for (e, omega) in [(0.0, 0.0), (0.05, 1.0), (0.3, 2.5), (0.6, -1.2), (0.9, -3.0)] {
            let eccentric = Eccentric { orbit: ORBIT, shape: Shape::new(e, omega) };
            let velocity = |phase: f64| eccentric.velocity_kms(1.7 * phase);
            let most = ORBIT.k_kms * (1.0 + e * omega.cos());
            assert!((velocity(0.3) - most).abs() < 1e-12, "{e} {omega}");
            assert!((0..1000).all(|k| velocity(f64::from(k) / 1000.0) <= most + 1e-12));
            let between = eccentric.shape.longitude(0.25 * TAU) - eccentric.shape.longitude(0.0);
            // at the conjunction the star moves across the line of sight, except for e cos(omega) of the centre of mass
            let at = 0.3 + between;
            let (middle, slope) = (velocity(at), velocity(at + 1e-5) - velocity(at - 1e-5));
            assert!((middle - ORBIT.k_kms * e * omega.cos()).abs() < 1e-12 && slope < 0.0, "{e} {omega}");
        }
    }

    #[test]
    fn small_eccentricities_lead_to_the_circle() {
        for omega in [0.0, 0.7, 2.0, -2.5] {
            let worst = |e: f64| {
                let eccentric = Eccentric { orbit: ORBIT, shape: Shape::new(e, omega) };
                let apart = |k: i32| {
                    let cycle = 0.17 * f64::from(k);
                    (eccentric.velocity_kms(cycle) - ORBIT.velocity_kms(cycle)).abs()
                };
                (0..40).map(apart).fold(0.0, f64::max)
            };
            // linearly in e
            assert!(worst(1e-9) < 1e-9 && (worst(2e-6) / worst(1e-6) - 2.0).abs() < 1e-3, "{omega}");
        }
        let circle = Eccentric { orbit: ORBIT, shape: Shape::default() };
        assert_eq!(circle.velocity_kms(0.77), ORBIT.velocity_kms(0.77));
        let none = Motion { first: circle, second: Some(Orbit { k_kms: 0.0, ..ORBIT }.into()) };
        assert_eq!(none.velocity_kms(0.77), ORBIT.velocity_kms(0.77));
    }
}
