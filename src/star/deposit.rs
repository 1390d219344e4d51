//! Brightness deposited on a velocity grid, for every observation, and its transpose. This is the hot path.
//!
//! Every visible (pixel, observation) pair lies in one cell of a uniform velocity grid. The pairs of a cell are
//! contiguous, and are summed as powers of the position within the cell (`kernel`); the cell's polynomials
//! (`line_profile`) convert these sums to node values, whatever the shape and width of the line. The pairs depend only
//! on the star's rotation, inclination and vsini; an orbit or a systemic velocity does not change them.

use super::StarState;
use super::exposure::Exposure;
use super::filling::{Refill, Source};
use super::grid::SurfaceGrid;
use super::kernel;
use super::limb_darkening::LimbDarkening;
use super::line_profile::DEPOSIT_NODES;
use super::placement::{Arrangement, Placement, Scale};
use super::sorting::{Order, Sort};
use super::view::Viewer;
use crate::numerics::vector::{self, Instructions, Number};
use std::sync::Arc;

/// Deposits on a grid of velocities in the star's frame, for a set of observation times.
#[derive(Clone, Debug)]
pub struct Deposit {
    /// Step of the grid (km/s).
    pub step_kms: f64,
    /// Number of nodes, as many on either side of velocity 0.
    pub nodes: usize,
    pixels: usize,
    placement: Placement,
    looks: Looks,
}

/// The sampling times of the star: once per profile, or several times in its exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct Looks {
    /// Times since the star's epoch (d), of one profile after another.
    pub since_epoch_d: Vec<f64>,
    /// Weight of each in its profile.
    weights: Vec<f64>,
    /// First sample of each profile, and the end; empty where each profile has one.
    starts: Vec<usize>,
}

impl Looks {
    /// For profiles at these times since the star's epoch (d); without exposures, at instants.
    pub fn new(since_epoch_d: impl Iterator<Item = f64>, exposures: &[Exposure]) -> Self {
        if exposures.is_empty() {
            return Looks { since_epoch_d: since_epoch_d.collect(), weights: Vec::new(), starts: Vec::new() };
        }
        let mut looks = Looks { since_epoch_d: Vec::new(), weights: Vec::new(), starts: vec![0] };
        for (time_d, exposure) in since_epoch_d.zip(exposures) {
            for (from_middle_d, weight) in exposure.looks() {
                looks.since_epoch_d.push(time_d + from_middle_d);
                looks.weights.push(weight);
            }
            looks.starts.push(looks.since_epoch_d.len());
        }
        looks
    }

    /// The samples of profile `k`, with their weights.
    #[inline(always)]
    fn of(&self, k: usize) -> impl Iterator<Item = (usize, f64)> {
        let looks = if self.starts.is_empty() { k..k + 1 } else { self.starts[k]..self.starts[k + 1] };
        looks.map(|look| (look, self.weights.get(look).copied().unwrap_or(1.0)))
    }
}

/// Pixels in their cells, for deposits of several stars. For other stars than the original one they may be outside of
/// their cells.
#[derive(Clone, Debug)]
pub struct Arranged {
    /// Step of the grid (km/s).
    pub step_kms: f64,
    nodes: usize,
    pixels: usize,
    arrangement: Arc<Arrangement>,
    source: Source,
}

/// A star with its observations.
pub struct Observed<'a> {
    /// Its pixels.
    pub grid: &'a SurfaceGrid,
    /// Rotation, inclination and vsini.
    pub state: &'a StarState,
    /// Limb darkening.
    pub limb: LimbDarkening,
    /// Whether pixels are also weighted by `1 - mu`.
    pub limb_alone: bool,
    /// Sampling times.
    pub looks: Looks,
    /// Step (km/s) of the velocity grid for its line.
    pub step_kms: f64,
}

impl Deposit {
    /// Deposits of all visible pixels.
    pub fn new(star: &Observed) -> Self {
        Deposit::sorted(star, 0.0, false).0
    }

    /// Deposits of all pixels that are visible or nearly so, by `margin` (rad); and their origin, if they are to be
    /// updated.
    fn sorted(star: &Observed, margin: f64, again: bool) -> (Self, Option<Source>) {
        let &Observed { grid, state, limb, limb_alone, ref looks, step_kms } = star;
        // the statements on pixels below hold for these
        assert!(grid.rings.iter().all(|ring| ring.pixels.end <= grid.len()));
        let order = match grid.len() {
            pixels if pixels <= MEDIUM_MAP => Order::BySize,
            pixels if pixels <= LARGE_MAP => Order::ByVelocity,
            _ => Order::OneByOne,
        };
        let viewer = Viewer::new(state, limb, limb_alone, step_kms);
        let sight = viewer.sight(grid, margin);
        let reach = reach(&viewer);
        let nodes = 2 * reach as usize + 1;
        let scale = Scale { first_node: -reach, cells: nodes + 1 - DEPOSIT_NODES };
        let (placement, source) =
            vector::run(Sort { grid, viewer, sight, scale, order, since_epoch_d: &looks.since_epoch_d, again });
        (Deposit { step_kms, nodes, pixels: grid.len(), placement, looks: looks.clone() }, source)
    }

