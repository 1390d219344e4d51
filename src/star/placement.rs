//! Which cell of the velocity grid every visible pixel of every observation lies in, and where in it: the pairs as the hot path
//! reads them.
//!
//! Cells stand side by side (`block`) as [`Order`] says: the fewer pixels a cell has, the more it matters that those of a group have
//! as many; the larger the map, the more that neighbours are taken one after another. Left out: what the pairs are
//! used for (`deposit`).

use super::block::{Block, LANES, Pixel};
use super::grid::SurfaceGrid;
use super::moments::Moments;
use super::view::Viewer;
use crate::vector::elementary::INTEGERS;
use crate::vector::{Instructions, Task};
use std::cell::Cell;

/// The visible pixels of all observations.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Number of visible (pixel, observation) pairs.
    pub pairs: usize,
    groups: Vec<Group>,
    groups_each: usize,
    blocks: Vec<Block>,
}

/// Cells side by side, those with most pixels first; or one, whose pixels are dealt to all lanes.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// First node of each cell.
    cells: [u32; LANES],
    /// First of the group's blocks, and the end.
    blocks: [u32; 2],
}

impl Group {
    fn rows(&self) -> usize {
        (self.blocks[1] - self.blocks[0]) as usize
    }
}

thread_local! {
    /// Memory for blocks that a thread had. What a large map takes, tens of megabytes, the system hands out anew page by page:
    /// three times the time of filling it.
    static SPARE: Cell<Vec<Block>> = const { Cell::new(Vec::new()) };
}

impl Drop for Placement {
    fn drop(&mut self) {
        // where a thread ends, its spare memory may be gone
        let _ = SPARE.try_with(|spare| {
            let (a, b) = (spare.take(), std::mem::take(&mut self.blocks));
            spare.set(if a.capacity() > b.capacity() { a } else { b });
        });
    }
}

impl Placement {
    /// Cells and blocks of the groups of an observation; a cell is counted by the first of its nodes.
    pub fn groups_of(&self, observation: usize) -> impl Iterator<Item = (&[u32; LANES], &[Block])> {
        let groups = &self.groups[observation * self.groups_each..][..self.groups_each];
        groups.iter().map(|group| (&group.cells, &self.blocks[group.blocks[0] as usize..group.blocks[1] as usize]))
    }

    /// Memory (bytes) of all blocks and groups.
    pub fn bytes(&self) -> usize {
        size_of_val(self.blocks.as_slice()) + size_of_val(self.groups.as_slice())
    }

    /// Adds the groups of an observation.
    #[inline(always)]
    fn add(&mut self, seen: &mut Seen, moments: &Moments) {
        self.pairs += seen.pixels;
        let first_group = self.groups.len();
        seen.sort_cells();
        let mut first_block = self.blocks.len() as u32;
        for cells in seen.order.chunks(seen.scale.order.side_by_side()) {
            let most = seen.counts[cells[0] as usize];
            let rows = if seen.scale.order == Order::OneByOne { most.div_ceil(LANES as u32) } else { most };
            let end = first_block + rows;
            // lanes that are left over at the end repeat a cell and have no pixel
            let cells = std::array::from_fn(|lane| *cells.get(lane).unwrap_or(&cells[0]));
            self.groups.push(Group { cells, blocks: [first_block, end] });
            first_block = end;
        }
        let groups = &self.groups[first_group..];
        seen.sort_pixels(groups, moments);
        let rows = groups.iter().map(Group::rows).sum();
        let lanes = seen.sorted.as_chunks::<LANES>().0[..rows].iter();
        self.blocks.extend(lanes.map(|lanes| Block::of(lanes.each_ref())));
    }
}

/// The work that makes a [`Placement`]: looks at the pixels of every observation and sorts the visible ones into cells.
pub struct Place<'a> {
    /// The pixels.
    pub grid: &'a SurfaceGrid,
    /// Who looks at them.
    pub viewer: Viewer,
    /// The velocity grid.
    pub scale: Scale,
    /// Times of the observations since the star's epoch (d).
    pub since_epoch_d: &'a [f64],
}

/// Velocities in steps of the grid.
#[derive(Clone, Copy)]
pub struct Scale {
    /// Velocity of the first node (km/s).
    pub origin_kms: f64,
    /// Steps in a km/s.
    pub steps_per_kms: f64,
    /// Cells that a pixel can lie in.
    pub cells: usize,
    /// How they stand.
    pub order: Order,
}

/// How cells stand side by side.
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

impl Task for Place<'_> {
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

