//! The linear part of the forward model: a map of the surface to the line depth and continuum of every profile of one
//! data set, before the division of one by the other; and its transpose. `stacked` puts those of several sets together.
//!
//! `docs/method.md` section 1: `sum_p w x l(v - v_p - V_k)` for every bin and `sum_p w x` for every profile.

use super::convolution::{Convolutions, Rows, VelocityGrid};
use super::deposit::{Deposit, Observed};
use super::grid::SurfaceGrid;
use super::line_profile::LineKernel;
use super::seen::Seen;
use super::{StarSettings, StarState};
use crate::numerics::vector::{self, Instructions, Number, Task};
use nalgebra::DMatrixView;
use std::sync::Arc;

/// Most nodes of the velocity grid, which spans twice the fastest velocity in steps of a fraction of the local line's
/// width. A star has a few hundred; this many have more cells than a map has pixels, and every pass goes through all of
/// them.
pub const MOST_NODES: f64 = 65_535.0;

/// Most grid steps in a velocity bin; beyond it the line is so much narrower than a bin that it hides between two of
/// them.
pub const MOST_STEPS_PER_BIN: f64 = 200.0;

/// The response of a data set to a map of the star.
#[derive(Clone, Debug)]
pub(super) struct Part {
    deposit: Arc<Deposit>,
    convolutions: Convolutions,
    /// First bin of each profile, and the end.
    starts: Vec<usize>,
    contrast: f64,
    /// Of each profile the number of its map; empty where there is one.
    map_of: Vec<usize>,
}

impl Part {
    /// The response at one state of star and planet.
    pub fn new(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, seen: &Seen) -> Self {
        let star = &star.with(&state.surface);
        let deposit = Deposit::new(&observed(grid, star, state, seen));
        Part::shifted(Arc::new(deposit), star, state, seen)
    }

    /// The response at a state that differs from this one's by orbit and systemic velocity alone: only the line is
    /// shifted.
    pub fn with_velocities(&self, star: &StarSettings, state: &StarState, seen: &Seen) -> Self {
        Part::shifted(Arc::clone(&self.deposit), &star.with(&state.surface), state, seen)
    }

    /// Where the map that profile `k` sees stands among `all` pixels; a map that is alone is seen by all.
    fn map(&self, k: usize, all: usize) -> std::ops::Range<usize> {
        let pixels = self.pixels();
        match self.map_of.get(k) {
            Some(map) if all > pixels => map * pixels..(map + 1) * pixels,
            _ => 0..all,
        }
    }

    /// The response of deposits, which orbit and systemic velocity shift.
    pub(super) fn shifted(deposit: Arc<Deposit>, star: &StarSettings, state: &StarState, seen: &Seen) -> Self {
        let sampling = &seen.sampling;
        let kernel = LineKernel::new(star.line, deposit.step_kms);
        let grid = VelocityGrid {
            nodes: deposit.nodes,
            step_kms: deposit.step_kms,
            steps_per_bin: LineKernel::steps_per_bin(star.line, sampling.step_kms),
        };
        let mut starts = vec![0];
        starts.extend(sampling.profiles.iter().scan(0, |end, &(.., bins)| {
            *end += bins;
            Some(*end)
        }));
        let profiles = sampling.profiles.iter().map(|&(time, first_velocity, bins)| {
            let shift = state.vsys_kms + state.motion.velocity_kms(star.cycle(time));
            (first_velocity - shift - deposit.origin_kms(), bins)
        });
        let map_of = seen.own_maps.iter().map(|own| own.number).collect();
        let convolutions = Convolutions::new(&kernel, grid, profiles);
        Part { deposit, convolutions, starts, contrast: star.contrast, map_of }
    }

    fn rows(&self) -> Rows {
        let bins = self.starts.windows(2).map(|s| s[1] - s[0]);
        self.convolutions.rows(bins.max().unwrap_or(0))
    }

    /// Brightness of a spot over that of the photosphere in the state that it was made at.
    pub fn contrast(&self) -> f64 {
        self.contrast
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.deposit.pixels()
    }

