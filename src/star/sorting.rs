//! Sorts the visible pixels of every observation into the cells of the velocity grid.
//!
//! Cells are grouped (`block`) by [`Order`]: for few pixels per cell it is important that cells of a group have equally
//! many; for large maps that neighbours are contiguous.

use super::block::{Block, LANES, Pixels};
use super::filling::{Seats, Source, fill};
use super::grid::SurfaceGrid;
use super::placement::{Arrangement, Cells, Placement, Scale, spare_blocks, spare_pixels};
use super::view::{NOTHING, Part, Seen, Sight, Viewer};
use crate::numerics::vector::elementary::SINGLE_INTEGERS;
use crate::numerics::vector::{Instructions, Task};
use std::sync::Arc;

/// The work that makes a [`Placement`]: finds the visible pixels of every observation and sorts them into cells.
pub struct Sort<'a> {
    /// The pixels.
    pub grid: &'a SurfaceGrid,
    /// The view of the observer.
    pub viewer: Viewer,
    /// The rings in use.
    pub sight: Sight,
    /// The velocity grid.
    pub scale: Scale,
    /// The order of cells.
    pub order: Order,
    /// Times of the observations since the star's epoch (d).
    pub since_epoch_d: &'a [f64],
    /// Whether the placement will be filled again.
    pub again: bool,
}

/// The order of cells in groups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// In the order of their numbers of pixels.
    BySize,
    /// In the order of their velocities.
    ByVelocity,
    /// One at a time in all lanes, in the order of velocities.
    OneByOne,
}

impl Order {
    /// Cells in a group.
    fn side_by_side(self) -> usize {
        if self == Order::OneByOne { 1 } else { LANES }
    }
}

impl Task for Sort<'_> {
    type Output = (Placement, Option<Source>);

    #[inline(always)]
    fn run<I: Instructions>(self, instructions: I) -> Self::Output {
        match self.grid.points() {
            1 => self.by_points::<1>(instructions),
            4 => self.by_points::<4>(instructions),
            points => unreachable!("{points} points in a pixel"),
        }
    }
}

impl Sort<'_> {
    #[inline(always)]
    fn by_points<const POINTS: usize>(self, instructions: impl Instructions) -> (Placement, Option<Source>) {
        let Sort { grid, viewer, sight, scale, order, since_epoch_d, again } = self;
        let mut views = viewer.views::<POINTS>(grid, &sight.rings);
        let room = since_epoch_d.len() * grid.len() * 3 / 4 / LANES;
        let (mut blocks, mut pixels) = (spare_blocks(), spare_pixels());
        blocks.clear();
        blocks.reserve(room);
        pixels.clear();
        pixels.reserve(room);
        let groups_each = scale.cells.div_ceil(order.side_by_side());
        let mut arrangement = Arrangement { pairs: 0, groups: Vec::new(), groups_each, pixels };
        let mut source = again.then(|| Source::new(&sight.rings));
        let mut sorter = Sorter::new(scale, order, grid.len());
        let mut seen = Seen::with_room_for(grid.len());
        let mut parts = Vec::with_capacity(sight.most_parts(grid.len()));
        for &time in since_epoch_d {
            let pixels = sight.find_parts(time, &mut parts);
            views.turn(instructions, time);
            views.look(instructions, &parts, pixels, None, &mut seen);
            sorter.place(&seen);
            let first_block = blocks.len();
            sorter.sort(&parts, &mut arrangement);
            blocks.resize(arrangement.pixels.len(), Block::default());
            let seats = &sorter.seats.as_chunks().0[..blocks.len() - first_block];
            // safe: every sorted pixel was visible, or is one of those of weight 0 after the last
            #[allow(unsafe_code)]
            unsafe {
                fill(instructions, seats, &seen, &mut blocks[first_block..]);
            }
            if let Some(source) = &mut source {
                source.add(&parts, &seen, seats);
            }
        }
        (Placement::new(Arc::new(arrangement), blocks), source)
    }
}

/// The sorted pixels of one observation.
struct Sorter {
    scale: Scale,
    order_of_cells: Order,
    /// Number of pixels of the map.
    map_pixels: usize,
    /// Number of visible pixels.
    pixels: usize,
    /// Index of each in the map, in the order of the view, and after the last those of [`NOTHING`] others.
    index: Vec<u32>,
    /// Its cell.
    cell: Vec<u32>,
    /// Number of earlier pixels in its cell, times the stride between their places.
    rank: Vec<u32>,
    /// Pixels in each cell.
    counts: Vec<u32>,
    /// The cells in the order of groups.
    order: Vec<u32>,
    /// Place of the first pixel of each cell among the sorted ones.
    firsts: Vec<u32>,
    /// The pixels of all cells of all groups in sequence, with equally many places for each cell of a group.
    seats: Vec<u32>,
}