impl Place<'_> {
    #[inline(always)]
    fn by_points<const POINTS: usize>(self, instructions: impl Instructions) -> Placement {
        let Place { grid, viewer, scale, since_epoch_d } = self;
        let mut views = viewer.of::<POINTS>(grid);
        let mut blocks = SPARE.take();
        blocks.clear();
        blocks.reserve(since_epoch_d.len() * grid.len() * 3 / 4 / LANES);
        let groups_each = scale.cells.div_ceil(scale.order.side_by_side());
        let mut placement = Placement { pairs: 0, groups: Vec::new(), groups_each, blocks };
        let mut seen = Seen::new(scale, grid.len());
        for &time in since_epoch_d {
            let moments = views.look(instructions, time);
            seen.place(moments);
            placement.add(&mut seen, moments);
        }
        placement
    }
}

/// What one observation sees.
struct Seen {
    scale: Scale,
    /// Number of pixels of the map.
    map_pixels: usize,
    /// Number of visible pixels.
    pixels: usize,
    /// Of each, in the order in which they were seen: its cell, and where in it.
    cell: Vec<u32>,
    position: Vec<f32>,
    /// How many of the pixels before it lie in its cell, times the places from one to the next.
    rank: Vec<u32>,
    /// Pixels in each cell.
    counts: Vec<u32>,
    /// The cells as they stand side by side.
    order: Vec<u32>,
    /// Place of the first pixel of each cell among the sorted ones.
    firsts: Vec<u32>,
    /// The pixels of all cells of all groups one after another, as many places for each cell of a group.
    sorted: Vec<Pixel>,
}

impl Seen {
    fn new(scale: Scale, pixels: usize) -> Self {
        let (room, cells) = (pixels.next_multiple_of(LANES), scale.cells);
        // what unchecked places rely on: none of them is beyond 32 bits
        assert!(LANES.saturating_mul(pixels + cells + LANES) < u32::MAX as usize);
        Seen {
            scale,
            map_pixels: pixels,
            pixels: 0,
            cell: vec![0; room],
            position: vec![0.0; room],
            rank: vec![0; room],
            counts: vec![0; cells + 1],
            order: vec![0; cells],
            firsts: vec![0; cells + 1],
            sorted: Vec::new(),
        }
    }

    /// Finds the cell of every pixel and its place there.
    #[inline(always)]
    fn place(&mut self, moments: &Moments) {
        self.pixels = moments.pixels;
        let Scale { origin_kms, steps_per_kms, .. } = self.scale;
        let (whole, last) = (self.pixels.next_multiple_of(LANES), self.scale.cells as u32 - 1);
        let places = self.position[..whole].iter_mut().zip(&mut self.cell[..whole]);
        for ((position, cell), velocity) in places.zip(&moments.velocity) {
            let steps = (velocity - origin_kms) * steps_per_kms - 0.5;
            // the middle of the cell: the last bits of the sum are an integer
            let middle = steps + INTEGERS;
            // at angles beyond all meaning velocities are, too
            *cell = (middle.to_bits() as u32).wrapping_sub(NODES_BEFORE).min(last);
            *position = (steps - (middle - INTEGERS)) as f32;
        }
    }