    /// Number of profiles.
    pub fn profiles(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of visible (pixel, profile) pairs.
    pub fn pairs(&self) -> usize {
        self.deposit.pairs()
    }

    /// Memory (bytes) that a pass over all pairs reads.
    pub fn bytes(&self) -> usize {
        self.deposit.bytes()
    }

    /// Bins of profile `k` within the data.
    pub fn bins(&self, k: usize) -> std::ops::Range<usize> {
        self.starts[k]..self.starts[k + 1]
    }

    /// Number of data.
    #[cfg(test)]
    fn data_len(&self) -> usize {
        self.starts[self.starts.len() - 1]
    }

    /// Line depth of every bin and continuum of every profile for the map `x`.
    pub fn apply(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        assert_eq!(continuum.len(), self.profiles());
        vector::run(Apply { response: self, x, line, continuum });
    }

    /// Transpose of [`Part::apply`]; `out` is overwritten.
    pub fn apply_transpose(&self, line: &[f64], continuum: &[f64], out: &mut [f64]) {
        assert_eq!(continuum.len(), self.profiles());
        vector::run(ApplyTranspose { response: self, line, continuum, out });
    }

    /// The transpose of what `weigh` makes of the line depth and continuum of every profile for the map `x`: given the
    /// number of a profile, the depth of its bins, and its continuum, it replaces the depths, and returns what replaces
    /// the continuum. `out` is overwritten. It goes there and back profile by profile: what a large map's pass reads
    /// comes from memory, and is read once. Maps in single precision are good to six digits, and faster.
    pub fn apply_and_back<N: Number>(&self, x: &[N], out: &mut [N], weigh: impl FnMut(usize, &mut [f64], f64) -> f64) {
        vector::run(ApplyAndBack { response: self, x, out, weigh });
    }

    /// Normalised depth `1 - I` of every bin of a star that changes: profile k sees the brightness map in column k
    /// (pixels, profiles).
    pub fn depths_of_each(&self, brightness: DMatrixView<f64>, depths: &mut [f64]) {
        vector::run(OfEach { response: self, brightness, depths });
    }
}

/// Size of the velocity grid that a response takes: grid steps a bin, and nodes. Refuse more than
/// [`MOST_STEPS_PER_BIN`] or [`MOST_NODES`] before a response is asked for.
pub fn velocity_grid(star: &StarSettings, state: &StarState, step_kms: f64) -> (f64, f64) {
    let star = star.with(&state.surface);
    let steps = LineKernel::steps_per_bin(star.line, step_kms) as f64;
    (steps, Deposit::nodes_at(state, star.limb_darkening, step_kms / steps))
}

/// A star, its surface that of the state, as it is observed.
pub(super) fn observed<'a>(
    grid: &'a SurfaceGrid,
    star: &StarSettings,
    state: &'a StarState,
    seen: &Seen,
) -> Observed<'a> {
    let sampling = &seen.sampling;
    let epoch_d = |k: usize| seen.own_maps.get(k).map_or(star.epoch_d, |own| own.epoch_d);
    let since_epoch_d = sampling.profiles.iter().enumerate().map(|(k, p)| p.0 - epoch_d(k)).collect();
    let step_kms = sampling.step_kms / LineKernel::steps_per_bin(star.line, sampling.step_kms) as f64;
    Observed { grid, state, limb: star.limb_darkening, since_epoch_d, step_kms }
}

/// One profile after another, in one direction: the rows of the grid are left as that direction left them.
struct Pass<'a, N> {
    response: &'a Part,
    nodes: Vec<f64>,
    /// What cells leave on their nodes, or what they are given there.
    of_cells: Vec<N>,
    rows: Rows,
}

impl<'a, N: Number> Pass<'a, N> {
    fn new(response: &'a Part) -> Self {
        Pass { response, nodes: vec![0.0; response.deposit.nodes], of_cells: Vec::new(), rows: response.rows() }
    }

    /// Line depth of every bin of profile `k` (overwritten) for the map `x`; returns its continuum.
    #[inline(always)]
    fn forward<I: Instructions>(&mut self, i: I, k: usize, x: &[N], line: &mut [f64]) -> f64 {
        let Pass { response, nodes, of_cells, rows } = self;
        response.deposit.gather(i, k, x, of_cells, nodes);
        rows.interleave(nodes);
        response.convolutions.sum_to_bins(i, k, rows, line);
        total(nodes)
    }

    /// Transpose of [`Pass::forward`]: adds to the map `out`.
    #[inline(always)]
    fn back<I: Instructions>(&mut self, i: I, k: usize, line: &[f64], continuum: f64, out: &mut [N]) {
        let Pass { response, nodes, of_cells, rows } = self;
        response.convolutions.spread_bins(i, k, line, rows);
        rows.deinterleave(nodes);
        of_cells.resize(nodes.len(), N::default());
        of_cells.iter_mut().zip(&*nodes).for_each(|(of_cell, node)| *of_cell = N::of(node + continuum));
        response.deposit.scatter(i, k, of_cells, out);
    }
}

struct Apply<'a> {
    response: &'a Part,
    x: &'a [f64],
    line: &'a mut [f64],
    continuum: &'a mut [f64],
}

impl Task for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, instructions: I) {
        let Apply { response, x, line, continuum } = self;
        let mut pass = Pass::new(response);
        for (k, continuum) in continuum.iter_mut().enumerate() {
            *continuum = pass.forward(instructions, k, &x[response.map(k, x.len())], &mut line[response.bins(k)]);
        }
    }
}

struct OfEach<'a> {
    response: &'a Part,
    brightness: DMatrixView<'a, f64>,
    depths: &'a mut [f64],
}

impl Task for OfEach<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, instructions: I) {
        let OfEach { response, brightness, depths } = self;
        let mut pass = Pass::new(response);
        for (k, map) in brightness.column_iter().enumerate() {
            let depths = &mut depths[response.bins(k)];
            let continuum = pass.forward(instructions, k, map.as_slice(), depths);
            depths.iter_mut().for_each(|depth| *depth /= continuum);
        }
    }
}

