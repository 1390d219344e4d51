//! What one observation sees of each pixel: its weight `a mu LD(mu)`, its mean velocity, and the variance of the velocity
//! across it (method section 1, moment matching).
//!
//! Pixels of a ring share their evaluation points but for the longitude, so that several of them are computed side by side, in
//! single precision where it is enough: weights, and differences of velocities within a pixel. Left out: which pixels.

use super::grid::Directions;
use super::limb_darkening::LimbDarkening;
use crate::vector::Instructions;
use crate::vector::elementary::sin_cos;
use std::ops::Range;

/// Numbers that are computed side by side.
pub const CHUNK: usize = 16;

/// Evaluation points of pixels, seen from the pixels' centres as the star turns.
#[derive(Clone, Copy, Debug, Default)]
pub struct Points {
    /// Angular velocity (rad/d).
    pub angular_velocity: [f64; CHUNK],
    /// Longitude minus that of the pixel's centre (rad).
    pub offset: [f64; CHUNK],
    /// What does not turn of mu: sine of the latitude times cosine of the inclination.
    pub mu_pole: [f32; CHUNK],
    /// What turns of it.
    pub mu_equator: [f64; CHUNK],
    /// Velocity (km/s) at the limb of the equator's direction.
    pub amplitude: [f64; CHUNK],
}

/// The same at one time: factors of cosine and sine of a pixel's longitude.
#[derive(Clone, Copy, Debug, Default)]
pub struct TurnedPoints {
    mu: [[f32; CHUNK]; 2],
    velocity: [[f64; CHUNK]; 2],
}

/// Moments of the velocity distributions of the pixels that are seen, weighted by projected area and limb darkening. There is
/// room behind the last, whose content means nothing.
pub struct Moments {
    /// Number of pixels.
    pub pixels: usize,
    /// Index of each.
    pub pixel: Vec<u32>,
    /// Weight of each; 0 for one that only just is not visible.
    pub weight: Vec<f32>,
    /// Mean velocity (km/s).
    pub velocity: Vec<f64>,
    /// Variance of the velocity (km^2/s^2).
    pub variance: Vec<f32>,
}

/// What the pixels of a ring have in common at one time.
pub struct RingView<const POINTS: usize> {
    mu_pole: [f32; POINTS],
    mu: [[f32; POINTS]; 2],
    /// Mean of the points' velocities (km/s), and what each has more.
    middle: [f64; 2],
    velocity: [[f32; POINTS]; 2],
    /// Coefficients of mu, mu^2 and mu^3 in the weight.
    limb: [f32; 3],
}

impl Points {
    /// The points `since_epoch_d` days after the star's epoch.
    #[inline(always)]
    pub fn turned(&self, i: impl Instructions, since_epoch_d: f64) -> TurnedPoints {
        let Points { angular_velocity, offset, mu_equator, amplitude, .. } = *self;
        let mut turned = TurnedPoints::default();
        for p in 0..CHUNK {
            let (sin, cos) = sin_cos(i, angular_velocity[p] * since_epoch_d + offset[p]);
            turned.mu[0][p] = (mu_equator[p] * cos) as f32;
            turned.mu[1][p] = (-mu_equator[p] * sin) as f32;
            turned.velocity[0][p] = amplitude[p] * sin;
            turned.velocity[1][p] = amplitude[p] * cos;
        }
        turned
    }
}

impl Moments {
    /// Room for the pixels of a map.
    pub fn with_room_for(pixels: usize) -> Self {
        let room = pixels + CHUNK;
        let (pixel, weight, variance) = (vec![0; room], vec![0.0; room], vec![0.0; room]);
        Moments { pixels: 0, pixel, weight, velocity: vec![0.0; room], variance }
    }

    /// No pixel is seen yet.
    pub fn clear(&mut self) {
        self.pixels = 0;
    }
}

