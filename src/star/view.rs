//! Which pixels one observation sees: those of each ring that the star has turned to the visible side.
//!
//! Left out: what is seen of them (`moments`), brightness, lines, orbit. The orbit and vsys shift a whole profile and are added
//! in `response`.

use super::StarState;
use super::grid::{Ring, RingPoint, SurfaceGrid};
use super::limb_darkening::LimbDarkening;
use super::moments::{CHUNK, Moments, Point, Rings};
use crate::vector::Instructions;
use crate::vector::elementary::INTEGERS;
use std::f64::consts::TAU;

/// The star's orientation, shared by all observations.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    state: StarState,
    sin_inclination: f64,
    cos_inclination: f64,
    limb: LimbDarkening,
}

/// Rings of pixels, each with so many evaluation points, as they turn before the observer. Rings that are never visible are left out.
pub struct Views<'a, const POINTS: usize> {
    grid: &'a SurfaceGrid,
    /// The rings, and where they are visible, a chunk of them at a time.
    rings: Vec<Rings<POINTS>>,
    horizons: Vec<Horizons>,
    /// Number of rings.
    count: usize,
    parts: Vec<Part>,
    moments: Moments,
}

/// Where rings side by side are visible.
struct Horizons {
    /// Of the two latitudes of their evaluation points, which are the same where there is one: angular velocity, ...
    angular_velocity: [[f64; CHUNK]; 2],
    /// ... and half the range of longitudes (rad) of pixels in which a point is visible.
    reach: [[f64; CHUNK]; 2],
    /// First pixel of each ring.
    first: [u32; CHUNK],
    /// Number of pixels of each ring.
    count: [f64; CHUNK],
}

/// Pixels beside each other of which moments are computed at a time.
#[derive(Clone, Copy, Default)]
struct Part {
    /// Chunk of rings, and ring in it.
    ring: [u32; 2],
    /// The first of them.
    pixel: u32,
    /// Its place among the pixels that are seen.
    place: u32,
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

    /// Views of the pixels of `grid`, each with so many evaluation points.
    pub fn of<'a, const POINTS: usize>(&self, grid: &'a SurfaceGrid) -> Views<'a, POINTS> {
        let (mut rings, mut horizons, mut count) = (Vec::new(), Vec::new(), 0);
        for ring in &grid.rings {
            let ends = [&ring.points[0], &ring.points[POINTS - 1]].map(|point| self.reach(point));
            let Some(reach) = ends[0].or(ends[1]) else { continue };
            if count % CHUNK == 0 {
                rings.push(Rings::new());
                horizons.push(Horizons::none());
            }
            let of_points = std::array::from_fn(|p| self.point(&ring.points[p]));
            rings[count / CHUNK].set(count % CHUNK, of_points, self.limb, ring.points[0].area);
            // of two latitudes one of which is never visible the other says where the ring is
            horizons[count / CHUNK].set(count % CHUNK, ring, ends.map(|end| end.unwrap_or(reach)));
            count += 1;
        }
        let parts = Vec::with_capacity(grid.len() / CHUNK + 2 * count);
        Views { grid, rings, horizons, count, parts, moments: Moments::with_room_for(grid.len()) }
    }

    fn point(&self, point: &RingPoint) -> Point {
        let (rotation, vsini) = (&self.state.rotation, self.state.vsini_kms);
        Point {
            angular_velocity: rotation.angular_velocity(point.sin_latitude),
            offset: point.longitude_offset,
            mu_pole: point.sin_latitude * self.cos_inclination,
            mu_equator: point.cos_latitude * self.sin_inclination,
            amplitude: vsini * rotation.relative(point.sin_latitude) * point.cos_latitude,
        }
    }

    /// Angular velocity (rad/d) of a point's latitude, and half the range of longitudes (rad) of pixels in which one of its points
    /// is visible; nothing where none ever is.
    fn reach(&self, point: &RingPoint) -> Option<[f64; 2]> {
        // mu = sin(latitude) cos(i) + cos(latitude) sin(i) cos(longitude) is positive; i is between 0 and 180 deg
        let rises = -point.sin_latitude * self.cos_inclination / (point.cos_latitude * self.sin_inclination);
        let angular_velocity = self.state.rotation.angular_velocity(point.sin_latitude);
        (rises < 1.0).then(|| [angular_velocity, rises.max(-1.0).acos() + point.longitude_offset.abs()])
    }
}