struct ApplyTranspose<'a> {
    response: &'a Part,
    line: &'a [f64],
    continuum: &'a [f64],
    out: &'a mut [f64],
}

impl Task for ApplyTranspose<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, instructions: I) {
        let ApplyTranspose { response, line, continuum, out } = self;
        let mut pass = Pass::new(response);
        out.fill(0.0);
        for (k, continuum) in continuum.iter().enumerate() {
            let map = response.map(k, out.len());
            pass.back(instructions, k, &line[response.bins(k)], *continuum, &mut out[map]);
        }
    }
}

/// Profile by profile.
struct ApplyAndBack<'a, N, F> {
    response: &'a Part,
    x: &'a [N],
    out: &'a mut [N],
    weigh: F,
}

impl<N: Number, F: FnMut(usize, &mut [f64], f64) -> f64> Task for ApplyAndBack<'_, N, F> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, instructions: I) {
        let ApplyAndBack { response, x, out, mut weigh } = self;
        let (mut there, mut back, mut line) = (Pass::new(response), Pass::new(response), Vec::new());
        out.fill(N::default());
        for k in 0..response.profiles() {
            line.resize(response.bins(k).len(), 0.0);
            let map = response.map(k, x.len());
            let continuum = there.forward(instructions, k, &x[map.clone()], &mut line);
            let continuum = weigh(k, &mut line, continuum);
            back.back(instructions, k, &line, continuum, &mut out[map]);
        }
    }
}

/// The sum of all, in parts that do not wait for each other.
#[inline(always)]
fn total(x: &[f64]) -> f64 {
    let (chunks, rest) = x.as_chunks::<16>();
    let mut sums = [0.0; 16];
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, x)| *sum += x);
    }
    sums.iter().chain(rest).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::vector::Portable;
    use crate::star::{LimbDarkening, LocalLine, Orbit, Quadrature, Rotation, Sampling};

    fn noise(n: usize) -> Vec<f64> {
        (0..n).map(|i| (0.7 * (i * i) as f64).sin()).collect()
    }

    fn assert_close(a: &[f64], b: &[f64]) {
        let largest = b.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-13 * largest), "{a:?}\n{b:?}");
    }

    #[test]
    fn the_instructions_of_this_processor_give_what_the_portable_ones_give() {
        let star = StarSettings {
            rotation_period_d: 3.0,
            epoch_d: 0.0,
            limb_darkening: LimbDarkening::Linear(0.7),
            contrast: 0.5,
            line: LocalLine::gaussian(3.0, 5.8),
        };
        let state = StarState {
            rotation: Rotation { omega_eq_rad_d: 2.1, domega_rad_d: 0.05 },
            inclination: 0.7,
            vsini_kms: 40.0,
            vsys_kms: 0.3,
            motion: Orbit { k_kms: 0.1, porb_over_prot: 1.7, phi: 0.4 }.into(),
            surface: Default::default(),
        };
        let sampling = Sampling { step_kms: 1.8, profiles: (0..5).map(|k| (0.7 * k as f64, -50.0, 57)).collect() };
        let grid = SurfaceGrid::equal_area(700, Quadrature::Gauss2x2);
        // built and shifted by this processor's instructions: both see the same pairs
        let response = &Part::new(&grid, &star, &state, &sampling.into());
        let (x, y, z) = (noise(grid.len()), noise(response.data_len()), noise(response.profiles()));
        let profiles = || (vec![f64::NAN; y.len()], vec![f64::NAN; z.len()], vec![f64::NAN; x.len()]);
        let (mut line, mut continuum, mut map) = profiles();
        response.apply(&x, &mut line, &mut continuum);
        response.apply_transpose(&y, &z, &mut map);
        let (mut plain_line, mut plain_continuum, mut plain_map) = profiles();
        Apply { response, x: &x, line: &mut plain_line, continuum: &mut plain_continuum }.run(Portable);
        ApplyTranspose { response, line: &y, continuum: &z, out: &mut plain_map }.run(Portable);
        assert_close(&line, &plain_line);
        assert_close(&continuum, &plain_continuum);
        assert_close(&map, &plain_map);

        // there and back, as one and one after the other, in double and in single precision
        let (mut out, mut single, factor) = (vec![f64::NAN; x.len()], vec![f32::NAN; x.len()], 0.3);
        let weigh = |k: usize, line: &mut [f64], continuum: f64| {
            line.iter_mut().zip(&y[response.bins(k)]).for_each(|(line, y)| *line *= y);
            factor * continuum
        };
        response.apply_and_back(&x, &mut out, weigh);
        let rounded: Vec<f32> = x.iter().map(|x| *x as f32).collect();
        response.apply_and_back(&rounded, &mut single, weigh);
        line.iter_mut().zip(&y).for_each(|(line, y)| *line *= y);
        continuum.iter_mut().for_each(|continuum| *continuum *= factor);
        response.apply_transpose(&line, &continuum, &mut map);
        assert_eq!(out, map);
        let largest = map.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(single.iter().zip(&map).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6 * largest));
    }
}