    /// Counts the pixels of every cell, and puts the cells in their order.
    fn sort_cells(&mut self) {
        self.counts.fill(0);
        let step = self.scale.order.side_by_side() as u32;
        let whole = self.pixels.next_multiple_of(LANES);
        self.cell[self.pixels..whole].fill(self.scale.cells as u32);
        for (cell, rank) in self.cell[..whole].iter().zip(&mut self.rank) {
            let count = &mut self.counts[*cell as usize];
            *rank = *count;
            *count += step;
        }
        const { assert!(LANES.is_power_of_two()) }
        let shift = step.trailing_zeros();
        self.counts.iter_mut().for_each(|count| *count >>= shift);
        let counts = &self.counts[..self.scale.cells];
        if self.scale.order != Order::BySize {
            self.order.iter_mut().enumerate().for_each(|(cell, place)| *place = cell as u32);
            for group in self.order.chunks_mut(self.scale.order.side_by_side()) {
                group.sort_by_key(|cell| std::cmp::Reverse(counts[*cell as usize]));
            }
            return;
        }
        let most = counts.iter().fold(0, |most, count| most.max(*count)) as usize;
        // of each number of pixels the cells that have it, then those that have more
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

    /// Sorts the pixels by group, cell, and order in which they were seen.
    #[inline(always)]
    #[allow(unsafe_code)]
    fn sort_pixels(&mut self, groups: &[Group], moments: &Moments) {
        let per_variance = (0.5 * self.scale.steps_per_kms * self.scale.steps_per_kms) as f32;
        // from one pixel of a cell to the next, and as many cells
        let step = self.scale.order.side_by_side();
        let mut end = 0;
        for (group, cells) in groups.iter().zip(self.order.chunks(step)) {
            let places = end..end + LANES * group.rows();
            self.sorted.resize(self.sorted.len().max(places.end), Pixel::default());
            // where cells have no pixels left: hardly ever one pixel in two blocks that follow each other, for no sum to wait
            // for another
            let full = cells.get(step - 1).map_or(0, |last| step * self.counts[*last as usize] as usize);
            let first_pixel = (end + full) % self.map_pixels.max(1);
            for (k, place) in self.sorted[places.clone()][full..].iter_mut().enumerate() {
                // of the smallest maps it is the last pixel again and again
                let pixel = first_pixel + k;
                let pixel =
                    if pixel < self.map_pixels { pixel } else { (pixel - self.map_pixels).min(self.map_pixels - 1) };
                *place = Pixel { pixel: pixel as u32, ..Pixel::default() };
            }
            for (lane, cell) in cells.iter().enumerate() {
                self.firsts[*cell as usize] = (end + lane) as u32;
            }
            end = places.end;
        }
        let Seen { sorted, firsts, .. } = self;
        firsts[self.scale.cells] = end as u32;
        sorted.resize(sorted.len().max(end + LANES * LANES), Pixel::default());
        let numbers = moments.weight.as_chunks().0.iter().zip(self.position.as_chunks().0);
        let rest = moments.variance.as_chunks().0.iter().zip(moments.pixel.as_chunks().0);
        let places = self.cell.as_chunks::<LANES>().0.iter().zip(self.rank.as_chunks::<LANES>().0);
        for (((weight, position), (variance, pixel)), (cells, ranks)) in
            numbers.zip(rest).zip(places).take(self.pixels.div_ceil(LANES))
        {
            let mut block = Block { weight: *weight, position: *position, spread: *variance, pixel: *pixel };
            block.spread.iter_mut().for_each(|spread| *spread *= per_variance);
            // safe: a cell is at most the last, or beyond the last pixel the one behind it, and `firsts` has an entry for each; a
            // rank is below what was counted of its cell, for which there is room in `sorted`, and for LANES pixels behind all
            unsafe {
                let place = |lane: usize| firsts.get_unchecked(cells[lane] as usize) + ranks[lane];
                block.deal(std::array::from_fn(|lane| place(lane) as usize), sorted);
            }
        }
    }
}

/// Nodes of a cell before the one at its lower border.
const NODES_BEFORE: u32 = 2;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::kernel;
    use crate::star::line_profile::DEPOSIT_NODES;
    use crate::star::{LimbDarkening, Orbit, Quadrature, Rotation, StarState};
    use crate::vector;

    /// Deposits `x` as an observation sees it on so many nodes, and gives a map what it gets from others.
    struct Both<'a>(&'a Placement, usize, &'a [f64], usize);

    impl Task for Both<'_> {
        type Output = (Vec<f64>, Vec<f64>);

        #[inline(always)]
        #[allow(unsafe_code)]
        fn run<I: Instructions>(self, i: I) -> Self::Output {
            let Both(placement, observation, x, nodes) = self;
            let (mut left, mut out) = (vec![0.0; DEPOSIT_NODES * nodes], vec![0.0; x.len()]);
            let given: Vec<f64> = (0..nodes).map(|node| (1.3 * node as f64).cos()).collect();
            for (cells, blocks) in placement.groups_of(observation) {
                // safe: `x` has the map's pixels, and the grid so many nodes
                unsafe {
                    kernel::gather(i.doubles(), blocks, cells, x, &mut left);
                    kernel::scatter(i.doubles(), blocks, cells, &given, &mut out);
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
            orbit: Orbit { k_kms: 0.0, porb_over_prot: 1.0, phi: 0.0 },
            surface: Default::default(),
        };
        let viewer = Viewer::new(&state, LimbDarkening::Linear(0.7));
        let times = [0.0, 0.9, 700.3];
        for (pixels, quadrature) in [(3, Quadrature::Centre), (7, Quadrature::Gauss2x2), (900, Quadrature::Gauss2x2)] {
            let grid = SurfaceGrid::equal_area(pixels, quadrature);
            let place = |order: Order| {
                let scale = Scale { origin_kms: -46.0, steps_per_kms: 1.0, cells: 88, order };
                vector::run(Place { grid: &grid, viewer, scale, since_epoch_d: &times })
            };
            let [sorted, in_order, one_by_one] = [Order::BySize, Order::ByVelocity, Order::OneByOne].map(place);
            assert!(sorted.pairs == in_order.pairs && sorted.pairs == one_by_one.pairs);
            let x: Vec<f64> = (0..grid.len()).map(|p| (0.7 * p as f64).sin()).collect();
            for observation in 0..times.len() {
                let mut seen: Vec<u32> = Vec::new();
                for (_, blocks) in sorted.groups_of(observation) {
                    let lanes = blocks.iter().flat_map(|block| block.pixel.iter().zip(block.weight));
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
