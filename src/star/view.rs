//! What one observation sees of each pixel: its weight `a mu LD(mu)`, its mean velocity, and the variance of the velocity
//! across it (method section 1, moment matching).
//!
//! Left out: brightness, lines, orbit. The orbit and vsys shift a whole profile and are added in `response`.

use super::StarState;
use super::grid::{Ring, RingPoint, SurfaceGrid};
use super::limb_darkening::LimbDarkening;
use crate::vector::Instructions;
use std::f64::consts::TAU;
use std::ops::Range;

/// The star's orientation, shared by all observations.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    state: StarState,
    sin_inclination: f64,
    cos_inclination: f64,
    limb: (f64, f64),
}

/// Rings of pixels as they turn before the observer.
pub struct Views<'a> {
    grid: &'a SurfaceGrid,
    rings: Vec<(&'a Ring, Vec<TurningPoint>)>,
    limb: (f64, f64),
    moments: PixelMoments,
}

/// Moments of the velocity distribution of the pixels that are seen, weighted by projected area and limb darkening.
#[derive(Default)]
pub struct PixelMoments {
    /// Indices of the pixels.
    pub pixel: Vec<u32>,
    /// Weight of each; 0 for one that only just is not visible.
    pub weight: Vec<f64>,
    /// Mean velocity (km/s).
    pub velocity: Vec<f64>,
    /// Variance of the velocity (km^2/s^2).
    pub variance: Vec<f64>,
}

/// One evaluation point of the pixels of a ring, as the star turns.
struct TurningPoint {
    angular_velocity: f64,
    /// Longitude minus that of the pixel's centre (rad).
    offset: f64,
    sin_offset: f64,
    cos_offset: f64,
    mu_pole: f64,
    mu_equator: f64,
    /// Velocity (km/s) at the limb of the equator's direction.
    amplitude: f64,
    /// Half the range of longitudes (rad) in which it is visible; `None` where it never is.
    horizon: Option<f64>,
}

/// The same at one time: factors of cosine and sine of a pixel's longitude.
#[derive(Clone, Copy)]
struct TurnedPoint {
    mu_pole: f64,
    mu: [f64; 2],
    velocity: [f64; 2],
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

    /// Views of the pixels of `grid`.
    pub fn of<'a>(&self, grid: &'a SurfaceGrid) -> Views<'a> {
        let points = |ring: &'a Ring| ring.points.iter().map(|point| self.turning(point)).collect();
        Views {
            grid,
            rings: grid.rings.iter().map(|ring| (ring, points(ring))).collect(),
            limb: self.limb,
            moments: PixelMoments::default(),
        }
    }

    fn turning(&self, point: &RingPoint) -> TurningPoint {
        let (sin_offset, cos_offset) = point.longitude_offset.sin_cos();
        let mu_pole = point.sin_latitude * self.cos_inclination;
        let mu_equator = point.cos_latitude * self.sin_inclination;
        // mu = mu_pole + mu_equator cos(longitude) is positive; inclinations are between 0 and 180 deg
        let rises = -mu_pole / mu_equator;
        TurningPoint {
            angular_velocity: self.state.rotation.angular_velocity(point.sin_latitude),
            offset: point.longitude_offset,
            sin_offset,
            cos_offset,
            mu_pole,
            mu_equator,
            amplitude: self.state.vsini_kms * self.state.rotation.relative(point.sin_latitude) * point.cos_latitude,
            horizon: (rises < 1.0).then(|| rises.max(-1.0).acos()),
        }
    }
}

impl TurningPoint {
    /// Longitudes (rad) of pixel centres between which it is visible, when it has turned by `turned`.
    fn visible(&self, turned: f64) -> Option<(f64, f64)> {
        let middle = -turned - self.offset;
        self.horizon.map(|horizon| (middle - horizon, middle + horizon))
    }

    fn turned(&self, (sin, cos): (f64, f64)) -> TurnedPoint {
        let (sin, cos) = (sin * self.cos_offset + cos * self.sin_offset, cos * self.cos_offset - sin * self.sin_offset);
        TurnedPoint {
            mu_pole: self.mu_pole,
            mu: [self.mu_equator * cos, -self.mu_equator * sin],
            velocity: [self.amplitude * sin, self.amplitude * cos],
        }
    }
}

