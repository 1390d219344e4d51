//! The reflex velocity of the star on a circular orbit (Petit et al. 2015, section 2.2).
//!
//! `V(t) = K cos(2 pi (E / P - phi))` with `E` the rotation cycle and `P = Porb/Prot`; phi = 0 puts the largest
//! receding velocity at E = 0.

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
