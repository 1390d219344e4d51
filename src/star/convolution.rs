//! From the velocity grid to the bins of one observed profile: convolution with the local line, and its transpose.
//!
//! A bin is a whole number m of grid steps wide, so that one short table of the line serves all bins of a profile; the orbit
//! and the systemic velocity only shift that table. The grid is kept as m interleaved rows, which makes both directions
//! plain vector updates. Left out: pixels.

use super::deposit::multiply_add;
use super::line_profile::LineKernel;

/// The local line, sampled for one profile.
#[derive(Clone, Debug)]
pub struct ProfileConvolution {
    /// Grid steps a bin.
    steps_per_bin: usize,
    /// Grid index, relative to the first bin's, of the table's first entry.
    first: isize,
    table: Vec<f64>,
}

impl ProfileConvolution {
    /// For a profile whose first bin lies `first_bin_kms` above the grid's first node, in the star's frame.
    pub fn new(kernel: &LineKernel, grid_step: f64, steps_per_bin: usize, first_bin_kms: f64) -> Self {
        let position = first_bin_kms / grid_step;
        let reach = kernel.reach_kms() / grid_step;
        let first = (position - reach).ceil();
        let count = ((position + reach).floor() - first) as usize + 1;
        let table = (0..count).map(|i| kernel.at((position - first - i as f64) * grid_step)).collect();
        ProfileConvolution { steps_per_bin, first: first as isize, table }
    }

    /// Calls `f(line, row, column, bins)` for every entry of the table: bins `bins` see it at `row[column..]`.
    #[inline(always)]
    fn each_entry(&self, columns: usize, bins: usize, mut f: impl FnMut(f64, usize, usize, std::ops::Range<usize>)) {
        let m = self.steps_per_bin as isize;
        for (i, &line) in self.table.iter().enumerate() {
            let index = self.first + i as isize;
            let (row, column) = (index.rem_euclid(m) as usize, index.div_euclid(m));
            let from = (-column).max(0);
            let to = (columns as isize - column).min(bins as isize);
            if from < to {
                f(line, row, (from + column) as usize, from as usize..to as usize);
            }
        }
    }

    /// Line depth in every bin (overwritten) from the rows of the grid.
    #[inline(always)]
    pub fn sum_to_bins<const FMA: bool>(&self, rows: &Rows, bins: &mut [f64]) {
        bins.fill(0.0);
        self.each_entry(rows.columns, bins.len(), |line, row, column, range| {
            let source = &rows.row(row)[column..column + range.len()];
            for (bin, x) in bins[range].iter_mut().zip(source) {
                *bin = multiply_add::<FMA>(line, *x, *bin);
            }
        });
    }

    /// Transpose of [`ProfileConvolution::sum_to_bins`]: sets the rows of the grid from the bins.
    #[inline(always)]
    pub fn spread_bins<const FMA: bool>(&self, bins: &[f64], rows: &mut Rows) {
        rows.values.fill(0.0);
        let columns = rows.columns;
        self.each_entry(columns, bins.len(), |line, row, column, range| {
            let target = &mut rows.row_mut(row)[column..column + range.len()];
            for (t, bin) in target.iter_mut().zip(&bins[range]) {
                *t = multiply_add::<FMA>(line, *bin, *t);
            }
        });
    }
}

/// The velocity grid as interleaved rows: node i is entry i / m of row i mod m.
#[derive(Clone, Debug)]
pub struct Rows {
    columns: usize,
    steps_per_bin: usize,
    values: Vec<f64>,
}

impl Rows {
    /// Rows for a grid of `nodes` nodes.
    pub fn new(nodes: usize, steps_per_bin: usize) -> Self {
        let columns = nodes.div_ceil(steps_per_bin);
        Rows { columns, steps_per_bin, values: vec![0.0; columns * steps_per_bin] }
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.columns..(row + 1) * self.columns]
    }

    fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.values[row * self.columns..(row + 1) * self.columns]
    }

    /// Takes over the grid's nodes.
    pub fn interleave(&mut self, nodes: &[f64]) {
        for row in 0..self.steps_per_bin {
            let m = self.steps_per_bin;
            for (value, node) in self.row_mut(row).iter_mut().zip(nodes.iter().skip(row).step_by(m)) {
                *value = *node;
            }
        }
    }

    /// Writes the grid's nodes.
    pub fn deinterleave(&self, nodes: &mut [f64]) {
        for row in 0..self.steps_per_bin {
            let targets = nodes.iter_mut().skip(row).step_by(self.steps_per_bin);
            for (value, node) in self.row(row).iter().zip(targets) {
                *node = *value;
            }
        }
    }
}
