//! The surrogate corrected towards the sampled posterior: a quadratic in the linear coordinates, fitted to the
//! differences at a few hundred reconstructions.
//!
//! The expansion is that of the regularised likelihood. Spottedness, which is no extremum over maps, falls faster in
//! the stellar parameters (by a fifth of their uncertainties on the setup of Petit et al.).

use super::Surrogate;
use super::conditional::Correction;
use crate::sampling::log_density::{Evaluator, LogDensity};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Reconstructions per coefficient.
const POINTS: usize = 8;

/// Temperature of the draws: slightly wider than the region in which the fit is used.
const TEMPERATURE: f64 = 1.5;

/// Points this much below the highest in ln P do not count: the quadratic may be wrong there.
const REACH: f64 = 20.0;

/// Fewest points with a log-probability per coefficient.
const ENOUGH: f64 = 3.0;

/// A sufficient fraction of accepted proposals.
const GOOD: f64 = 0.6;

/// Draws for testing the surrogate.
const TRIALS: usize = 64;

/// A draw: internal and physical coordinates, and log-probability.
pub(super) type Drawn = (Vec<f64>, Vec<f64>, f64);

impl Surrogate {
    /// The surrogate fitted to `density`, if that improves it, and the fraction of its proposals that are accepted.
    pub fn fitted(self, density: &dyn LogDensity, evaluator: &dyn Evaluator) -> (Self, f64) {
        let acceptance = self.acceptance(density, evaluator);
        self.fitted_beyond(acceptance, density, evaluator)
    }

    /// The same if few of its proposals are accepted; otherwise the fit does not justify its evaluations.
    pub fn fitted_if_poor(self, density: &dyn LogDensity, evaluator: &dyn Evaluator) -> (Self, f64) {
        match self.acceptance(density, evaluator) {
            good if good > GOOD => (self, good),
            poor => self.fitted_beyond(poor, density, evaluator),
        }
    }

    fn fitted_beyond(self, acceptance: f64, density: &dyn LogDensity, evaluator: &dyn Evaluator) -> (Self, f64) {
        let own = (acceptance, self);
        let fitted = own.1.corrected(density, evaluator).map(|fitted| (fitted.acceptance(density, evaluator), fitted));
        let (acceptance, best) = fitted.filter(|fitted| fitted.0 > own.0).unwrap_or(own);
        (best, acceptance)
    }

    /// The surrogate with the differences to `density`, by least squares over draws of the surrogate itself, which
    /// depend only on it. `None` where too few draws have a log-probability, or no maximum is left.
    fn corrected(&self, density: &dyn LogDensity, evaluator: &dyn Evaluator) -> Option<Self> {
        let count = self.model.linear_count();
        let terms = 1 + count + count * (count + 1) / 2;
        let draws = self.tempered(TEMPERATURE)?.evaluated(POINTS * terms, density, evaluator);
        let highest = draws.iter().map(|draw| draw.2).fold(f64::NEG_INFINITY, f64::max);
        let points: Vec<(DVector<f64>, f64)> = draws
            .iter()
            .filter(|(.., log_prob)| *log_prob > highest - REACH)
            .filter_map(|(position, theta, log_prob)| {
                let (given, linear) = self.model.split(position);
                let model = self.model.at(&given, 1.0)?.log_likelihood(&linear);
                let beyond = log_prob - self.space.log_prior(theta) - model;
                beyond.is_finite().then_some((linear, beyond))
            })
            .collect();
        if (points.len() as f64) < ENOUGH * terms as f64 {
            return None;
        }
        let model = self.model.clone().with_correction(fit(&points, count)?);
        Surrogate::of(model, self.space.clone(), self.time_base_cycles, self.temperature)
    }

    fn acceptance(&self, density: &dyn LogDensity, evaluator: &dyn Evaluator) -> f64 {
        self.acceptance_of(&self.evaluated(TRIALS, density, evaluator), density)
    }

