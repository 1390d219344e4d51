//! From the velocity grid to the bins of each observed profile: convolution with the local line, and its transpose.
//!
//! A bin is a whole number m of grid steps wide: kept as m interleaved rows (node i is entry i / m of row i mod m), the
//! grid is turned into bins by one short filter per row. The orbit and the systemic velocity only shift the filters.

use super::correlate::{self, CHUNK, correlate};
use super::line_profile::LineKernel;
use crate::numerics::vector::Instructions;
use std::ops::Range;

/// The properties of the velocity grid for filters.
#[derive(Clone, Copy, Debug)]
pub struct VelocityGrid {
    /// Number of nodes.
    pub nodes: usize,
    /// Step (km/s).
    pub step_kms: f64,
    /// Grid steps in a bin.
    pub steps_per_bin: usize,
}

/// The local line, sampled for every profile: a filter for every row of the grid.
#[derive(Clone, Debug)]
pub struct Convolutions {
    grid: VelocityGrid,
    /// Of one profile after another.
    filters: Vec<Filter>,
    /// Taps of all filters one after another.
    taps: Vec<f64>,
    /// All of them in reverse order, for the transpose.
    reversed: Vec<f64>,
}

/// `bin[b] = sum_q taps[q] row[first + q + b]`.
#[derive(Clone, Debug)]
struct Filter {
    first: isize,
    /// The range of its taps.
    taps: Range<usize>,
}

impl Convolutions {
    /// For profiles given by the distance (km/s) of their first bin above the grid's first node, in the star's frame,
    /// and their numbers of bins.
    ///
    /// Taps that lie beyond the grid for every bin are left out of the filters.
    pub fn new(kernel: &LineKernel, grid: VelocityGrid, profiles: impl Iterator<Item = (f64, usize)>) -> Self {
        let VelocityGrid { nodes, step_kms, steps_per_bin } = grid;
        let reach = kernel.reach_kms() / step_kms;
        let (m, end) = (steps_per_bin as isize, nodes as isize);
        let (mut filters, mut taps, mut of_nodes) = (Vec::new(), Vec::new(), Vec::new());
        for (first_bin_kms, bins) in profiles {
            let position = first_bin_kms / step_kms;
            let first = ((position - reach).ceil() as isize).clamp(-m * bins as isize, end);
            let last = ((position + reach).floor() as isize).min(end - 1);
            of_nodes.resize((last - first + 1).max(0) as usize, 0.0);
            kernel.sample(position - first as f64, step_kms, &mut of_nodes);
            for row in 0..m {
                let (begin, column) = (taps.len(), (first - row + m - 1).div_euclid(m));
                let first_node = (row + m * column - first) as usize;
                taps.extend(of_nodes.iter().skip(first_node).step_by(steps_per_bin));
                filters.push(Filter { first: column, taps: begin..taps.len() });
            }
        }
        let reversed = taps.iter().rev().copied().collect();
        Convolutions { grid, filters, taps, reversed }
    }

    /// Filters of profile `k`.
    fn filters(&self, k: usize) -> &[Filter] {
        &self.filters[k * self.grid.steps_per_bin..][..self.grid.steps_per_bin]
    }

    /// A filter's taps in reverse order.
    fn reversed(&self, Filter { taps, .. }: &Filter) -> &[f64] {
        &self.reversed[self.taps.len() - taps.end..self.taps.len() - taps.start]
    }

    /// Rows for profiles of at most this many bins.
    pub fn rows(&self, bins: usize) -> Rows {
        let VelocityGrid { nodes, steps_per_bin, .. } = self.grid;
        // columns before the first, and those from the first on that filters reach
        let margin = self.filters.iter().map(|f| f.first.min(0).unsigned_abs()).max().unwrap_or(0);
        let after = self.filters.iter().map(|f| (f.first + f.taps.len() as isize).max(0) as usize).max().unwrap_or(0);
        let stride = margin + nodes.div_ceil(steps_per_bin).max(after + bins + CHUNK);
        Rows { margin, stride, steps_per_bin, values: vec![0.0; stride * steps_per_bin], padded: Vec::new() }
    }

    /// Line depth in every bin (overwritten) of profile `k` from the rows of the grid.
    #[inline(always)]
    pub fn sum_to_bins(&self, i: impl Instructions, k: usize, rows: &Rows, bins: &mut [f64]) {
        let filters = self.filters(k);
        for (n, chunk) in bins.chunks_mut(CHUNK).enumerate() {
            let mut sums = [0.0; CHUNK];
            for (row, filter) in filters.iter().enumerate() {
                let first = (filter.first + rows.margin as isize) as usize + n * CHUNK;
                correlate(i, &self.taps[filter.taps.clone()], &rows.row(row)[first..], &mut sums);
            }
            correlate::put(&sums, chunk);
        }
    }

    /// Transpose of [`Convolutions::sum_to_bins`]: sets the rows of the grid from the bins.
    #[inline(always)]
    pub fn spread_bins(&self, i: impl Instructions, k: usize, bins: &[f64], rows: &mut Rows) {
        rows.values.fill(0.0);
        for (row, filter) in self.filters(k).iter().enumerate() {
            let Some(margin) = filter.taps.len().checked_sub(1) else { continue };
            // bins with as many zeros on either side as the filter reaches
            rows.padded.clear();
            rows.padded.resize(margin, 0.0);
            rows.padded.extend_from_slice(bins);
            rows.padded.resize(bins.len() + 2 * margin + CHUNK, 0.0);
            let first = (filter.first + rows.margin as isize) as usize;
            let targets = &mut rows.values[row * rows.stride + first..][..bins.len() + margin];
            for (n, chunk) in targets.chunks_mut(CHUNK).enumerate() {
                let mut sums = [0.0; CHUNK];
                correlate(i, self.reversed(filter), &rows.padded[n * CHUNK..], &mut sums);
                correlate::put(&sums, chunk);
            }
        }
    }
}

/// The velocity grid as interleaved rows, with room on either side for filters that reach beyond it.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Columns before the grid's first node.
    margin: usize,
    /// Columns of a row.
    stride: usize,
    steps_per_bin: usize,
    values: Vec<f64>,
    padded: Vec<f64>,
}

impl Rows {
    fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.stride..(row + 1) * self.stride]
    }

    /// Takes over the grid's nodes.
    #[inline(always)]
    pub fn interleave(&mut self, nodes: &[f64]) {
        for (row, values) in self.values.chunks_exact_mut(self.stride).enumerate() {
            let mut nodes = nodes[row.min(nodes.len())..].iter().step_by(self.steps_per_bin);
            for value in &mut values[self.margin..] {
                let Some(node) = nodes.next() else { break };
                *value = *node;
            }
        }
    }

    /// Writes the grid's nodes.
    #[inline(always)]
    pub fn deinterleave(&self, nodes: &mut [f64]) {
        for row in 0..self.steps_per_bin.min(nodes.len()) {
            let mut targets = nodes[row..].iter_mut().step_by(self.steps_per_bin);
            for value in &self.row(row)[self.margin..] {
                let Some(node) = targets.next() else { break };
                *node = *value;
            }
        }
    }
}