impl Sorter {
    fn new(scale: Scale, order: Order, pixels: usize) -> Self {
        let (room, cells) = ((pixels + NOTHING).next_multiple_of(LANES), scale.cells);
        // precondition of unchecked places: none of them is beyond 32 bits
        assert!(LANES.saturating_mul(pixels + cells + LANES) < u32::MAX as usize);
        Sorter {
            scale,
            order_of_cells: order,
            map_pixels: pixels,
            pixels: 0,
            index: vec![0; room],
            cell: vec![0; room],
            rank: vec![0; room],
            counts: vec![0; cells],
            order: vec![0; cells],
            firsts: vec![0; cells],
            seats: Vec::new(),
        }
    }

    /// Finds the cell of every pixel.
    #[inline(always)]
    fn place(&mut self, seen: &Seen) {
        self.pixels = seen.pixels;
        let (whole, last) = (self.pixels.next_multiple_of(LANES), self.scale.cells as u32 - 1);
        let first = self.scale.first_middle();
        for (cell, middle) in self.cell[..whole].iter_mut().zip(&seen.middle) {
            // from 2^23 on integers are in the last bits; at meaninglessly large angles velocities are as large
            *cell = (middle - first + SINGLE_INTEGERS).to_bits().wrapping_sub(SINGLE_INTEGERS.to_bits()).min(last);
        }
    }

    /// Adds the placed pixels to the arrangement.
    #[inline(always)]
    fn sort(&mut self, parts: &[Part], arrangement: &mut Arrangement) {
        arrangement.pairs += self.pixels;
        let (first_group, first_row) = (arrangement.groups.len(), arrangement.pixels.len());
        self.sort_cells();
        let mut first_block = first_row as u32;
        for cells in self.order.chunks(self.order_of_cells.side_by_side()) {
            let most = self.counts[cells[0] as usize];
            let rows = if self.order_of_cells == Order::OneByOne { most.div_ceil(LANES as u32) } else { most };
            let end = first_block + rows;
            // unused lanes at the end repeat a cell and have no pixel
            let first_nodes = std::array::from_fn(|lane| *cells.get(lane).unwrap_or(&cells[0]));
            arrangement.groups.push(Cells { first_nodes, blocks: [first_block, end] });
            first_block = end;
        }
        self.sort_pixels(&arrangement.groups[first_group..]);
        parts.iter().for_each(|part| part.list(&mut self.index));
        for (k, index) in self.index[self.pixels..][..NOTHING].iter_mut().enumerate() {
            *index = (k % self.map_pixels.max(1)) as u32;
        }
        let seats: &[Seats] = &self.seats.as_chunks().0[..first_block as usize - first_row];
        arrangement.pixels.resize(first_block as usize, Pixels::default());
        for (pixels, seats) in arrangement.pixels[first_row..].iter_mut().zip(seats) {
            for (pixel, k) in pixels.iter_mut().zip(seats) {
                *pixel = self.index[*k as usize];
            }
        }
    }

    /// Counts the pixels of every cell, and puts the cells in their order.
    fn sort_cells(&mut self) {
        self.counts.fill(0);
        let step = self.order_of_cells.side_by_side() as u32;
        for (cell, rank) in self.cell[..self.pixels].iter().zip(&mut self.rank) {
            let count = &mut self.counts[*cell as usize];
            *rank = *count;
            *count += step;
        }
        const { assert!(LANES.is_power_of_two()) }
        let shift = step.trailing_zeros();
        self.counts.iter_mut().for_each(|count| *count >>= shift);
        let counts = &self.counts;
        if self.order_of_cells != Order::BySize {
            self.order.iter_mut().enumerate().for_each(|(cell, place)| *place = cell as u32);
            for group in self.order.chunks_mut(self.order_of_cells.side_by_side()) {
                group.sort_by_key(|cell| std::cmp::Reverse(counts[*cell as usize]));
            }
            return;
        }
        let most = counts.iter().fold(0, |most, count| most.max(*count)) as usize;
        // for each number of pixels the cells that have it, then those with more
        let mut places = vec![0; most + 1];
        counts.iter().for_each(|count| places[*count as usize] += 1);
        let mut more = 0;
        for cells in places.iter_mut().rev() {
            more += std::mem::replace(cells, more);
        }
        for (cell, count) in counts.iter().enumerate() {
            let place = &mut places[*count as usize];
            self.order[*place] = cell as u32;
            *place += 1;
        }
    }

