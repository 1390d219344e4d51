//! Moments of each pixel in one observation: its weight `a mu LD(mu)`, its mean velocity, and the variance of the
//! velocity across it (`docs/method.md` section 1, moment matching).
//!
//! Pixels of a ring share their evaluation points except for the longitude, so that several are computed in parallel,
//! in single precision: weights, and velocities relative to the middle of the velocity grid's cell that contains them.
//! Rings are rotated in parallel as well.

use crate::numerics::vector::Instructions;
use crate::numerics::vector::elementary::{nearest_integer, sin_cos};

/// Numbers that are computed in parallel: pixels of a ring, and rings.
pub const CHUNK: usize = 16;

/// An evaluation point of the pixels of a ring, relative to the pixels' centres as the star rotates.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Angular velocity (rad/d).
    pub angular_velocity: f64,
    /// Longitude minus that of the pixel's centre (rad).
    pub offset: f64,
    /// The constant part of mu: sine of the latitude times cosine of the inclination.
    pub mu_pole: f64,
    /// The rotating part of it.
    pub mu_equator: f64,
    /// Velocity (steps of the velocity grid) at the limb of the equator's direction.
    pub amplitude: f64,
}

/// A block of rings, with their pixels' evaluation points.
#[derive(Clone, Debug)]
pub struct Rings<const POINTS: usize> {
    angular_velocity: [[f64; CHUNK]; POINTS],
    offset: [[f64; CHUNK]; POINTS],
    mu_pole: [[f32; CHUNK]; POINTS],
    mu_equator: [[f64; CHUNK]; POINTS],
    amplitude: [[f64; CHUNK]; POINTS],
    /// Coefficients of mu to mu^4 in the weight.
    limb: [[f32; CHUNK]; 4],
    turned: Turned<POINTS>,
}

/// The same at one time: factors of cosine and sine of a pixel's longitude.
#[derive(Clone, Debug)]
struct Turned<const POINTS: usize> {
    mu: [[[f32; CHUNK]; POINTS]; 2],
    /// Mean of the points' velocities, its rounding error in single precision (which a ring's pixels would share), and
    /// the deviation of each point.
    middle: [[f32; CHUNK]; 2],
    rest: [[f32; CHUNK]; 2],
    velocity: [[[f32; CHUNK]; POINTS]; 2],
}

/// Moments of the velocity distributions of a block of pixels, weighted by projected area and limb darkening.
/// Velocities are in steps of the velocity grid.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    /// Weight of each; 0 for one that is not visible.
    pub weight: [f32; CHUNK],
    /// Mean velocity, from the middle of a cell.
    pub position: [f32; CHUNK],
    /// Half the variance of the velocity.
    pub spread: [f32; CHUNK],
    /// Middle of that cell: half a step from an integer.
    pub middle: [f32; CHUNK],
}

impl<const POINTS: usize> Rings<POINTS> {
    /// No rings yet.
    pub fn new() -> Self {
        let none = [[0.0; CHUNK]; POINTS];
        let turned = Turned {
            mu: [[[0.0; CHUNK]; POINTS]; 2],
            middle: [[0.0; CHUNK]; 2],
            rest: [[0.0; CHUNK]; 2],
            velocity: [[[0.0; CHUNK]; POINTS]; 2],
        };
        Rings {
            angular_velocity: none,
            offset: none,
            mu_pole: [[0.0; CHUNK]; POINTS],
            mu_equator: none,
            amplitude: none,
            limb: [[0.0; CHUNK]; 4],
            turned,
        }
    }

    /// Sets one of the rings: its points, with the area fraction each represents, and coefficients of mu to mu^4 in
    /// their weights.
    pub fn set(&mut self, ring: usize, points: [Point; POINTS], limb: [f64; 4], area: f64) {
        for (p, point) in points.into_iter().enumerate() {
            self.angular_velocity[p][ring] = point.angular_velocity;
            self.offset[p][ring] = point.offset;
            self.mu_pole[p][ring] = point.mu_pole as f32;
            self.mu_equator[p][ring] = point.mu_equator;
            self.amplitude[p][ring] = point.amplitude;
        }
        for (of_rings, coefficient) in self.limb.iter_mut().zip(limb) {
            of_rings[ring] = (area * coefficient) as f32;
        }
    }

