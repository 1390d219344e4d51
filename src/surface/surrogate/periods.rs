//! The surrogate's distribution of the period: a table, uniform in frequency within a cell.

use super::TAIL;
use super::conditional::Conditional;
use crate::model::Prior;
use rand::{Rng, RngCore};

/// Cells over the inverse of the time base: a peak is some fraction of it wide.
const OVERSAMPLING: f64 = 60.0;

/// Most cells.
const MOST_CELLS: usize = 40_000;

/// If the prior includes period 0, the table ends at this fraction of the longest.
const SHORTEST: f64 = 0.01;

/// Fraction of the draws that is uniform over all periods.
const EVEN: f64 = 0.02;

/// Probabilities of cells between two frequencies (1 / Porb/Prot).
#[derive(Clone, Debug)]
pub(super) struct PeriodTable {
    lowest: f64,
    width: f64,
    /// Probability of each cell, and the cumulative one.
    probability: Vec<f64>,
    cumulative: Vec<f64>,
    /// Highest ln L at the middle of each cell.
    heights: Vec<f64>,
    fixed: Option<f64>,
}

/// Scale of a table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Number of parameters.
    pub dimension: usize,
    /// Length of the data.
    pub time_base_cycles: f64,
    /// Divisor of differences of ln L.
    pub temperature: f64,
}

impl PeriodTable {
    /// Over the prior of a period, or its fixed value; with the highest ln L of all. `at` is the quadratic at a period,
    /// in which the planet's columns begin at `first`. `None` where the quadratic has no maximum.
    pub fn new(
        at: &dyn Fn(f64, f64) -> Option<Conditional>,
        first: usize,
        prior: Result<Prior, f64>,
        scale: Scale,
    ) -> Option<(Self, f64)> {
        let Scale { dimension, time_base_cycles, temperature } = scale;
        let prior = match prior {
            Ok(prior) => prior,
            Err(period) => {
                let conditional = at(period, 1.0)?;
                let best = conditional.log_likelihood(&conditional.mode());
                let table = PeriodTable {
                    lowest: 1.0 / period,
                    width: 0.0,
                    probability: vec![1.0],
                    cumulative: vec![1.0],
                    heights: vec![best],
                    fixed: Some(period),
                };
                return Some((table, best));
            }
        };
        let (mean, sd) = prior.mean_and_sd();
        let (least, most) = prior.bounds();
        // an unbounded prior is truncated where it becomes negligible, and periods are positive
        let least = if least.is_finite() { least } else { mean - 8.0 * sd };
        let most = if most.is_finite() { most } else { mean + 8.0 * sd };
        let least = if least > 0.0 { least } else { SHORTEST * most };
        let (lowest, highest) = (1.0 / most, 1.0 / least);
        let cells = (OVERSAMPLING * time_base_cycles.max(1.0) * (highest - lowest)).ceil() as usize;
        let cells = cells.clamp(50, MOST_CELLS);
        let width = (highest - lowest) / cells as f64;
        let period = |i: usize| 1.0 / (lowest + (i as f64 + 0.5) * width);
        let cell = |i: usize| {
            let conditional = at(period(i), temperature)?;
            // the density 1/K of K cos and K sin, smoothed where K is no larger than its uncertainty
            let k = conditional.amplitude(first);
            let volume = -0.5 * conditional.log_determinant() - k.ln();
            let prior = prior.log_density(period(i)) + 2.0 * period(i).ln();
            Some((conditional.log_likelihood(&conditional.mode()), volume + prior))
        };
        let cells: Vec<(f64, f64)> = (0..cells).map(cell).collect::<Option<_>>()?;
        let best = cells.iter().map(|c| c.0).fold(f64::NEG_INFINITY, f64::max);
        let degrees = TAIL + dimension as f64;
        let log_weight = |(height, volume): &(f64, f64)| {
            let below = (best - height) / temperature;
            volume - 0.5 * degrees * (2.0 * below / TAIL).ln_1p()
        };
        let weights: Vec<f64> = cells.iter().map(log_weight).collect();
        let heaviest = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = weights.iter().map(|w| (w - heaviest).exp()).sum();
        let even = EVEN / weights.len() as f64;
        let probability: Vec<f64> =
            weights.iter().map(|w| (1.0 - EVEN) * (w - heaviest).exp() / total + even).collect();
        let mut sum = 0.0;
        let cumulative = probability.iter().map(|p| {
            sum += p;
            sum
        });
        let cumulative = cumulative.collect();
        let heights = cells.into_iter().map(|c| c.0).collect();
        Some((PeriodTable { lowest, width, probability, cumulative, heights, fixed: None }, best))
    }

    /// A period, and ln of its density with respect to the period.
    pub fn draw(&self, rng: &mut dyn RngCore) -> (f64, f64) {
        if let Some(period) = self.fixed {
            return (period, 0.0);
        }
        let target = rng.random::<f64>() * self.cumulative[self.cumulative.len() - 1];
        let cell = self.cumulative.partition_point(|&c| c <= target).min(self.probability.len() - 1);
        let period = 1.0 / (self.lowest + (cell as f64 + rng.random::<f64>()) * self.width);
        (period, self.log_cell(cell, period))
    }

    /// ln of the density with which `period` is drawn.
    pub fn log_density(&self, period: f64) -> f64 {
        if self.fixed.is_some() {
            return 0.0;
        }
        let cell = ((1.0 / period - self.lowest) / self.width).floor();
        if cell >= 0.0 && cell < self.probability.len() as f64 {
            self.log_cell(cell as usize, period)
        } else {
            f64::NEG_INFINITY
        }
    }

    fn log_cell(&self, cell: usize, period: f64) -> f64 {
        (self.probability[cell] / self.width).ln() - 2.0 * period.ln()
    }

    /// The period of the highest ln L, and its value.
    pub fn highest(&self) -> (f64, f64) {
        self.peaks()[0]
    }

    /// Periods at which ln L is higher than in both neighbouring cells, with its value there, highest first.
    pub fn peaks(&self) -> Vec<(f64, f64)> {
        let h = &self.heights;
        if let Some(period) = self.fixed {
            return vec![(period, h[0])];
        }
        let is_peak = |&i: &usize| (i == 0 || h[i] > h[i - 1]) && (i + 1 == h.len() || h[i] >= h[i + 1]);
        let mut peaks: Vec<(f64, f64)> =
            (0..h.len()).filter(is_peak).map(|i| (1.0 / (self.lowest + (i as f64 + 0.5) * self.width), h[i])).collect();
        peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
        peaks
    }
}
