//! What one observation sees of each pixel: its weight `a mu LD(mu)`, its mean velocity, and the variance of the velocity
//! across it (method section 1, moment matching).
//!
//! Left out: brightness, lines, orbit. The orbit and vsys shift a whole profile and are added in `response`.

use super::StarState;
use super::grid::{Ring, SurfaceGrid};
use super::limb_darkening::LimbDarkening;

/// Moments of a pixel's velocity distribution, weighted by projected area and limb darkening.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelView {
    /// Weight: 0 where no part of the pixel is visible.
    pub weight: f64,
    /// Weight times velocity (km/s).
    pub weighted_velocity: f64,
    /// Weight times squared velocity (km^2/s^2).
    pub weighted_square: f64,
}

impl PixelView {
    /// Mean velocity (km/s) and its variance (km^2/s^2); the pixel must be visible.
    pub fn velocity(&self) -> (f64, f64) {
        let mean = self.weighted_velocity / self.weight;
        (mean, (self.weighted_square / self.weight - mean * mean).max(0.0))
    }
}

/// The star's orientation, shared by all observations.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    state: StarState,
    sin_inclination: f64,
    cos_inclination: f64,
    limb: (f64, f64),
}

impl Viewer {
    /// The view of a star in a given state.
    pub fn new(state: &StarState, limb: LimbDarkening) -> Self {
        let (sin_inclination, cos_inclination) = state.inclination.sin_cos();
        Viewer { state: *state, sin_inclination, cos_inclination, limb: limb.coefficients() }
    }

    /// Largest velocity (km/s) that any pixel can have in the star's frame.
    pub fn largest_velocity_kms(&self) -> f64 {
        let relative = |sin_latitude: f64| self.state.rotation.relative(sin_latitude).abs();
        self.state.vsini_kms * relative(0.0).max(relative(1.0))
    }

    /// Moments of every pixel of `ring`, `since_epoch_d` days after the star's epoch.
    pub fn look(&self, grid: &SurfaceGrid, ring: &Ring, since_epoch_d: f64, out: &mut Vec<PixelView>) {
        out.clear();
        out.resize(ring.pixels.len(), PixelView::default());
        let (u1, u2) = self.limb;
        for point in &ring.points {
            let turned = self.state.rotation.angular_velocity(point.sin_latitude) * since_epoch_d;
            let (sin_turn, cos_turn) = (turned + point.longitude_offset).sin_cos();
            let mu_pole = point.sin_latitude * self.cos_inclination;
            let mu_equator = point.cos_latitude * self.sin_inclination;
            let amplitude =
                self.state.vsini_kms * self.state.rotation.relative(point.sin_latitude) * point.cos_latitude;
            for (view, &(cos_l, sin_l)) in out.iter_mut().zip(&grid.longitude_cos_sin[ring.pixels.clone()]) {
                let cos_psi = cos_l * cos_turn - sin_l * sin_turn;
                let sin_psi = sin_l * cos_turn + cos_l * sin_turn;
                let mu = (mu_pole + mu_equator * cos_psi).max(0.0);
                let x = 1.0 - mu;
                let weight = point.area * mu * (1.0 - x * (u1 + u2 * x));
                let velocity = amplitude * sin_psi;
                view.weight += weight;
                view.weighted_velocity += weight * velocity;
                view.weighted_square += weight * velocity * velocity;
            }
        }
    }
}