    /// Velocity of the grid's first node (km/s).
    pub fn origin_kms(&self) -> f64 {
        -((self.nodes / 2) as f64) * self.step_kms
    }

    /// Number of nodes in steps of `step_kms` for a state.
    pub fn nodes_at(state: &StarState, limb: LimbDarkening, step_kms: f64) -> f64 {
        2.0 * reach(&Viewer::new(state, limb, false, step_kms)) + 1.0
    }

    /// Number of visible (pixel, observation) pairs.
    pub fn pairs(&self) -> usize {
        self.placement.pairs()
    }

    /// Memory (bytes) that a pass over all pairs reads.
    pub fn bytes(&self) -> usize {
        self.placement.bytes()
    }

    /// Number of pixels of the map.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Deposits map `x` (one number per pixel) for profile `k` on the velocity grid (overwritten). Contributions of
    /// cells to each of their nodes are stored in `left`, which is empty at first.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn gather<N: Number>(&self, i: impl Instructions, k: usize, x: &[N], left: &mut Vec<N>, nodes: &mut [f64]) {
        assert!(x.len() == self.pixels && nodes.len() == self.nodes);
        assert!(left.is_empty() || left.len() == DEPOSIT_NODES * self.nodes);
        left.resize(DEPOSIT_NODES * self.nodes, N::default());
        nodes.fill(0.0);
        for (look, weight) in self.looks.of(k) {
            for group in self.placement.groups_of(look) {
                // safe: groups contain only pixels and cells of the grid
                unsafe { kernel::gather(N::registers(i), group, x, left) };
            }
            for two in left.chunks_exact(2 * self.nodes) {
                let (a, b) = (&two[..nodes.len()], &two[self.nodes..][..nodes.len()]);
                for (n, node) in nodes.iter_mut().enumerate() {
                    *node += weight * (a[n].into() + b[n].into());
                }
            }
        }
    }

    /// Transpose of [`Deposit::gather`]: adds to map `out` the contribution of profile `k` from the grid `nodes`.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub fn scatter<N: Number>(&self, i: impl Instructions, k: usize, nodes: &[N], out: &mut [N]) {
        assert!(out.len() == self.pixels && nodes.len() == self.nodes);
        let mut weighted = Vec::new();
        for (look, weight) in self.looks.of(k) {
            let nodes = if weight == 1.0 {
                nodes
            } else {
                weighted.clear();
                weighted.extend(nodes.iter().map(|node| N::of(weight * (*node).into())));
                &weighted
            };
            for group in self.placement.groups_of(look).filter(|group| !group.blocks.is_empty()) {
                // safe: as above
                unsafe { kernel::scatter(N::registers(i), group, nodes, out) };
            }
        }
    }
}

impl Arranged {
    /// Arranges pixels as seen for a star, with a margin (rad) beyond the limb.
    pub fn new(star: &Observed, margin: f64) -> Self {
        let (deposit, source) = Deposit::sorted(star, margin, true);
        let Deposit { step_kms, nodes, pixels, ref placement, .. } = deposit;
        let arrangement = Arc::clone(placement.arrangement());
        Arranged { step_kms, nodes, pixels, arrangement, source: source.expect("asked for") }
    }

    /// Deposits of the same pixels for another star at the same times, on the same grid.
    pub fn deposit(&self, star: &Observed) -> Deposit {
        let &Arranged { step_kms, nodes, pixels, ref arrangement, ref source } = self;
        let &Observed { grid, state, limb, limb_alone, ref looks, .. } = star;
        assert!(grid.len() == pixels && star.step_kms == step_kms);
        let viewer = Viewer::new(state, limb, limb_alone, step_kms);
        let placement = vector::run(Refill { grid, viewer, arrangement, source, since_epoch_d: &looks.since_epoch_d });
        Deposit { step_kms, nodes, pixels, placement, looks: looks.clone() }
    }
}

/// Up to this many pixels cells have few of them, and a pass takes a tenth longer in the order of velocities (5,000
/// pixels, in double precision); ...
const MEDIUM_MAP: usize = 12_000;

/// ... up to this many it takes a tenth less (20,000), and beyond it pixels of one cell should be contiguous: another
/// tenth (80,000).
const LARGE_MAP: usize = 40_000;

/// Nodes on either side of the line's centre.
fn reach(viewer: &Viewer) -> f64 {
    viewer.largest_velocity().ceil() + 3.0
}
