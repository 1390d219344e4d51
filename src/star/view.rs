//! The visible pixels of one observation: those of each ring on the visible side.
//!
//! The orbit and vsys shift a whole profile and are added in `response`.

use super::grid::{Ring, RingPoint, SurfaceGrid};
use super::limb_darkening::LimbDarkening;
use super::moments::{CHUNK, Moments, Point, Rings};
use super::{Rotation, StarState};
use crate::numerics::vector::Instructions;
use crate::numerics::vector::elementary::INTEGERS;
use std::f64::consts::TAU;

/// The star's orientation, shared by all observations.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    rotation: Rotation,
    sin_inclination: f64,
    cos_inclination: f64,
    /// Coefficients of mu to mu^4 in the weight of a pixel.
    limb: [f64; 4],
    /// vsini in steps of the velocity grid.
    vsini: f64,
}

/// Rings of pixels, each with this many evaluation points, as they rotate for the observer.
pub struct Views<'a, const POINTS: usize> {
    grid: &'a SurfaceGrid,
    /// A chunk of rings at a time.
    rings: Vec<Rings<POINTS>>,
}

/// The visible pixels of one observation with their [`Moments`], followed by [`NOTHING`] pixels of weight 0.
pub struct Seen {
    /// Number of pixels.
    pub pixels: usize,
    /// As in the moments.
    pub weight: Vec<f32>,
    /// As in the moments.
    pub position: Vec<f32>,
    /// As in the moments.
    pub spread: Vec<f32>,
    /// As in the moments.
    pub middle: Vec<f32>,
}

/// Number of pixels of weight 0 after the visible ones.
pub const NOTHING: usize = 64;

/// Visible longitudes of the rings of a grid, without those that are never visible.
#[derive(Clone, Debug)]
pub struct Sight {
    /// Indices of the others.
    pub rings: Vec<usize>,
    /// Their visible longitudes, by chunks.
    horizons: Vec<Horizons>,
}

/// Visible longitudes of a block of rings.
#[derive(Clone, Debug)]
struct Horizons {
    /// For the two latitudes of their evaluation points, identical for a single one: angular velocity, ...
    angular_velocity: [[f64; CHUNK]; 2],
    /// ... and half the range of longitudes (rad) of pixels in which a point is visible.
    reach: [[f64; CHUNK]; 2],
    /// First pixel of each ring.
    first: [u32; CHUNK],
    /// Number of pixels of each ring.
    count: [f64; CHUNK],
}

/// Adjacent pixels whose moments are computed together.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    /// Chunk of rings, and ring in it.
    ring: [u32; 2],
    /// The first of them.
    pixel: u32,
    /// Its index among the visible pixels.
    place: u32,
}

impl Viewer {
    /// The view of a star in a given state, its velocities in steps of `step_kms`; pixels also weighted by `1 - mu`
    /// where only the limb counts.
    pub fn new(state: &StarState, limb: LimbDarkening, limb_alone: bool, step_kms: f64) -> Self {
        let limb = limb.of_mu(limb_alone);
        let (sin_inclination, cos_inclination) = state.inclination.sin_cos();
        Viewer { rotation: state.rotation, sin_inclination, cos_inclination, limb, vsini: state.vsini_kms / step_kms }
    }

    /// Largest velocity (steps) that any pixel can have in the star's frame.
    pub fn largest_velocity(&self) -> f64 {
        let relative = |sin_latitude: f64| self.rotation.relative(sin_latitude).abs();
        self.vsini * relative(0.0).max(relative(1.0))
    }

    /// Longitudes where pixels of `grid` have an evaluation point in view: up to `margin` (rad) beyond the limb.
    pub fn sight(&self, grid: &SurfaceGrid, margin: f64) -> Sight {
        let (mut rings, mut horizons) = (Vec::new(), Vec::new());
        for (index, ring) in grid.rings.iter().enumerate() {
            let ends = [&ring.points[0], &ring.points[ring.points.len() - 1]].map(|point| self.reach(point, margin));
            let Some(reach) = ends[0].or(ends[1]) else { continue };
            let place = rings.len() % CHUNK;
            if place == 0 {
                horizons.push(Horizons::none());
            }
            // if one of two latitudes is never visible, the other determines the range of the ring
            horizons.last_mut().expect("one").set(place, ring, ends.map(|end| end.unwrap_or(reach)));
            rings.push(index);
        }
        Sight { rings, horizons }
    }

