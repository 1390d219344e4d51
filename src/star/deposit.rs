//! The sum over visible pixels: brightness deposited on a velocity grid, and its transpose. This is the hot path.
//!
//! Every visible (pixel, observation) pair holds six weights on consecutive nodes of a uniform velocity grid (see
//! `line_profile`): 30 bytes and six multiply-adds a pair, whatever the shape and width of the line. The weights depend on
//! the star's rotation, inclination and vsini alone; an orbit or a systemic velocity leaves them as they are.
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
    pixel: Vec<u32>,
    node: Vec<u16>,
    weights: Vec<[f32; DEPOSIT_NODES]>,
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
            pixel: Vec::with_capacity(capacity),
            node: Vec::with_capacity(capacity),
            weights: Vec::with_capacity(capacity),
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
            deposit.starts.push(deposit.pixel.len());
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
        self.pixel.push(pixel as u32);
        self.node.push(cell as u16 - 2);
        self.weights.push(deposit_weights(position - cell, spread).map(|w| (weight * w) as f32));
    }

    /// Number of visible (pixel, observation) pairs.
    pub fn pairs(&self) -> usize {
        self.pixel.len()
    }

    /// Number of pixels of the map.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Deposits map `x` (one number a pixel) as observation `k` sees it on the velocity grid `nodes`.
    pub fn gather(&self, k: usize, x: &[f64], nodes: &mut [f64]) {
        nodes.fill(0.0);
        let range = self.starts[k]..self.starts[k + 1];
        for i in range {
            let b = x[self.pixel[i] as usize];
            let first = usize::from(self.node[i]);
            let target: &mut [f64; DEPOSIT_NODES] =
                (&mut nodes[first..first + DEPOSIT_NODES]).try_into().expect("as many nodes");
            for (t, w) in target.iter_mut().zip(self.weights[i]) {
                *t += b * f64::from(w);
            }
        }
    }

    /// Transpose of [`Deposit::gather`]: adds to map `out` what observation `k` gives back from the grid `nodes`.
    pub fn scatter(&self, k: usize, nodes: &[f64], out: &mut [f64]) {
        let range = self.starts[k]..self.starts[k + 1];
        for i in range {
            let first = usize::from(self.node[i]);
            let source: &[f64; DEPOSIT_NODES] =
                (&nodes[first..first + DEPOSIT_NODES]).try_into().expect("as many nodes");
            let w = self.weights[i];
            let product = |j: usize| source[j] * f64::from(w[j]);
            let sum = (product(0) + product(1)) + (product(2) + product(3)) + (product(4) + product(5));
            out[self.pixel[i] as usize] += sum;
        }
    }
}

/// Nodes on either side of the line's centre.
fn reach(viewer: &Viewer, step_kms: f64) -> f64 {
    (viewer.largest_velocity_kms() / step_kms).ceil() + 3.0
}
