//! The linear part of the forward model: a map of the surface to the line depth and continuum of every profile of one
//! data set, before the division of one by the other; and its transpose. `stacked` combines those of several sets.
//!
//! `docs/method.md` section 1: `sum_p w x l(v - v_p - V_k)` for every bin and `sum_p w x` for every profile.

use super::convolution::{Convolutions, Rows, VelocityGrid};
use super::deposit::{Deposit, Looks, Observed};
use super::grid::SurfaceGrid;
use super::line_profile::LineKernel;
use super::regions::Mixture;
use super::seen::{Seen, narrowest};
use super::{LocalLine, StarSettings, StarState};
use crate::numerics::vector::{self, Instructions, Number, Task};
use nalgebra::DMatrixView;
use std::sync::Arc;

/// Most nodes of the velocity grid, which spans twice the fastest velocity in steps of a fraction of the local line's
/// width. A star has a few hundred; this many have more cells than a map has pixels, and every pass goes through all of
/// them.
pub const MOST_NODES: f64 = 65_535.0;

/// Most grid steps in a velocity bin; beyond it the line is much narrower than a bin and may fall between two of them.
pub const MOST_STEPS_PER_BIN: f64 = 200.0;

/// The response of a data set to a map of the star.
#[derive(Clone, Debug)]
pub(super) struct Part {
    deposit: Arc<Deposit>,
    convolutions: Convolutions,
    /// First bin of each profile, and the end.
    starts: Vec<usize>,
    contrast: f64,
    /// Index of the map of each profile; empty where there is one.
    map_of: Vec<usize>,
    regions: Option<RegionPart>,
}

/// The terms of active regions, where they are more than dimmed photosphere.
#[derive(Clone, Debug)]
struct RegionPart {
    /// Deposits weighted by `1 - mu`, where needed.
    limb: Option<Arc<Deposit>>,
    convolutions: Convolutions,
    mixture: Mixture,
    /// Difference between the bare photosphere and a map of brightness 1 computed like spots: depth of every bin, and
    /// continuum.
    beyond: (Vec<f64>, Vec<f64>),
}

impl Part {
    /// The response at one state of star and planet; the star has the surface of that state, with the overrides of the
    /// set.
    pub fn new(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, seen: &Seen) -> Self {
        let deposits = DEPOSITS.map(|limb_alone| {
            let observed = observed(grid, star, state, seen, limb_alone);
            needs(star, limb_alone).then(|| Arc::new(Deposit::new(&observed)))
        });
        Part::shifted(deposits, star, state, seen)
    }

    /// The response at a state that differs from this one's by orbit and systemic velocity alone: only the line is
    /// shifted.
    pub fn with_velocities(&self, star: &StarSettings, state: &StarState, seen: &Seen) -> Self {
        let limb = self.regions.as_ref().and_then(|regions| regions.limb.clone());
        Part::shifted([Some(Arc::clone(&self.deposit)), limb], star, state, seen)
    }

    /// Range of the map of profile `k` among `all` pixels; a single map is used by all.
    fn map(&self, k: usize, all: usize) -> std::ops::Range<usize> {
        let pixels = self.pixels();
        match self.map_of.get(k) {
            Some(map) if all > pixels => map * pixels..(map + 1) * pixels,
            _ => 0..all,
        }
    }

    /// The response of deposits ([`DEPOSITS`]), which orbit and systemic velocity shift.
    ///
    /// # Panics
    /// If the first is missing.
    pub(super) fn shifted(
        [deposit, limb]: [Option<Arc<Deposit>>; 2],
        star: &StarSettings,
        state: &StarState,
        seen: &Seen,
    ) -> Self {
        let (deposit, sampling) = (deposit.expect("deposits of all pixels"), &seen.sampling);
        let grid = VelocityGrid {
            nodes: deposit.nodes,
            step_kms: deposit.step_kms,
            steps_per_bin: LineKernel::steps_per_bin(narrowest(star), sampling.step_kms),
        };
        let mut starts = vec![0];
        starts.extend(sampling.profiles.iter().scan(0, |end, &(.., bins)| {
            *end += bins;
            Some(*end)
        }));
        let convolutions = |line: LocalLine, shift_kms: f64| {
            let profiles = sampling.profiles.iter().map(|&(time, first_velocity, bins)| {
                let shift = state.vsys_kms + state.motion.velocity_kms(star.cycle(time)) + shift_kms;
                (first_velocity - shift - deposit.origin_kms(), bins)
            });
            Convolutions::new(&LineKernel::new(line, deposit.step_kms), grid, profiles)
        };
        let map_of = seen.own_maps.iter().map(|own| own.number).collect();
        let regions = (!star.regions.are_plain()).then(|| RegionPart {
            limb,
            convolutions: convolutions(star.regions.line(star.line), star.regions.shift_kms),
            mixture: star.regions.mixture(star.contrast),
            beyond: Default::default(),
        });
        let convolutions = convolutions(star.line, 0.0);
        let mut part = Part { deposit, convolutions, starts, contrast: star.contrast, map_of, regions };
        part.find_what_is_beyond();
        part
    }

