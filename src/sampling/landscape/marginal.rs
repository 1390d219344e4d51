//! The posterior of one parameter from a likelihood grid: exp(ln L) times the prior, marginalised over the other axes.
//!
//! Over the others: the trapezoidal rule, and in cells where the prior is cut off L linear between nodes, times the
//! exact prior. Along the axis: ln L is a cubic between nodes, exact for a Gaussian whatever the spacing. A periodic
//! axis is cut opposite its highest node. A node without a value has likelihood 0.

use super::{Axis, Landscape};
use crate::numerics::logarithms::ln_sum;

/// Integration steps per cell.
const STEPS: usize = 64;

/// The distribution of one parameter along its axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Marginal {
    /// Where it begins; a periodic parameter may be outside [0, 1).
    first: f64,
    /// Distance between nodes.
    spacing: f64,
    /// Probability up to the end of each step, from 0 to 1.
    cumulative: Vec<f64>,
    periodic: bool,
}

impl Marginal {
    /// The distribution of the parameter on axis number `target`; `prior` is the density of the one on axis `i` at `x`.
    /// `None` where it is nowhere above zero.
    pub fn of(landscape: &Landscape, target: usize, prior: &dyn Fn(usize, f64) -> f64) -> Option<Self> {
        let axis = landscape.grid().axes.get(target)?;
        let mut log_likelihood = integrated(landscape, target, prior);
        let highest = (0..axis.nodes).reduce(|a, b| if log_likelihood[b] > log_likelihood[a] { b } else { a })?;
        let largest = log_likelihood[highest];
        log_likelihood.iter_mut().for_each(|value| *value -= largest);
        let begin = if axis.is_circle() { highest + axis.nodes / 2 } else { 0 };
        let first = axis.min + begin as f64 * axis.spacing();
        let along = Along { log_likelihood: &log_likelihood, begin, circle: axis.is_circle() };
        let mut cumulative = vec![0.0];
        let mut sum = 0.0;
        for step in 0..along.cells() * STEPS {
            let place = (step as f64 + 0.5) / STEPS as f64;
            let x = first + place * axis.spacing();
            sum += along.log_likelihood(place).exp() * prior(target, wrapped(axis, x));
            cumulative.push(sum);
        }
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        cumulative.iter_mut().for_each(|c| *c /= sum);
        Some(Marginal { first, spacing: axis.spacing(), cumulative, periodic: axis.periodic })
    }

    /// The quantile of `p`; a periodic parameter may be outside [0, 1).
    pub fn quantile(&self, p: f64) -> f64 {
        let after = self.cumulative.partition_point(|c| *c < p).clamp(1, self.cumulative.len() - 1);
        let (low, high) = (self.cumulative[after - 1], self.cumulative[after]);
        let within = if high > low { (p - low) / (high - low) } else { 0.5 };
        self.first + (after as f64 - 1.0 + within) * self.step()
    }

    /// Probability up to `x`.
    pub fn cumulative(&self, x: f64) -> f64 {
        let place = ((x - self.first) / self.step()).clamp(0.0, (self.cumulative.len() - 1) as f64);
        let before = (place as usize).min(self.cumulative.len() - 2);
        let (low, high) = (self.cumulative[before], self.cumulative[before + 1]);
        low + (place - before as f64) * (high - low)
    }

    /// The nodes from one end to the other.
    pub fn nodes(&self) -> Vec<f64> {
        (0..=(self.cumulative.len() - 1) / STEPS).map(|k| self.first + k as f64 * self.spacing).collect()
    }

    /// `x` on this axis, a periodic one in the matching cycle; `None` outside.
    pub fn place(&self, x: f64) -> Option<f64> {
        let length = (self.cumulative.len() - 1) as f64 * self.step();
        let from_first = if self.periodic { (x - self.first).rem_euclid(1.0) } else { x - self.first };
        // both ends belong to it, whatever the rounding
        let rounding = 1e-9 * self.spacing;
        let from_first = if self.periodic && 1.0 - from_first < rounding { 0.0 } else { from_first };
        (-rounding..=length + rounding).contains(&from_first).then_some(self.first + from_first)
    }