    /// Views of these rings of `grid`, whose pixels have this many evaluation points.
    pub fn views<'a, const POINTS: usize>(&self, grid: &'a SurfaceGrid, rings: &[usize]) -> Views<'a, POINTS> {
        let chunk = |indices: &[usize]| {
            let mut chunk = Rings::new();
            for (place, ring) in indices.iter().map(|index| &grid.rings[*index]).enumerate() {
                let of_points = std::array::from_fn(|p| self.point(&ring.points[p]));
                chunk.set(place, of_points, self.limb, ring.points[0].area);
            }
            chunk
        };
        let rings = rings.chunks(CHUNK).map(chunk).collect();
        Views { grid, rings }
    }

    fn point(&self, point: &RingPoint) -> Point {
        let Viewer { rotation, vsini, .. } = self;
        Point {
            angular_velocity: rotation.angular_velocity(point.sin_latitude),
            offset: point.longitude_offset,
            mu_pole: point.sin_latitude * self.cos_inclination,
            mu_equator: point.cos_latitude * self.sin_inclination,
            amplitude: vsini * rotation.relative(point.sin_latitude) * point.cos_latitude,
        }
    }

    /// Angular velocity (rad/d) of a point's latitude, and half the range of longitudes (rad) of pixels in which one of
    /// its points is in view; `None` where none ever is.
    fn reach(&self, point: &RingPoint, margin: f64) -> Option<[f64; 2]> {
        // mu = sin(latitude) cos(i) + cos(latitude) sin(i) cos(longitude) > -sin(margin); i is between 0 and 180 deg
        let pole = point.sin_latitude * self.cos_inclination + margin.sin();
        let rises = -pole / (point.cos_latitude * self.sin_inclination);
        let angular_velocity = self.rotation.angular_velocity(point.sin_latitude);
        (rises < 1.0).then(|| [angular_velocity, rises.max(-1.0).acos() + point.longitude_offset.abs()])
    }
}

impl<const POINTS: usize> Views<'_, POINTS> {
    /// Rotates the star to `since_epoch_d` days after its epoch.
    #[inline(always)]
    pub fn turn(&mut self, i: impl Instructions, since_epoch_d: f64) {
        for rings in &mut self.rings {
            rings.turn(i, since_epoch_d);
        }
    }

    /// Computes the moments of the pixels of all `parts`, of this total number; in cells with these middles, or in
    /// those that contain them.
    #[inline(always)]
    pub fn look(&self, i: impl Instructions, parts: &[Part], pixels: usize, middles: Option<&[f32]>, seen: &mut Seen) {
        for part in parts {
            let ([chunk, ring], place) = (part.ring.map(|ring| ring as usize), part.place as usize);
            let directions = self.grid.directions.chunk(part.pixel as usize);
            let middles = middles.map(|middles| middles[place..].first_chunk().expect("a chunk of middles"));
            // a part writes beyond its last pixel: there is room, and the next one overwrites the excess
            let moments = self.rings[chunk].look(i, ring, directions, middles);
            let Seen { weight, position, spread, middle, .. } = &mut *seen;
            let Moments { weight: w, position: p, spread: s, middle: m } = moments;
            for (all, of_part) in [(weight, w), (position, p), (spread, s), (middle, m)] {
                *all[place..].first_chunk_mut().expect("room for a chunk") = of_part;
            }
        }
        seen.weight[pixels..][..NOTHING].fill(0.0);
        seen.pixels = pixels;
    }
}

impl Seen {
    /// Room for the pixels of a map.
    pub fn with_room_for(pixels: usize) -> Self {
        let numbers = || vec![0.0; pixels + CHUNK.max(NOTHING)];
        Seen { pixels: 0, weight: numbers(), position: numbers(), spread: numbers(), middle: numbers() }
    }
}

impl Part {
    /// Writes the indices of the pixels to their places, and beyond the last of them.
    pub fn list(&self, pixels: &mut [u32]) {
        let pixels = pixels[self.place as usize..][..CHUNK].iter_mut();
        pixels.zip(self.pixel..).for_each(|(pixel, index)| *pixel = index);
    }
}

impl Sight {
    /// Largest number of parts of a map of this many pixels.
    pub fn most_parts(&self, pixels: usize) -> usize {
        pixels / CHUNK + 2 * self.rings.len()
    }

    /// The pixels in view `since_epoch_d` days after the star's epoch, and their number.
    #[inline(always)]
    pub fn find_parts(&self, since_epoch_d: f64, parts: &mut Vec<Part>) -> usize {
        parts.clear();
        let mut place = 0;
        for (chunk, horizons) in self.horizons.iter().enumerate() {
            let [start, length] = horizons.visible(since_epoch_d);
            for ring in 0..CHUNK.min(self.rings.len() - chunk * CHUNK) {
                let (first, count) = (horizons.first[ring], horizons.count[ring] as u32);
                let (start, length) = (start[ring], length[ring]);
                let before = length.min(count - start);
                for (from, pixels) in [(start, before), (0, length - before)] {
                    for done in (0..pixels).step_by(CHUNK) {
                        let ring = [chunk as u32, ring as u32];
                        parts.push(Part { ring, pixel: first + from + done, place: place + done });
                    }
                    place += pixels;
                }
            }
        }
        place as usize
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

    /// First pixel of each ring that is visible, counted from the ring's first, and their number, wrapping to the
    /// ring's beginning.
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

/// Of a ring's pixels those with centres between two longitudes (rad), which may be any number of turns away: the
/// first, and their number. A ring of one pixel always returns it.
#[inline(always)]
fn between(count: f64, from: f64, to: f64) -> [f64; 2] {
    let place = |longitude: f64| longitude * count / TAU - 0.5;
    let (from, to) = (place(from).ceil(), place(to).floor() + 1.0);
    let all = count == 1.0 || to - from >= count;
    // at meaninglessly large angles the result is arbitrary but valid: pixels are not checked again
    let start = (from - count * (from / count).floor()).max(0.0).min(count - 1.0);
    if all { [0.0, count] } else { [start, (to - from).max(0.0)] }
}

/// A small number that is not negative, as an integer, by operations that vectorise.
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
