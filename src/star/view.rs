//! Which pixels one observation sees: those of each ring that the star has turned to the visible side.
//!
//! Left out: what is seen of them (`moments`), brightness, lines, orbit. The orbit and vsys shift a whole profile and are added
//! in `response`.

use super::StarState;
use super::grid::{Ring, SurfaceGrid};
use super::limb_darkening::LimbDarkening;
use super::moments::{CHUNK, Moments, Points, RingView, TurnedPoints};
use crate::vector::Instructions;
use std::f64::consts::TAU;

/// The star's orientation, shared by all observations.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    state: StarState,
    sin_inclination: f64,
    cos_inclination: f64,
    limb: LimbDarkening,
}

/// Rings of pixels as they turn before the observer.
pub struct Views<'a> {
    grid: &'a SurfaceGrid,
    limb: LimbDarkening,
    rings: Vec<TurningRing<'a>>,
    /// The evaluation points of all rings, a chunk at a time.
    points: Vec<Points>,
    turned: Vec<TurnedPoints>,
    moments: Moments,
}

/// A ring with the latitudes of its evaluation points, which are the same where there is one.
struct TurningRing<'a> {
    ring: &'a Ring,
    latitudes: [Latitude; 2],
}

/// Evaluation points of one latitude.
#[derive(Clone, Copy)]
struct Latitude {
    angular_velocity: f64,
    /// Half the range of longitudes (rad) of pixels in which one of them is visible; `None` where none ever is.
    reach: Option<f64>,
}

impl Viewer {
    /// The view of a star in a given state.
    pub fn new(state: &StarState, limb: LimbDarkening) -> Self {
        let (sin_inclination, cos_inclination) = state.inclination.sin_cos();
        Viewer { state: *state, sin_inclination, cos_inclination, limb }
    }

    /// Largest velocity (km/s) that any pixel can have in the star's frame.
    pub fn largest_velocity_kms(&self) -> f64 {
        let relative = |sin_latitude: f64| self.state.rotation.relative(sin_latitude).abs();
        self.state.vsini_kms * relative(0.0).max(relative(1.0))
    }

    /// Views of the pixels of `grid`.
    pub fn of<'a>(&self, grid: &'a SurfaceGrid) -> Views<'a> {
        let ring = |ring: &'a Ring| TurningRing { ring, latitudes: self.latitudes(ring) };
        let mut points = Vec::new();
        for (p, point) in grid.rings.iter().flat_map(|ring| &ring.points).enumerate() {
            if p % CHUNK == 0 {
                points.push(Points::default());
            }
            let Points { angular_velocity, offset, mu_pole, mu_equator, amplitude } = &mut points[p / CHUNK];
            let p = p % CHUNK;
            angular_velocity[p] = self.state.rotation.angular_velocity(point.sin_latitude);
            offset[p] = point.longitude_offset;
            mu_pole[p] = (point.sin_latitude * self.cos_inclination) as f32;
            mu_equator[p] = point.cos_latitude * self.sin_inclination;
            amplitude[p] = self.state.vsini_kms * self.state.rotation.relative(point.sin_latitude) * point.cos_latitude;
        }
        Views {
            grid,
            limb: self.limb,
            rings: grid.rings.iter().map(ring).collect(),
            turned: vec![TurnedPoints::default(); points.len()],
            points,
            moments: Moments::with_room_for(grid.len()),
        }
    }

    fn latitudes(&self, ring: &Ring) -> [Latitude; 2] {
        [&ring.points[0], &ring.points[ring.points.len() - 1]].map(|point| {
            // mu = sin(latitude) cos(i) + cos(latitude) sin(i) cos(longitude) is positive; i is between 0 and 180 deg
            let rises = -point.sin_latitude * self.cos_inclination / (point.cos_latitude * self.sin_inclination);
            Latitude {
                angular_velocity: self.state.rotation.angular_velocity(point.sin_latitude),
                reach: (rises < 1.0).then(|| rises.max(-1.0).acos() + point.longitude_offset.abs()),
            }
        })
    }
}

impl Views<'_> {
    /// What is seen `since_epoch_d` days after the star's epoch.
    #[inline(always)]
    pub fn look<I: Instructions>(&mut self, i: I, since_epoch_d: f64) -> &Moments {
        for (turned, points) in self.turned.iter_mut().zip(&self.points) {
            *turned = points.turned(i, since_epoch_d);
        }
        self.moments.clear();
        let mut end = 0;
        for TurningRing { ring, latitudes } in &self.rings {
            let first = end;
            end += ring.points.len();
            let visible = latitudes.iter().filter_map(|latitude| latitude.visible(since_epoch_d));
            let Some((from, to)) = visible.reduce(joined) else { continue };
            let (points, lane) = (&self.turned[first / CHUNK], first % CHUNK);
            let (directions, area) = (&self.grid.directions, ring.points[0].area);
            let mu_pole = &self.points[first / CHUNK].mu_pole;
            for pixels in ring.between(from, to) {
                match ring.points.len() {
                    1 => RingView::<1>::new(points, mu_pole, lane, self.limb, area).look(
                        i,
                        directions,
                        pixels,
                        &mut self.moments,
                    ),
                    4 => RingView::<4>::new(points, mu_pole, lane, self.limb, area).look(
                        i,
                        directions,
                        pixels,
                        &mut self.moments,
                    ),
                    points => unreachable!("{points} points in a pixel"),
                }
            }
        }
        &self.moments
    }
}

impl Latitude {
    /// Longitudes (rad) of pixel centres between which one of the points is visible.
    fn visible(&self, since_epoch_d: f64) -> Option<(f64, f64)> {
        let middle = -self.angular_velocity * since_epoch_d;
        self.reach.map(|reach| (middle - reach, middle + reach))
    }
}

/// Two ranges of longitudes (rad) as one, the second moved by whole turns next to the first: latitudes drift apart.
fn joined(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    let turns = TAU * ((a.0 + a.1 - b.0 - b.1) * (0.5 / TAU)).round();
    (a.0.min(b.0 + turns), a.1.max(b.1 + turns))
}