    fn step(&self) -> f64 {
        self.spacing / STEPS as f64
    }
}

/// ln of L at each value of axis `target`, marginalised over the other axes under their priors.
fn integrated(landscape: &Landscape, target: usize, prior: &dyn Fn(usize, f64) -> f64) -> Vec<f64> {
    let grid = landscape.grid();
    let weights_of = |(i, axis)| if i == target { Vec::new() } else { weights(axis, &|x| prior(i, x)) };
    let weights: Vec<Vec<f64>> = grid.axes.iter().enumerate().map(weights_of).collect();
    let mut log_terms: Vec<Vec<f64>> = vec![Vec::new(); grid.axes[target].nodes];
    for node in landscape.valued() {
        let position = grid.position(node.index);
        let others = position.iter().enumerate().filter(|(i, _)| *i != target);
        let weight: f64 = others.map(|(i, k)| weights[i][*k].ln()).sum();
        log_terms[position[target]].push(node.evaluation.log_prob + weight);
    }
    log_terms.iter().map(|terms| ln_sum(terms)).collect()
}

/// Weight of each node of an axis in the integral over it: by the trapezoidal rule, or with L linear between nodes
/// where the prior is cut off next to it.
fn weights(axis: &Axis, prior: &dyn Fn(f64) -> f64) -> Vec<f64> {
    let density = |place: f64| prior(wrapped(axis, axis.min + place * axis.spacing()));
    let midpoints = (0..STEPS).map(|step| (step as f64 + 0.5) / STEPS as f64);
    let weight = |node: usize| {
        let (before, after) = (axis.is_circle() || node > 0, axis.is_circle() || node + 1 < axis.nodes);
        let sides = [before.then_some(-1.0), after.then_some(1.0)].into_iter().flatten();
        let around = sides.flat_map(|side| midpoints.clone().map(move |t| (1.0 - t, node as f64 + side * t)));
        let terms: Vec<(f64, f64)> = around.map(|(linear, place)| (linear / STEPS as f64, density(place))).collect();
        match terms.iter().all(|(_, density)| *density > 0.0) {
            true => density(node as f64) * terms.iter().map(|(linear, _)| linear).sum::<f64>(),
            false => terms.iter().map(|(linear, density)| linear * density).sum(),
        }
    };
    (0..axis.nodes).map(weight).collect()
}

fn wrapped(axis: &Axis, x: f64) -> f64 {
    if axis.periodic { x.rem_euclid(1.0) } else { x }
}

/// ln L along an axis, between its nodes.
struct Along<'a> {
    log_likelihood: &'a [f64],
    /// Index of the first node.
    begin: usize,
    circle: bool,
}

impl Along<'_> {
    fn cells(&self) -> usize {
        if self.circle { self.log_likelihood.len() } else { self.log_likelihood.len() - 1 }
    }

    /// At `place`, in nodes from the first: the polynomial through the four nodes around it, or fewer if the axis is
    /// shorter.
    fn log_likelihood(&self, place: f64) -> f64 {
        let count = self.log_likelihood.len();
        let cell = place.floor() as isize;
        let stencil = if self.circle {
            cell - 1..cell + 3
        } else {
            let width = count.min(4) as isize;
            let first = (cell - 1).clamp(0, count as isize - width);
            first..first + width
        };
        let value = |k: isize| self.log_likelihood[(self.begin as isize + k).rem_euclid(count as isize) as usize];
        if stencil.clone().any(|k| value(k) == f64::NEG_INFINITY) {
            let t = place - cell as f64;
            return ((1.0 - t) * value(cell).exp() + t * value(cell + 1).exp()).ln();
        }
        let lagrange = |k: isize| -> f64 {
            let others = stencil.clone().filter(|other| *other != k);
            others.map(|other| (place - other as f64) / (k - other) as f64).product()
        };
        stencil.clone().map(|k| value(k) * lagrange(k)).sum()
    }
}