    /// Fraction of the surrogate's proposals that `density` accepts from the region of a chain: of its draws, each with
    /// the weight of `density` over the surrogate there. Without the weights the few draws where the surrogate is far
    /// too low, and a chain stays for long, would hardly count.
    pub(super) fn acceptance_of(&self, draws: &[Drawn], density: &dyn LogDensity) -> f64 {
        let beyond: Vec<f64> = draws
            .iter()
            .map(|(position, theta, log_prob)| log_prob + density.log_jacobian(theta) - self.log_density(position))
            .collect();
        // a walk that never moves proposes nothing new
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let moves =
            |position: &Vec<f64>| self.place(position).is_some_and(|at| self.walk(at, &mut rng).position != *position);
        let moved =
            draws.iter().map(|draw| &draw.0).map(moves).filter(|moved| *moved).count() as f64 / draws.len() as f64;
        // points without a log-probability are never accepted, and neither are those that cannot be drawn
        let highest = beyond.iter().copied().filter(|beyond| beyond.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> =
            beyond.iter().map(|beyond| if beyond.is_finite() { (beyond - highest).exp() } else { 0.0 }).collect();
        // from x to y: w_x min(1, w_y / w_x)
        let pairs = weights.iter().flat_map(|from| weights.iter().map(move |to| from.min(*to)));
        let total = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        moved * pairs.sum::<f64>() / (total * draws.len() as f64)
    }

    /// So many draws.
    fn evaluated(&self, draws: usize, density: &dyn LogDensity, evaluator: &dyn Evaluator) -> Vec<Drawn> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let positions: Vec<Vec<f64>> = (0..draws).filter_map(|_| self.draw(&mut rng)).collect();
        let thetas: Vec<Vec<f64>> = positions.iter().map(|x| density.to_physical(x)).collect();
        let evaluations = evaluator.evaluate(&thetas);
        let all = positions.into_iter().zip(thetas).zip(evaluations);
        all.map(|((position, theta), evaluation)| (position, theta, evaluation.log_prob)).collect()
    }
}

/// The quadratic that fits the points best.
fn fit(points: &[(DVector<f64>, f64)], count: usize) -> Option<Correction> {
    let n = points.len() as f64;
    let centre = points.iter().fold(DVector::zeros(count), |sum, (y, _)| sum + y) / n;
    let scale = points
        .iter()
        .fold(DVector::zeros(count), |sum: DVector<f64>, (y, _)| sum + (y - &centre).component_mul(&(y - &centre)));
    let scale = (scale / n).map(f64::sqrt);
    let pairs: Vec<(usize, usize)> = (0..count).flat_map(|i| (0..=i).map(move |j| (i, j))).collect();
    let row = |y: &DVector<f64>| -> Vec<f64> {
        let z = (y - &centre).component_div(&scale);
        let squares = pairs.iter().map(|&(i, j)| z[i] * z[j]);
        std::iter::once(1.0).chain(z.iter().copied()).chain(squares).collect()
    };
    let rows: Vec<f64> = points.iter().flat_map(|(y, _)| row(y)).collect();
    let design = DMatrix::from_row_slice(points.len(), 1 + count + pairs.len(), &rows);
    let values = DVector::from_iterator(points.len(), points.iter().map(|p| p.1));
    let normal = design.tr_mul(&design).cholesky()?;
    let coefficients = normal.solve(&design.tr_mul(&values));
    if !coefficients.iter().all(|c| c.is_finite()) {
        return None;
    }
    let mut information = DMatrix::zeros(count, count);
    for (&(i, j), c) in pairs.iter().zip(coefficients.iter().skip(1 + count)) {
        let curvature = -c / (scale[i] * scale[j]);
        information[(i, j)] += curvature;
        information[(j, i)] += curvature;
    }
    let gradient = coefficients.rows(1, count).component_div(&scale);
    Some(Correction { centre, constant: coefficients[0], gradient, information })
}
