//! Fills blocks with the moments of their pixels; and again for a star that differs little, without sorting its pixels,
//! which saves half of the time of a placement.
//!
//! A pixel may be outside of its cell then: the polynomials of its contributions to the cell's nodes (`line_profile`)
//! continue beyond the border, and differ from those of the next cell by the fifth power of the distance, those of its
//! spread by the third.

use super::block::{Block, LANES};
use super::grid::SurfaceGrid;
use super::moments::CHUNK;
use super::placement::{Arrangement, Placement, spare_blocks};
use super::view::{Part, Seen, Viewer};
use crate::numerics::vector::{Instructions, Registers, Scattered, Task};
use std::sync::Arc;

/// Indices of the visible pixels of an observation in the lanes of a block.
pub type Seats = [u32; LANES];

/// Fills an observation's blocks.
///
/// # Safety
/// All seats are below the number of pixels that are seen and [`NOTHING`](super::view::NOTHING) more.
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn fill<I: Instructions>(i: I, seats: &[Seats], seen: &Seen, blocks: &mut [Block]) {
    let r = i.singles();
    for (seats, Block { weight, position, spread }) in seats.iter().zip(blocks) {
        for first in (0..LANES).step_by(I::Singles::LANES) {
            // safe: the caller guarantees the seats
            unsafe {
                let weights = r.pick(&seen.weight, seats, first);
                let positions = r.pick(&seen.position, seats, first);
                let spreads = r.pick(&seen.spread, seats, first);
                r.store(weights, weight, first);
                r.store(positions, position, first);
                r.store(spreads, spread, first);
            }
        }
    }
}

/// The origin of the pixels of an arrangement.
#[derive(Clone, Debug)]
pub struct Source {
    /// Rings of the map in use.
    rings: Vec<usize>,
    /// The parts of rings in view, of one observation after another.
    parts: Vec<Part>,
    /// Middles of the cells of their pixels (steps).
    middles: Vec<f32>,
    /// The pixels of each block.
    seats: Vec<Seats>,
    observations: Vec<Observation>,
}

/// An observation's end among all parts, pixels and blocks.
#[derive(Clone, Copy, Debug)]
struct Observation {
    parts_end: usize,
    pixels_end: usize,
    blocks_end: usize,
}

impl Source {
    /// An empty one.
    pub fn new(rings: &[usize]) -> Self {
        let (parts, middles, seats, observations) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Source { rings: rings.to_vec(), parts, middles, seats, observations }
    }

    /// Adds an observation: its pixels in `parts`, and the pixels of its blocks.
    pub fn add(&mut self, parts: &[Part], seen: &Seen, seats: &[Seats]) {
        self.parts.extend_from_slice(parts);
        self.middles.truncate(self.observations.last().map_or(0, |last| last.pixels_end));
        self.middles.extend_from_slice(&seen.middle[..seen.pixels + CHUNK]);
        self.seats.extend_from_slice(seats);
        let (parts_end, pixels_end, blocks_end) = (self.parts.len(), self.middles.len() - CHUNK, self.seats.len());
        self.observations.push(Observation { parts_end, pixels_end, blocks_end });
    }
}

/// The work that makes a [`Placement`] of an arrangement.
pub struct Refill<'a> {
    /// The pixels.
    pub grid: &'a SurfaceGrid,
    /// The view of the observer.
    pub viewer: Viewer,
    /// Their arrangement, ...
    pub arrangement: &'a Arc<Arrangement>,
    /// ... and their origin.
    pub source: &'a Source,
    /// Times of the observations since the star's epoch (d).
    pub since_epoch_d: &'a [f64],
}

impl Task for Refill<'_> {
    type Output = Placement;

    #[inline(always)]
    fn run<I: Instructions>(self, instructions: I) -> Placement {
        match self.grid.points() {
            1 => self.by_points::<1>(instructions),
            4 => self.by_points::<4>(instructions),
            points => unreachable!("{points} points in a pixel"),
        }
    }
}

impl Refill<'_> {
    #[inline(always)]
    fn by_points<const POINTS: usize>(self, instructions: impl Instructions) -> Placement {
        let Refill { grid, viewer, arrangement, source, since_epoch_d } = self;
        assert!(source.observations.len() == since_epoch_d.len());
        let mut views = viewer.views::<POINTS>(grid, &source.rings);
        let mut seen = Seen::with_room_for(grid.len());
        let mut blocks = spare_blocks();
        blocks.resize(source.seats.len(), Block::default());
        let mut begin = Observation { parts_end: 0, pixels_end: 0, blocks_end: 0 };
        for (&time, &end) in since_epoch_d.iter().zip(&source.observations) {
            views.turn(instructions, time);
            let parts = &source.parts[begin.parts_end..end.parts_end];
            let (pixels, middles) = (end.pixels_end - begin.pixels_end, &source.middles[begin.pixels_end..]);
            views.look(instructions, parts, pixels, Some(middles), &mut seen);
            let rows = begin.blocks_end..end.blocks_end;
            // safe: as many pixels are visible as when they were sorted
            #[allow(unsafe_code)]
            unsafe {
                fill(instructions, &source.seats[rows.clone()], &seen, &mut blocks[rows]);
            }
            begin = end;
        }
        Placement::new(Arc::clone(arrangement), blocks)
    }
}