    /// Rotates the rings to `since_epoch_d` days after the star's epoch.
    #[inline(always)]
    pub fn turn(&mut self, i: impl Instructions, since_epoch_d: f64) {
        let mut velocities = [[[0.0; CHUNK]; 2]; POINTS];
        for (p, velocity) in velocities.iter_mut().enumerate() {
            // copies: possible aliasing would keep the compiler from vectorising
            let (angular_velocity, offset) = (self.angular_velocity[p], self.offset[p]);
            let (mu_equator, amplitude) = (self.mu_equator[p], self.amplitude[p]);
            let mut mu = [[0.0; CHUNK]; 2];
            for ring in 0..CHUNK {
                let (sin, cos) = sin_cos(i, angular_velocity[ring] * since_epoch_d + offset[ring]);
                mu[0][ring] = (mu_equator[ring] * cos) as f32;
                mu[1][ring] = (-mu_equator[ring] * sin) as f32;
                velocity[0][ring] = amplitude[ring] * sin;
                velocity[1][ring] = amplitude[ring] * cos;
            }
            [self.turned.mu[0][p], self.turned.mu[1][p]] = mu;
        }
        for k in 0..2 {
            let mut middle = [0.0; CHUNK];
            for velocity in &velocities {
                middle.iter_mut().zip(&velocity[k]).for_each(|(middle, v)| *middle += v / POINTS as f64);
            }
            for (relative, velocity) in self.turned.velocity[k].iter_mut().zip(&velocities) {
                *relative = std::array::from_fn(|ring| (velocity[k][ring] - middle[ring]) as f32);
            }
            let single = middle.map(|v| v as f32);
            self.turned.rest[k] = std::array::from_fn(|ring| (middle[ring] - f64::from(single[ring])) as f32);
            self.turned.middle[k] = single;
        }
    }

    /// Moments of the pixels of a ring in these directions (cosines and sines of longitudes). Without given middles of
    /// cells, pixels lie within their own.
    #[inline(always)]
    pub fn look(
        &self,
        i: impl Instructions,
        ring: usize,
        [cos, sin]: [&[f32; CHUNK]; 2],
        middles: Option<&[f32; CHUNK]>,
    ) -> Moments {
        let [weight, deviation, spread] = self.relative_moments(i, ring, *cos, *sin);
        let Turned { middle, rest, .. } = &self.turned;
        let (middle, rest) = ([middle[0][ring], middle[1][ring]], [rest[0][ring], rest[1][ring]]);
        let mut moments = Moments { weight, position: [0.0; CHUNK], spread, middle: [0.0; CHUNK] };
        for lane in 0..CHUNK {
            let (cos, sin) = (cos[lane], sin[lane]);
            let small = i.multiply_add_single(sin, rest[1], deviation[lane]);
            let small = i.multiply_add_single(cos, rest[0], small);
            moments.middle[lane] = match middles {
                Some(middles) => middles[lane],
                None => nearest_integer(less(i, middle, [cos, sin], 0.0) + small - 0.5) + 0.5,
            };
            // the large numbers cancel first
            moments.position[lane] = less(i, middle, [cos, sin], moments.middle[lane]) + small;
        }
        moments
    }

    /// Weights, mean velocities relative to that of the middle of the points, and halves of their variances.
    #[inline(always)]
    fn relative_moments(
        &self,
        i: impl Instructions,
        ring: usize,
        cos_l: [f32; CHUNK],
        sin_l: [f32; CHUNK],
    ) -> [[f32; CHUNK]; 3] {
        let Rings { mu_pole, limb, turned: Turned { mu, velocity, .. }, .. } = self;
        let limb = limb.each_ref().map(|of_rings| of_rings[ring]);
        let [mut weight, mut deviation, mut spread] = [[0.0; CHUNK]; 3];
        for lane in 0..CHUNK {
            let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
            for p in 0..POINTS {
                let on_equator = i.multiply_add_single(sin_l[lane], mu[1][p][ring], mu_pole[p][ring]);
                let mu = i.multiply_add_single(cos_l[lane], mu[0][p][ring], on_equator);
                let mu = if mu > 0.0 { mu } else { 0.0 };
                let outer = i.multiply_add_single(mu, limb[3], limb[2]);
                let limb_darkening = i.multiply_add_single(mu, i.multiply_add_single(mu, outer, limb[1]), limb[0]);
                let w = mu * limb_darkening;
                let v = i.multiply_add_single(cos_l[lane], velocity[0][p][ring], sin_l[lane] * velocity[1][p][ring]);
                let moment = w * v;
                sum += w;
                first += moment;
                second = i.multiply_add_single(moment, v, second);
            }
            let per_weight = if sum > f32::MIN_POSITIVE { 1.0 / sum } else { 0.0 };
            let mean = first * per_weight;
            let variance = i.multiply_add_single(second, per_weight, -mean * mean);
            weight[lane] = sum;
            deviation[lane] = mean;
            spread[lane] = if variance > 0.0 { 0.5 * variance } else { 0.0 };
        }
        [weight, deviation, spread]
    }
}

/// Velocity in a direction (cosine and sine) minus `x`, rounded once: exact to all digits near `x`.
#[inline(always)]
fn less(i: impl Instructions, velocity: [f32; 2], [cos, sin]: [f32; 2], x: f32) -> f32 {
    i.multiply_add_single(cos, velocity[0], i.multiply_add_single(sin, velocity[1], -x))
}
