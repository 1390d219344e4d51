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
use super::view::{Viewer, Views};
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

    fn blocks_of(&self, observation: usize) -> impl Iterator<Item = &[Block]> {
        let first = observation * self.cells();
        let bounds = self.starts[first..first + self.cells() + 1].windows(2);
        bounds.map(|b| &self.blocks[b[0] as usize..b[1] as usize])
    }

    /// Deposits map `x` (one number a pixel) as observation `k` sees it on the velocity grid (overwritten).
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn gather<I: Instructions>(&self, i: I, k: usize, x: &[f64], moments: &mut Moments, nodes: &mut [f64]) {
        assert_eq!(x.len(), self.pixels);
        let mut powers = moments.powers.each_mut().map(|power| power[BEYOND..self.nodes].iter_mut());
        for blocks in self.blocks_of(k) {
            // safe: blocks hold pixels of the grid alone
            let sums = unsafe { kernel::sum(i, blocks, x) };
            powers.iter_mut().zip(sums).for_each(|(power, sum)| *power.next().expect("a cell") = sum);
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
        let mut views = Views::new(grid.len());
        let mut cells = vec![0; grid.len()];
        let half_inverse_square = 0.5 / (deposit.step_kms * deposit.step_kms);
        for &time in since_epoch_d {
            viewer.look(instructions, grid, time, &mut views);
            // from velocities to positions on the grid, with the cell that the first of its nodes counts
            let mut next = vec![0; deposit.cells()];
            for ((weight, velocity), cell) in views.weight.iter().zip(&mut views.velocity).zip(&mut cells) {
                if *weight > 0.0 {
                    *velocity = (*velocity - deposit.origin_kms) / deposit.step_kms;
                    *cell = *velocity as u32 - 2;
                    next[*cell as usize] += 1;
                    deposit.pairs += 1;
                }
            }
            let mut end = deposit.blocks.len();
            for next in &mut next {
                let count = std::mem::replace(next, LANES * end);
                end += usize::div_ceil(count, LANES);
                deposit.starts.push(end as u32);
            }
            deposit.blocks.resize(end, Block::empty(0));
            for (p, (weight, cell)) in views.weight.iter().zip(&cells).enumerate() {
                if *weight > 0.0 {
                    let next = &mut next[*cell as usize];
                    let (block, lane) = (&mut deposit.blocks[*next / LANES], *next % LANES);
                    *next += 1;
                    block.weight[lane] = *weight as f32;
                    block.position[lane] = (views.velocity[p] - f64::from(*cell + 2)) as f32;
                    block.spread[lane] = (views.variance[p] * half_inverse_square) as f32;
                    block.pixel[lane] = p as u32;
                }
            }
        }
    }
}

/// Nodes on either side of the line's centre.
fn reach(viewer: &Viewer, step_kms: f64) -> f64 {
    (viewer.largest_velocity_kms() / step_kms).ceil() + 3.0
}
