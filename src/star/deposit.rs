//! Brightness deposited on a velocity grid, for every observation, and its transpose. This is the hot path.
//!
//! Every visible (pixel, observation) pair lies in one cell of a uniform velocity grid. The pairs of a cell lie together, so
//! that the sum over them is one of powers of the position within the cell (`kernel`); the cell's polynomials (`line_profile`)
//! make node values of them, whatever the shape and width of the line. The pairs depend on the star's rotation, inclination
//! and vsini alone; an orbit or a systemic velocity leaves them as they are. Left out: the line itself (`convolution`).

use super::StarState;
use super::grid::SurfaceGrid;
use super::kernel::{self, Block, LANES};
use super::limb_darkening::LimbDarkening;
use super::line_profile::{DEPOSIT_NODES, DEPOSIT_WEIGHTS};
use super::view::{PixelMoments, Viewer};
use crate::vector::{self, Instructions, Task};

/// Deposits on a grid of velocities in the star's frame, for a set of observation times.
#[derive(Clone, Debug)]
pub struct Deposit {
    /// Velocity of the grid's first node (km/s).
    pub origin_kms: f64,
    /// Step of the grid (km/s).
    pub step_kms: f64,
    /// Number of nodes.
    pub nodes: usize,
    pixels: usize,
    pairs: usize,
    /// First block of every cell of every observation, and the end.
    starts: Vec<u32>,
    blocks: Vec<Block>,
}

impl Deposit {
    /// Deposits of all visible pixels at the given times since the star's epoch (d), on a grid of step `step_kms`.
    pub fn new(
        grid: &SurfaceGrid,
        state: &StarState,
        limb: LimbDarkening,
        since_epoch_d: &[f64],
        step_kms: f64,
    ) -> Self {
        let viewer = Viewer::new(state, limb);
        let reach = reach(&viewer, step_kms);
        let mut deposit = Deposit {
            origin_kms: -reach * step_kms,
            step_kms,
            nodes: 2 * reach as usize + 1,
            pixels: grid.len(),
            pairs: 0,
            starts: vec![0],
            blocks: Vec::with_capacity(since_epoch_d.len() * grid.len() * 5 / 8 / LANES),
        };
        vector::run(Build { deposit: &mut deposit, viewer, grid, since_epoch_d });
        deposit
    }

    /// Number of nodes in steps of `step_kms` that a state takes.
    pub fn nodes_at(state: &StarState, limb: LimbDarkening, step_kms: f64) -> f64 {
        2.0 * reach(&Viewer::new(state, limb), step_kms) + 1.0
    }

    /// Number of visible (pixel, observation) pairs.
    pub fn pairs(&self) -> usize {
        self.pairs
    }

    /// Memory (bytes) that a pass over all pairs reads.
    pub fn bytes(&self) -> usize {
        size_of_val(self.blocks.as_slice()) + size_of_val(self.starts.as_slice())
    }

    /// Number of pixels of the map.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Cells of the grid on which something can be deposited: that many of its nodes have all nodes of their cell above them.
    fn cells(&self) -> usize {
        self.nodes - BEYOND
    }

    /// Blocks of every cell of an observation.
    fn blocks_of(&self, observation: usize) -> impl Iterator<Item = &[Block]> {
        let first = observation * self.cells();
        let bounds = self.starts[first..first + self.cells() + 1].windows(2);
        bounds.map(|b| &self.blocks[b[0] as usize..b[1] as usize])
    }

    /// Empty blocks for the pixels of another observation, so many in each cell; turns their numbers into the first lane of each.
    fn add_cells(&mut self, pixels: &mut [usize]) {
        let mut end = self.blocks.len();
        for cell in pixels {
            let count = std::mem::replace(cell, LANES * end);
            end += count.div_ceil(LANES);
            self.starts.push(end as u32);
        }
        self.blocks.resize(end, Block::empty(0));
    }

    /// Deposits map `x` (one number a pixel) as observation `k` sees it on the velocity grid (overwritten).
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn gather<I: Instructions>(&self, i: I, k: usize, x: &[f64], moments: &mut Moments, nodes: &mut [f64]) {
        assert_eq!(x.len(), self.pixels);
        let mut powers = moments.powers.each_mut().map(|power| &mut power[BEYOND..self.nodes]);
        for (cell, blocks) in self.blocks_of(k).enumerate() {
            // safe: blocks hold pixels of the grid alone
            let sums = unsafe { kernel::sum(i, blocks, x) };
            powers.iter_mut().zip(sums).for_each(|(power, sum)| power[cell] = sum);
        }
        nodes.fill(0.0);
        for (power, moments) in moments.powers.iter().enumerate() {
            weigh_neighbours(i, &std::array::from_fn(|n| DEPOSIT_WEIGHTS[BEYOND - n][power]), moments, nodes);
        }
    }

