//! What one observation sees of each pixel: its weight `a mu LD(mu)`, its mean velocity, and the variance of the velocity
//! across it (method section 1, moment matching).
//!
//! Left out: brightness, lines, orbit. The orbit and vsys shift a whole profile and are added in `response`.

use super::StarState;
use super::grid::{Ring, RingPoint, SurfaceGrid};
use super::limb_darkening::LimbDarkening;
use crate::vector::Instructions;

/// Moments of the velocity distribution of every pixel, weighted by projected area and limb darkening.
#[derive(Clone, Debug, Default)]
pub struct Views {
    /// Weight: 0 where no part of the pixel is visible.
    pub weight: Vec<f64>,
    /// Mean velocity (km/s) of a visible pixel.
    pub velocity: Vec<f64>,
    /// Variance of the velocity (km^2/s^2) of a visible pixel.
    pub variance: Vec<f64>,
}

/// The star's orientation, shared by all observations.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    state: StarState,
    sin_inclination: f64,
    cos_inclination: f64,
    limb: (f64, f64),
}

/// One evaluation point of the pixels of a ring, at one time.
#[derive(Clone, Copy)]
struct TurnedPoint {
    sin_turn: f64,
    cos_turn: f64,
    mu_pole: f64,
    mu_equator: f64,
    /// Velocity (km/s) at the limb of the equator's direction.
    amplitude: f64,
    area: f64,
}

impl Views {
    /// For a map of `pixels` pixels.
    pub fn new(pixels: usize) -> Self {
        Views { weight: vec![0.0; pixels], velocity: vec![0.0; pixels], variance: vec![0.0; pixels] }
    }
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

    /// Views of all pixels, `since_epoch_d` days after the star's epoch.
    #[inline(always)]
    pub fn look(&self, instructions: impl Instructions, grid: &SurfaceGrid, since_epoch_d: f64, views: &mut Views) {
        for ring in &grid.rings {
            let turn = |point: &RingPoint| self.turn(point, since_epoch_d);
            match ring.points.as_slice() {
                [point] => self.look_at_ring(instructions, grid, ring, &[turn(point)], views),
                [a, b, c, d] => {
                    self.look_at_ring(instructions, grid, ring, &[turn(a), turn(b), turn(c), turn(d)], views);
                }
                points => unreachable!("{} points in a pixel", points.len()),
            }
        }
    }

    fn turn(&self, point: &RingPoint, since_epoch_d: f64) -> TurnedPoint {
        let turned = self.state.rotation.angular_velocity(point.sin_latitude) * since_epoch_d;
        let (sin_turn, cos_turn) = (turned + point.longitude_offset).sin_cos();
        TurnedPoint {
            sin_turn,
            cos_turn,
            mu_pole: point.sin_latitude * self.cos_inclination,
            mu_equator: point.cos_latitude * self.sin_inclination,
            amplitude: self.state.vsini_kms * self.state.rotation.relative(point.sin_latitude) * point.cos_latitude,
            area: point.area,
        }
    }

    #[inline(always)]
    fn look_at_ring<const POINTS: usize>(
        &self,
        instructions: impl Instructions,
        grid: &SurfaceGrid,
        ring: &Ring,
        points: &[TurnedPoint; POINTS],
        views: &mut Views,
    ) {
        let pixels = ring.pixels.clone();
        let weights = &mut views.weight[pixels.clone()];
        if points.iter().all(|q| q.mu_pole + q.mu_equator.abs() <= 0.0) {
            weights.fill(0.0);
            return;
        }
        let (velocities, variances) = (&mut views.velocity[pixels.clone()], &mut views.variance[pixels.clone()]);
        let (cosines, sines) = (&grid.longitude_cos[pixels.clone()], &grid.longitude_sin[pixels]);
        let (u1, u2) = self.limb;
        let fma = |a, b, c| instructions.multiply_add(a, b, c);
        let pixels = weights.iter_mut().zip(velocities).zip(variances).zip(cosines.iter().zip(sines));
        for (((weight, velocity), variance), (cos_l, sin_l)) in pixels {
            let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
            for q in points {
                let cos_psi = fma(*cos_l, q.cos_turn, -sin_l * q.sin_turn);
                let sin_psi = fma(*sin_l, q.cos_turn, cos_l * q.sin_turn);
                let mu = fma(q.mu_equator, cos_psi, q.mu_pole);
                let mu = if mu > 0.0 { mu } else { 0.0 };
                let x = 1.0 - mu;
                let w = q.area * mu * fma(-x, fma(u2, x, u1), 1.0);
                let v = q.amplitude * sin_psi;
                sum += w;
                first = fma(w, v, first);
                second = fma(w * v, v, second);
            }
            let mean = first / sum;
            let spread = second / sum - mean * mean;
            *weight = sum;
            *velocity = mean;
            *variance = if spread > 0.0 { spread } else { 0.0 };
        }
    }
}