impl<const POINTS: usize> Views<'_, POINTS> {
    /// What is seen `since_epoch_d` days after the star's epoch.
    #[inline(always)]
    pub fn look<I: Instructions>(&mut self, i: I, since_epoch_d: f64) -> &Moments {
        self.rings.iter_mut().for_each(|rings| rings.turn(i, since_epoch_d));
        self.find_parts(since_epoch_d);
        for part in &self.parts {
            let [chunk, ring] = part.ring.map(|ring| ring as usize);
            let (first, place) = (part.pixel as usize, part.place as usize);
            // a part goes on beyond the last pixel: there is room, and the next one overwrites what comes of it
            self.rings[chunk].look(i, ring, &self.grid.directions, first, place, &mut self.moments);
        }
        &self.moments
    }

    #[inline(always)]
    fn find_parts(&mut self, since_epoch_d: f64) {
        self.parts.clear();
        let mut place = 0;
        for (chunk, horizons) in self.horizons.iter().enumerate() {
            let [start, length] = horizons.visible(since_epoch_d);
            for ring in 0..CHUNK.min(self.count - chunk * CHUNK) {
                let (first, count) = (horizons.first[ring], horizons.count[ring] as u32);
                let (start, length) = (start[ring], length[ring]);
                let before = length.min(count - start);
                for (from, pixels) in [(start, before), (0, length - before)] {
                    for done in (0..pixels).step_by(CHUNK) {
                        let ring = [chunk as u32, ring as u32];
                        self.parts.push(Part { ring, pixel: first + from + done, place: place + done });
                    }
                    place += pixels;
                }
            }
        }
        self.moments.pixels = place as usize;
    }
}

impl Horizons {
    fn none() -> Self {
        let none = [[0.0; CHUNK]; 2];
        Horizons { angular_velocity: none, reach: none, first: [0; CHUNK], count: [1.0; CHUNK] }
    }

    /// Sets one of the rings, with angular velocity and reach of two latitudes.
    fn set(&mut self, ring: usize, Ring { pixels, .. }: &Ring, latitudes: [[f64; 2]; 2]) {
        for (k, [angular_velocity, reach]) in latitudes.into_iter().enumerate() {
            self.angular_velocity[k][ring] = angular_velocity;
            self.reach[k][ring] = reach;
        }
        (self.first[ring], self.count[ring]) = (pixels.start as u32, pixels.len() as f64);
    }

    /// First pixel of each ring that is visible, counted from the ring's first, and how many are, some of them perhaps at the ring's
    /// beginning.
    #[inline(always)]
    fn visible(&self, since_epoch_d: f64) -> [[u32; CHUNK]; 2] {
        let Horizons { angular_velocity, reach, count, .. } = self;
        let (mut start, mut length) = ([0; CHUNK], [0; CHUNK]);
        for ring in 0..CHUNK {
            let [a, b] = [0, 1].map(|k| {
                let (middle, reach) = (-angular_velocity[k][ring] * since_epoch_d, reach[k][ring]);
                (middle - reach, middle + reach)
            });
            let (from, to) = joined(a, b);
            [start[ring], length[ring]] = between(count[ring], from, to).map(whole);
        }
        [start, length]
    }
}

/// Of a ring's pixels those with centres between two longitudes (rad), which may be any number of turns away: the first, and how many.
/// A ring of one pixel may have it anywhere, and gives it always.
#[inline(always)]
fn between(count: f64, from: f64, to: f64) -> [f64; 2] {
    let place = |longitude: f64| longitude * count / TAU - 0.5;
    let (from, to) = (place(from).ceil(), place(to).floor() + 1.0);
    let all = count == 1.0 || to - from >= count;
    // at angles beyond all meaning it is any of them, but one of them: pixels are not checked again
    let start = (from - count * (from / count).floor()).max(0.0).min(count - 1.0);
    if all { [0.0, count] } else { [start, (to - from).max(0.0)] }
}

/// A small number that is not negative, as an integer, in a way that vectors know.
#[inline(always)]
fn whole(x: f64) -> u32 {
    (x + INTEGERS).to_bits() as u32
}

/// Two ranges of longitudes (rad) as one, the second moved by whole turns next to the first: latitudes drift apart.
#[inline(always)]
fn joined(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    let turns = TAU * ((a.0 + a.1 - b.0 - b.1) * (0.5 / TAU)).round();
    (a.0.min(b.0 + turns), a.1.max(b.1 + turns))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_between_longitudes_are_those_whose_centres_are() {
        let count = 21;
        for (middle, half_width) in [(0.1, 1.0), (-3.0, 2.9), (100.0, 0.01), (-50.0, 3.2), (2.0, -0.1), (6.2, 0.4)] {
            let mut inside = Vec::new();
            for j in 0..count {
                let from_middle = (f64::from(j) + 0.5) * TAU / f64::from(count) - middle;
                if (from_middle - TAU * (from_middle / TAU).round()).abs() < half_width {
                    inside.push(j);
                }
            }
            let [start, length] = between(f64::from(count), middle - half_width, middle + half_width).map(|x| x as u32);
            let mut given: Vec<u32> = (start..start + length).map(|j| j % count).collect();
            given.sort_unstable();
            assert_eq!(given, inside, "{middle} {half_width}");
        }
    }
}