    /// Transpose of [`Deposit::gather`]: adds to map `out` what observation `k` gives back from the grid `nodes`.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn scatter<I: Instructions>(&self, i: I, k: usize, nodes: &[f64], moments: &mut Moments, out: &mut [f64]) {
        assert_eq!(out.len(), self.pixels);
        for (power, coefficients) in moments.powers.iter_mut().enumerate() {
            let cells = &mut coefficients[BEYOND..self.nodes];
            cells.fill(0.0);
            weigh_neighbours(i, &std::array::from_fn(|n| DEPOSIT_WEIGHTS[n][power]), nodes, cells);
        }
        for (cell, blocks) in self.blocks_of(k).enumerate() {
            let coefficients = std::array::from_fn(|power| moments.powers[power][BEYOND + cell]);
            // safe: blocks hold pixels of the grid alone
            unsafe { kernel::spread(i, blocks, &coefficients, out) };
        }
    }
}

/// Nodes of a cell beyond the one that it is counted by.
const BEYOND: usize = DEPOSIT_NODES - 1;

/// Scratch of a deposit: of every power of the position its sum, or its coefficient, in every cell, and room before the first.
#[derive(Clone, Debug)]
pub struct Moments {
    powers: [Vec<f64>; DEPOSIT_NODES],
}

impl Moments {
    /// For the cells of `deposit`.
    pub fn new(deposit: &Deposit) -> Self {
        Moments { powers: std::array::from_fn(|_| vec![0.0; BEYOND + deposit.nodes]) }
    }
}

/// `out[j] += sum_n weights[n] source[j + n]`, as far as there is an output or a source.
#[inline(always)]
fn weigh_neighbours(i: impl Instructions, weights: &[f64; DEPOSIT_NODES], source: &[f64], out: &mut [f64]) {
    let sources: [&[f64]; DEPOSIT_NODES] = std::array::from_fn(|n| &source[n..n + out.len()]);
    for (j, out) in out.iter_mut().enumerate() {
        let term = |n: usize, sum: f64| i.multiply_add(weights[n], sources[n][j], sum);
        *out += term(2, term(1, weights[0] * sources[0][j])) + term(5, term(4, weights[3] * sources[3][j]));
    }
}

/// The work of [`Deposit::new`]: looks at the pixels of every observation and sorts the visible ones into cells.
struct Build<'a> {
    deposit: &'a mut Deposit,
    viewer: Viewer,
    grid: &'a SurfaceGrid,
    since_epoch_d: &'a [f64],
}

impl Task for Build<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, instructions: I) {
        let Build { deposit, viewer, grid, since_epoch_d } = self;
        let mut views = viewer.of(grid);
        let scale = Scale { origin_kms: deposit.origin_kms, steps_per_kms: 1.0 / deposit.step_kms };
        let (mut places, mut lanes) = (Vec::new(), Vec::new());
        for &time in since_epoch_d {
            let seen = views.look(instructions, time);
            deposit.pairs += seen.pixel.len();
            places.resize(seen.pixel.len(), Place::default());
            scale.place(seen, &mut places);
            lanes.clear();
            lanes.resize(deposit.cells(), 0);
            places.iter().for_each(|place| lanes[place.cell as usize] += 1);
            deposit.add_cells(&mut lanes);
            for (place, pixel) in places.iter().zip(&seen.pixel) {
                let next = &mut lanes[place.cell as usize];
                let (block, lane) = (&mut deposit.blocks[*next / LANES], *next % LANES);
                *next += 1;
                block.weight[lane] = place.weight;
                block.position[lane] = place.position;
                block.spread[lane] = place.spread;
                block.pixel[lane] = *pixel;
            }
        }
    }
}

/// Where a pixel goes.
#[derive(Clone, Copy, Default)]
struct Place {
    cell: u32,
    weight: f32,
    position: f32,
    spread: f32,
}

/// Velocities in steps of the grid.
struct Scale {
    origin_kms: f64,
    steps_per_kms: f64,
}

impl Scale {
    /// Cells are counted from the first of their nodes.
    #[inline(always)]
    fn place(&self, seen: &PixelMoments, places: &mut [Place]) {
        let spread = 0.5 * self.steps_per_kms * self.steps_per_kms;
        let moments = seen.weight.iter().zip(&seen.velocity).zip(&seen.variance);
        for (((weight, velocity), variance), place) in moments.zip(places) {
            let position = (velocity - self.origin_kms) * self.steps_per_kms;
            // rounding half a step below gives the whole steps, in the last bits of the sum
            let steps = (position - 0.5) + INTEGERS;
            *place = Place {
                cell: (steps.to_bits() as u32).wrapping_sub(2),
                weight: *weight as f32,
                position: (position - (steps - INTEGERS)) as f32,
                spread: (variance * spread) as f32,
            };
        }
    }
}

/// From here on neighbouring numbers are integers.
const INTEGERS: f64 = 4_503_599_627_370_496.0;

/// Nodes on either side of the line's centre.
fn reach(viewer: &Viewer, step_kms: f64) -> f64 {
    (viewer.largest_velocity_kms() / step_kms).ceil() + 3.0
}