    /// Difference between the bare photosphere and a map of brightness 1 computed like spots.
    fn find_what_is_beyond(&mut self) {
        let Some(regions) = self.regions.take() else { return };
        let maps = self.map_of.iter().max().map_or(1, |last| last + 1);
        let ones = vec![1.0; maps * self.pixels()];
        let seen = |part: &Part| {
            let (mut line, mut continuum) = (vec![0.0; part.starts[part.profiles()]], vec![0.0; part.profiles()]);
            part.change(&ones, &mut line, &mut continuum);
            (line, continuum)
        };
        let (mut line, mut continuum) = seen(self);
        self.regions = Some(regions);
        let (line_as_spots, continuum_as_spots) = seen(self);
        line.iter_mut().zip(line_as_spots).for_each(|(line, as_spots)| *line -= as_spots);
        continuum.iter_mut().zip(continuum_as_spots).for_each(|(continuum, as_spots)| *continuum -= as_spots);
        self.regions.as_mut().expect("set above").beyond = (line, continuum);
    }

    /// Adds that difference to profile `k` and to its continuum, which is returned.
    fn beyond(&self, k: usize, line: &mut [f64], continuum: f64) -> f64 {
        let Some(RegionPart { beyond: (of_lines, of_continua), .. }) = &self.regions else { return continuum };
        line.iter_mut().zip(&of_lines[self.bins(k)]).for_each(|(line, beyond)| *line += beyond);
        continuum + of_continua[k]
    }

    fn rows(&self) -> [Rows; 2] {
        let bins = self.starts.windows(2).map(|s| s[1] - s[0]).max().unwrap_or(0);
        let of_regions = self.regions.as_ref().map_or(&self.convolutions, |regions| &regions.convolutions);
        [self.convolutions.rows(bins), of_regions.rows(bins)]
    }

    /// Brightness of a spot over that of the photosphere at the state of this response.
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

    /// Line depth of every bin and continuum of every profile for the brightness map `x`.
    pub fn apply(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        self.change(x, line, continuum);
        for (k, continuum) in continuum.iter_mut().enumerate() {
            *continuum = self.beyond(k, &mut line[self.bins(k)], *continuum);
        }
    }

    /// Their change for a change `x` of the brightness.
    pub fn change(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        assert_eq!(continuum.len(), self.profiles());
        vector::run(Apply { response: self, x, line, continuum });
    }

    /// Transpose of [`Part::change`]; `out` is overwritten.
    pub fn apply_transpose(&self, line: &[f64], continuum: &[f64], out: &mut [f64]) {
        assert_eq!(continuum.len(), self.profiles());
        vector::run(ApplyTranspose { response: self, line, continuum, out });
    }

    /// The transpose applied to the result of `weigh` on the line depth and continuum of every profile for the map `x`:
    /// given the number of a profile, the depth of its bins, and its continuum, it replaces the depths, and returns the
    /// replacement of the continuum. `out` is overwritten. Both passes run profile by profile, so that data of a large
    /// map are read from memory once. Maps in single precision are accurate to six digits, and faster.
    pub fn apply_and_back<N: Number>(&self, x: &[N], out: &mut [N], weigh: impl FnMut(usize, &mut [f64], f64) -> f64) {
        vector::run(ApplyAndBack { response: self, x, out, weigh });
    }

    /// Normalised depth `1 - I` of every bin for an evolving star: profile k sees the brightness map in column k
    /// (pixels, profiles).
    pub fn depths_of_each(&self, brightness: DMatrixView<f64>, depths: &mut [f64]) {
        vector::run(OfEach { response: self, brightness, depths });
    }
}

/// Size of the velocity grid for a response: grid steps per bin, and nodes; the star has the surface of the state, with
/// the overrides of the set. Refuse more than [`MOST_STEPS_PER_BIN`] or [`MOST_NODES`] before a response is made.
pub fn velocity_grid(star: &StarSettings, state: &StarState, step_kms: f64) -> (f64, f64) {
    let steps = LineKernel::steps_per_bin(narrowest(star), step_kms) as f64;
    (steps, Deposit::nodes_at(state, star.limb_darkening, step_kms / steps))
}

/// The deposits that a response may need: plain, and weighted by `1 - mu`.
pub(super) const DEPOSITS: [bool; 2] = [false, true];

/// Whether a star needs one of them.
pub(super) fn needs(star: &StarSettings, limb_alone: bool) -> bool {
    !limb_alone || star.regions.know_the_limb()
}