impl Views<'_> {
    /// What is seen `since_epoch_d` days after the star's epoch.
    #[inline(always)]
    pub fn look(&mut self, instructions: impl Instructions, since_epoch_d: f64) -> &PixelMoments {
        self.moments.clear();
        for (ring, points) in &self.rings {
            let visible = points.iter().filter_map(|q| q.visible(q.angular_velocity * since_epoch_d));
            let Some((from, to)) = visible.reduce(joined) else { continue };
            let turn = |q: &TurningPoint| (q.angular_velocity * since_epoch_d).sin_cos();
            for pixels in ring.between(from, to) {
                let seen = Seen {
                    grid: self.grid,
                    pixels,
                    area: ring.points[0].area,
                    limb: self.limb,
                    moments: &mut self.moments,
                };
                match points.as_slice() {
                    [q] => seen.add(instructions, &[q.turned(turn(q))]),
                    // two of either latitude
                    [a, b, c, d] => {
                        let (south, north) = (turn(a), turn(c));
                        let points = [a.turned(south), b.turned(south), c.turned(north), d.turned(north)];
                        seen.add(instructions, &points);
                    }
                    points => unreachable!("{} points in a pixel", points.len()),
                }
            }
        }
        &self.moments
    }
}

/// Two ranges of longitudes (rad) as one, the second moved by whole turns next to the first: latitudes drift apart.
fn joined(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    let turns = TAU * ((a.0 + a.1 - b.0 - b.1) / (2.0 * TAU)).round();
    (a.0.min(b.0 + turns), a.1.max(b.1 + turns))
}

impl PixelMoments {
    fn clear(&mut self) {
        self.pixel.clear();
        self.weight.clear();
        self.velocity.clear();
        self.variance.clear();
    }

    /// Room for more pixels; gives the place of the first of them.
    fn add(&mut self, pixels: &Range<usize>) -> usize {
        let first = self.pixel.len();
        self.pixel.extend(pixels.start as u32..pixels.end as u32);
        for moment in [&mut self.weight, &mut self.velocity, &mut self.variance] {
            moment.resize(self.pixel.len(), 0.0);
        }
        first
    }
}

/// Pixels of a ring that are seen, and where their moments go.
struct Seen<'a> {
    grid: &'a SurfaceGrid,
    pixels: Range<usize>,
    /// Area fraction that an evaluation point stands for.
    area: f64,
    limb: (f64, f64),
    moments: &'a mut PixelMoments,
}

impl Seen<'_> {
    #[inline(always)]
    fn add<const POINTS: usize>(self, instructions: impl Instructions, points: &[TurnedPoint; POINTS]) {
        let Seen { grid, pixels, area, limb: (u1, u2), moments } = self;
        // mu LD(mu) = mu (1 - u1 (1 - mu) - u2 (1 - mu)^2)
        let limb = [1.0 - u1 - u2, u1 + 2.0 * u2, -u2];
        let first = moments.add(&pixels);
        let (weights, velocities) = (&mut moments.weight[first..], &mut moments.velocity[first..]);
        let variances = &mut moments.variance[first..];
        let (cosines, sines) = (&grid.longitude_cos[pixels.clone()], &grid.longitude_sin[pixels]);
        let fma = |a, b, c| instructions.multiply_add(a, b, c);
        let pixels = weights.iter_mut().zip(velocities).zip(variances).zip(cosines.iter().zip(sines));
        for (((weight, velocity), variance), (cos_l, sin_l)) in pixels {
            let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
            for q in points {
                let mu = fma(*cos_l, q.mu[0], fma(*sin_l, q.mu[1], q.mu_pole));
                let mu = if mu > 0.0 { mu } else { 0.0 };
                let w = mu * fma(mu, fma(mu, limb[2], limb[1]), limb[0]);
                let v = fma(*cos_l, q.velocity[0], sin_l * q.velocity[1]);
                let moment = w * v;
                sum += w;
                first += moment;
                second = fma(moment, v, second);
            }
            let per_weight = if sum > 0.0 { 1.0 / sum } else { 0.0 };
            let mean = first * per_weight;
            let spread = fma(second, per_weight, -mean * mean);
            *weight = area * sum;
            *velocity = mean;
            *variance = if spread > 0.0 { spread } else { 0.0 };
        }
    }
}