    /// Sorts the pixels by group, cell, and order of the view.
    #[inline(always)]
    #[allow(unsafe_code)]
    fn sort_pixels(&mut self, groups: &[Cells]) {
        // stride from one pixel of a cell to the next, and number of cells
        let step = self.order_of_cells.side_by_side();
        let mut end = 0;
        for (group, cells) in groups.iter().zip(self.order.chunks(step)) {
            let places = end..end + LANES * group.rows();
            self.seats.resize(self.seats.len().max(places.end), 0);
            // for cells without further pixels: rarely the same pixel of the map in two successive blocks, so that sums
            // are independent
            let full = cells.get(step - 1).map_or(0, |last| step * self.counts[*last as usize] as usize);
            for (k, place) in self.seats[places.clone()][full..].iter_mut().enumerate() {
                *place = (self.pixels + k % NOTHING) as u32;
            }
            for (lane, cell) in cells.iter().enumerate() {
                self.firsts[*cell as usize] = (end + lane) as u32;
            }
            end = places.end;
        }
        for (k, (cell, rank)) in self.cell[..self.pixels].iter().zip(&self.rank).enumerate() {
            // safe: a cell is at most the last, and `firsts` has an entry for each; a rank is below the count of its
            // cell, for which `seats` has room
            unsafe {
                let place = self.firsts.get_unchecked(*cell as usize) + rank;
                *self.seats.get_unchecked_mut(place as usize) = k as u32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::vector;
    use crate::star::block::Group;
    use crate::star::kernel;
    use crate::star::line_profile::DEPOSIT_NODES;
    use crate::star::{LimbDarkening, Orbit, Quadrature, Rotation, StarState};

    /// Deposits `x` for an observation on this many nodes, and applies the transpose to others.
    struct Both<'a>(&'a Placement, usize, &'a [f64], usize);

    impl Task for Both<'_> {
        type Output = (Vec<f64>, Vec<f64>);

        #[inline(always)]
        #[allow(unsafe_code)]
        fn run<I: Instructions>(self, i: I) -> Self::Output {
            let Both(placement, observation, x, nodes) = self;
            let (mut left, mut out) = (vec![0.0; DEPOSIT_NODES * nodes], vec![0.0; x.len()]);
            let given: Vec<f64> = (0..nodes).map(|node| (1.3 * node as f64).cos()).collect();
            for group in placement.groups_of(observation) {
                // safe: `x` has the map's pixels, and the grid this many nodes
                unsafe {
                    kernel::gather(i.doubles(), group, x, &mut left);
                    kernel::scatter(i.doubles(), group, &given, &mut out);
                }
            }
            ((0..nodes).map(|node| left.chunks(nodes).map(|row| row[node]).sum()).collect(), out)
        }
    }

    #[test]
    fn cells_in_any_order_hold_every_visible_pixel_once() {
        let state = StarState {
            rotation: Rotation { omega_eq_rad_d: 2.1, domega_rad_d: 0.05 },
            inclination: 0.7,
            vsini_kms: 40.0,
            vsys_kms: 0.0,
            motion: Orbit { k_kms: 0.0, porb_over_prot: 1.0, phi: 0.0 }.into(),
            surface: Default::default(),
        };
        let viewer = Viewer::new(&state, LimbDarkening::Linear(0.7), false, 1.0);
        let times = [0.0, 0.9, 700.3];
        for (pixels, quadrature) in [(3, Quadrature::Centre), (7, Quadrature::Gauss2x2), (900, Quadrature::Gauss2x2)] {
            let grid = SurfaceGrid::equal_area(pixels, quadrature);
            let place = |order: Order| {
                let (sight, scale) = (viewer.sight(&grid, 0.0), Scale { first_node: -46.0, cells: 88 });
                let sort = Sort { grid: &grid, viewer, sight, scale, order, since_epoch_d: &times, again: false };
                vector::run(sort).0
            };
            let [sorted, in_order, one_by_one] = [Order::BySize, Order::ByVelocity, Order::OneByOne].map(place);
            assert!(sorted.pairs() == in_order.pairs() && sorted.pairs() == one_by_one.pairs());
            let x: Vec<f64> = (0..grid.len()).map(|p| (0.7 * p as f64).sin()).collect();
            for observation in 0..times.len() {
                let mut seen: Vec<u32> = Vec::new();
                for Group { blocks, pixels, .. } in sorted.groups_of(observation) {
                    let lanes = pixels.iter().zip(blocks).flat_map(|(pixels, block)| pixels.iter().zip(block.weight));
                    seen.extend(lanes.filter(|(_, weight)| *weight > 0.0).map(|(pixel, _)| pixel));
                }
                let count = seen.len();
                seen.sort_unstable();
                seen.dedup();
                assert!(count == seen.len() && count > 0, "{pixels} pixels, observation {observation}");
                let both = [&sorted, &in_order, &one_by_one].map(|p| vector::by_each(|| Both(p, observation, &x, 93)));
                let (nodes, map) = &both[0][0];
                for (other_nodes, other_map) in both.iter().flatten() {
                    let pairs = nodes.iter().zip(other_nodes).chain(map.iter().zip(other_map));
                    for (a, b) in pairs {
                        assert!((a - b).abs() < 1e-13, "{pixels} pixels: {a} {b}");
                    }
                }
            }
        }
    }
}