/// A star with the surface of the state, and its observations.
pub(super) fn observed<'a>(
    grid: &'a SurfaceGrid,
    star: &StarSettings,
    state: &'a StarState,
    seen: &Seen,
    limb_alone: bool,
) -> Observed<'a> {
    let sampling = &seen.sampling;
    let epoch_d = |k: usize| seen.own_maps.get(k).map_or(star.epoch_d, |own| own.epoch_d);
    let since_epoch_d = sampling.profiles.iter().enumerate().map(|(k, p)| p.0 - epoch_d(k));
    let looks = Looks::new(since_epoch_d, &seen.exposures);
    let step_kms = sampling.step_kms / LineKernel::steps_per_bin(narrowest(star), sampling.step_kms) as f64;
    Observed { grid, state, limb: star.limb_darkening, limb_alone, looks, step_kms }
}

/// One profile after another, in one direction: the rows of the grid keep the state of that direction.
struct Pass<'a, N> {
    response: &'a Part,
    /// Of the photosphere's line, and of that of regions.
    nodes: [Vec<f64>; 2],
    /// Plain, and weighted by `1 - mu`.
    deposited: [Vec<f64>; 2],
    /// Contributions of cells to their nodes, or from them.
    of_cells: Vec<N>,
    rows: [Rows; 2],
}

impl<'a, N: Number> Pass<'a, N> {
    fn new(response: &'a Part) -> Self {
        let nodes = || vec![0.0; response.deposit.nodes];
        let (nodes, deposited) = ([nodes(), nodes()], [nodes(), nodes()]);
        Pass { response, nodes, deposited, of_cells: Vec::new(), rows: response.rows() }
    }

    /// Line depth of every bin of profile `k` (overwritten) for the map `x`, computed like spots; returns its
    /// continuum.
    #[inline(always)]
    fn forward<I: Instructions>(&mut self, i: I, k: usize, x: &[N], line: &mut [f64]) -> f64 {
        let Pass { response, nodes: [nodes, of_regions], deposited, of_cells, rows } = self;
        let Part { deposit, convolutions, regions, .. } = response;
        let Some(RegionPart { limb, convolutions: region_convolutions, mixture, .. }) = regions else {
            deposit.gather(i, k, x, of_cells, nodes);
            rows[0].interleave(nodes);
            convolutions.sum_to_bins(i, k, &rows[0], line);
            return total(nodes);
        };
        deposit.gather(i, k, x, of_cells, &mut deposited[0]);
        if let Some(limb) = limb {
            limb.gather(i, k, x, of_cells, &mut deposited[1]);
        }
        let sums = [(&mut *nodes, mixture.own), (&mut *of_regions, mixture.region)];
        for (nodes, [factor, limb_factor]) in sums {
            let [all, limb] = [&deposited[0][..nodes.len()], &deposited[1][..nodes.len()]];
            for (n, node) in nodes.iter_mut().enumerate() {
                *node = factor * all[n] + limb_factor * limb[n];
            }
        }
        rows[0].interleave(nodes);
        convolutions.sum_to_bins(i, k, &rows[0], line);
        let mut of_line = vec![0.0; line.len()];
        rows[1].interleave(of_regions);
        region_convolutions.sum_to_bins(i, k, &rows[1], &mut of_line);
        line.iter_mut().zip(of_line).for_each(|(line, of_regions)| *line += of_regions);
        total(nodes) + total(of_regions)
    }

    /// Transpose of [`Pass::forward`]: adds to the map `out`.
    #[inline(always)]
    fn back<I: Instructions>(&mut self, i: I, k: usize, line: &[f64], continuum: f64, out: &mut [N]) {
        let Pass { response, nodes: [nodes, of_regions], of_cells, rows, .. } = self;
        let Part { deposit, convolutions, regions, .. } = response;
        convolutions.spread_bins(i, k, line, &mut rows[0]);
        rows[0].deinterleave(nodes);
        of_cells.resize(nodes.len(), N::default());
        let Some(RegionPart { limb, convolutions: region_convolutions, mixture, .. }) = regions else {
            of_cells.iter_mut().zip(&*nodes).for_each(|(of_cell, node)| *of_cell = N::of(node + continuum));
            deposit.scatter(i, k, of_cells, out);
            return;
        };
        region_convolutions.spread_bins(i, k, line, &mut rows[1]);
        rows[1].deinterleave(of_regions);
        for (which, deposit) in [Some(deposit), limb.as_ref()].into_iter().enumerate() {
            let Some(deposit) = deposit else { continue };
            let (own, region) = (mixture.own[which], mixture.region[which]);
            let (nodes, of_regions) = (&nodes[..of_cells.len()], &of_regions[..of_cells.len()]);
            for (n, of_cell) in of_cells.iter_mut().enumerate() {
                *of_cell = N::of(own * (nodes[n] + continuum) + region * (of_regions[n] + continuum));
            }
            deposit.scatter(i, k, of_cells, out);
        }
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
            let continuum = response.beyond(k, depths, continuum);
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

/// The sum of all, in independent parts.
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
    use crate::star::{LimbDarkening, LocalLine, Orbit, Quadrature, Regions, Rotation, Sampling};

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
            regions: Regions::PLAIN,
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
        // built and shifted with this processor's instructions: both have the same pairs
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

        // forward and back, combined and in sequence, in double and in single precision
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
