//! The sum over visible pixels: brightness deposited on a velocity grid, and its transpose. This is the hot path.
//!
//! Every visible (pixel, observation) pair holds six weights on consecutive nodes of a uniform velocity grid (see
//! `line_profile`): 32 bytes and six multiply-adds, whatever the shape and width of the line. The weights depend on the
//! star's rotation, inclination and vsini alone; an orbit or a systemic velocity leaves them as they are.
//! Left out: the line itself (`convolution`).

use super::StarState;
use super::grid::SurfaceGrid;
use super::limb_darkening::LimbDarkening;
use super::line_profile::{DEPOSIT_NODES, deposit_weights};
use super::view::Viewer;

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
    /// First pair of each observation, and the end.
    starts: Vec<usize>,
    pairs: Vec<Pair>,
}

/// Grids that are summed side by side.
pub const LANES: usize = 4;

/// One visible pixel of one observation.
#[derive(Clone, Copy, Debug)]
struct Pair {
    weights: [f32; DEPOSIT_NODES],
    pixel: u32,
    node: u16,
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
        let capacity = since_epoch_d.len() * grid.len() * 5 / 8;
        let mut deposit = Deposit {
            origin_kms: -reach * step_kms,
            step_kms,
            nodes: 2 * reach as usize + 1,
            pixels: grid.len(),
            starts: vec![0],
            pairs: Vec::with_capacity(capacity),
        };
        assert!(deposit.nodes <= usize::from(u16::MAX), "velocity grid of {} nodes", deposit.nodes);
        let mut views = Vec::new();
        for &time in since_epoch_d {
            for ring in &grid.rings {
                viewer.look(grid, ring, time, &mut views);
                for (p, view) in ring.pixels.clone().zip(&views) {
                    if view.weight > 0.0 {
                        let (mean, variance) = view.velocity();
                        deposit.push(p, view.weight, mean, variance);
                    }
                }
            }
            deposit.starts.push(deposit.pairs.len());
        }
        deposit
    }

    /// Number of nodes in steps of `step_kms` that a state takes.
    pub fn nodes_at(state: &StarState, limb: LimbDarkening, step_kms: f64) -> f64 {
        2.0 * reach(&Viewer::new(state, limb), step_kms) + 1.0
    }

    fn push(&mut self, pixel: usize, weight: f64, velocity: f64, variance: f64) {
        let position = (velocity - self.origin_kms) / self.step_kms;
        let cell = position.floor();
        let spread = variance / (2.0 * self.step_kms * self.step_kms);
        let mut weights = [0.0; DEPOSIT_NODES];
        for (w, share) in weights.iter_mut().zip(deposit_weights(position - cell, spread)) {
            *w = (weight * share) as f32;
        }
        self.pairs.push(Pair { weights, pixel: pixel as u32, node: cell as u16 - 2 });
    }

    /// Number of visible (pixel, observation) pairs.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Number of pixels of the map.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Deposits map `x` (one number a pixel) as observation `k` sees it on the velocity grid: the sum over `lanes` of
    /// [`LANES`] grids.
    #[inline(always)]
    pub fn gather<const FMA: bool>(&self, k: usize, x: &[f64], lanes: &mut [f64]) {
        lanes.fill(0.0);
        let stride = self.nodes;
        // neighbours in a ring hit overlapping nodes: with a grid each, none waits for the other's sums to reach memory
        for (i, pair) in self.pairs_of(k).enumerate() {
            let first = (i % LANES) * stride + usize::from(pair.node);
            let brightness = x[pair.pixel as usize];
            let target: &mut [f64; DEPOSIT_NODES] =
                (&mut lanes[first..first + DEPOSIT_NODES]).try_into().expect("a whole window");
            for (t, w) in target.iter_mut().zip(pair.weights) {
                *t = multiply_add::<FMA>(brightness, f64::from(w), *t);
            }
        }
    }

    /// Transpose of [`Deposit::gather`]: adds to map `out` what observation `k` gives back from the grid `nodes`.
    #[inline(always)]
    pub fn scatter<const FMA: bool>(&self, k: usize, nodes: &[f64], out: &mut [f64]) {
        for pair in self.pairs_of(k) {
            let first = usize::from(pair.node);
            let source: &[f64; DEPOSIT_NODES] =
                (&nodes[first..first + DEPOSIT_NODES]).try_into().expect("a whole window");
            let w = pair.weights.map(f64::from);
            let mut sums = [source[0] * w[0], source[1] * w[1], source[2] * w[2], source[3] * w[3]];
            sums[0] = multiply_add::<FMA>(source[4], w[4], sums[0]);
            sums[1] = multiply_add::<FMA>(source[5], w[5], sums[1]);
            out[pair.pixel as usize] += (sums[0] + sums[2]) + (sums[1] + sums[3]);
        }
    }

    #[inline(always)]
    fn pairs_of(&self, k: usize) -> impl Iterator<Item = &Pair> {
        self.pairs[self.starts[k]..self.starts[k + 1]].iter()
    }
}

/// `a b + c`, fused where the processor can.
#[inline(always)]
pub fn multiply_add<const FMA: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// Nodes on either side of the line's centre.
fn reach(viewer: &Viewer, step_kms: f64) -> f64 {
    (viewer.largest_velocity_kms() / step_kms).ceil() + 3.0
}