impl<const POINTS: usize> RingView<POINTS> {
    /// The view of a ring whose first point is one of `points`; each stands for so large a part of the star.
    #[inline(always)]
    pub fn new(points: &TurnedPoints, mu_pole: &[f32; CHUNK], first: usize, limb: LimbDarkening, area: f64) -> Self {
        let (u1, u2) = limb.coefficients();
        let mut view = RingView {
            mu_pole: [0.0; POINTS],
            mu: [[0.0; POINTS]; 2],
            velocity: [[0.0; POINTS]; 2],
            middle: [0.0; 2],
            // mu LD(mu) = mu (1 - u1 (1 - mu) - u2 (1 - mu)^2)
            limb: [(area * (1.0 - u1 - u2)) as f32, (area * (u1 + 2.0 * u2)) as f32, (-area * u2) as f32],
        };
        view.mu_pole.copy_from_slice(&mu_pole[first..first + POINTS]);
        for k in 0..2 {
            view.mu[k].copy_from_slice(&points.mu[k][first..first + POINTS]);
            let velocity = &points.velocity[k][first..first + POINTS];
            view.middle[k] = velocity.iter().sum::<f64>() / POINTS as f64;
            for (relative, velocity) in view.velocity[k].iter_mut().zip(velocity) {
                *relative = (velocity - view.middle[k]) as f32;
            }
        }
        view
    }

    /// Adds the moments of some of its pixels.
    #[inline(always)]
    pub fn look(&self, i: impl Instructions, directions: &Directions, pixels: Range<usize>, moments: &mut Moments) {
        let Directions { cos, sin, cos_single, sin_single } = directions;
        // chunks go on beyond the last pixel: there is room, and the next pixels overwrite what comes of it
        for first in pixels.clone().step_by(CHUNK) {
            let [weight, deviation, variance] =
                self.relative_moments(i, chunk(cos_single, first), chunk(sin_single, first));
            let (cos_l, sin_l) = (chunk(cos, first), chunk(sin, first));
            let mut velocity = [0.0; CHUNK];
            for lane in 0..CHUNK {
                let rest = i.multiply_add(sin_l[lane], self.middle[1], f64::from(deviation[lane]));
                velocity[lane] = i.multiply_add(cos_l[lane], self.middle[0], rest);
            }
            let place = moments.pixels + (first - pixels.start);
            *chunk_mut(&mut moments.pixel, place) = std::array::from_fn(|lane| (first + lane) as u32);
            *chunk_mut(&mut moments.weight, place) = weight;
            *chunk_mut(&mut moments.velocity, place) = velocity;
            *chunk_mut(&mut moments.variance, place) = variance;
        }
        moments.pixels += pixels.len();
    }

    /// Weights, mean velocities over that of the middle of the points, and their variances.
    #[inline(always)]
    fn relative_moments(&self, i: impl Instructions, cos_l: [f32; CHUNK], sin_l: [f32; CHUNK]) -> [[f32; CHUNK]; 3] {
        let RingView { mu_pole, mu, velocity, limb, .. } = self;
        let [mut weight, mut deviation, mut variance] = [[0.0; CHUNK]; 3];
        for lane in 0..CHUNK {
            let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
            for p in 0..POINTS {
                let on_equator = i.multiply_add_single(sin_l[lane], mu[1][p], mu_pole[p]);
                let mu = i.multiply_add_single(cos_l[lane], mu[0][p], on_equator);
                let mu = if mu > 0.0 { mu } else { 0.0 };
                let limb_darkening = i.multiply_add_single(mu, i.multiply_add_single(mu, limb[2], limb[1]), limb[0]);
                let w = mu * limb_darkening;
                let v = i.multiply_add_single(cos_l[lane], velocity[0][p], sin_l[lane] * velocity[1][p]);
                let moment = w * v;
                sum += w;
                first += moment;
                second = i.multiply_add_single(moment, v, second);
            }
            let per_weight = if sum > f32::MIN_POSITIVE { 1.0 / sum } else { 0.0 };
            let mean = first * per_weight;
            let spread = i.multiply_add_single(second, per_weight, -mean * mean);
            weight[lane] = sum;
            deviation[lane] = mean;
            variance[lane] = if spread > 0.0 { spread } else { 0.0 };
        }
        [weight, deviation, variance]
    }
}

/// The chunk that begins at an entry.
#[inline(always)]
fn chunk<T: Copy>(all: &[T], first: usize) -> [T; CHUNK] {
    *all[first..].first_chunk().expect("room behind the last")
}

/// The same, to be written.
#[inline(always)]
fn chunk_mut<T>(all: &mut [T], first: usize) -> &mut [T; CHUNK] {
    all[first..].first_chunk_mut().expect("room behind the last")
}
