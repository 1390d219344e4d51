//! Differential evolution: along the difference of two walkers of the other half.
//!
//! Source: ter Braak 2006, equation 2: `Y = X + gamma (X_j - X_k) + e`, `gamma = 2.38 / sqrt(2 d)`, and occasionally
//! gamma = 1, which allows jumps between modes. Symmetric, so the factor is 1. Here gamma carries a small jitter, and
//! the noise `e` follows the spread of the other half in each coordinate: with it, the move reaches every position even
//! when the half has no more walkers than dimensions.

use crate::sampling::chain::MoveKind;
use crate::sampling::ensemble::moves::{Move, Proposal};
use rand::{Rng, RngCore};
use rand_distr::StandardNormal;

/// The differential-evolution move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferentialEvolution {
    /// Relative standard deviation of gamma.
    pub jitter: f64,
    /// Fraction of proposals with gamma = 1.
    pub hop: f64,
    /// Standard deviation of the noise over that of the other half.
    pub noise: f64,
}

impl Default for DifferentialEvolution {
    fn default() -> Self {
        DifferentialEvolution { jitter: 0.05, hop: 0.1, noise: 1e-3 }
    }
}

impl Move for DifferentialEvolution {
    fn propose(&self, current: &[f64], complement: &[Vec<f64>], rng: &mut dyn RngCore) -> Proposal {
        let first = rng.random_range(0..complement.len());
        let other = rng.random_range(0..complement.len() - 1);
        let second = if other < first { other } else { other + 1 };
        let hops = rng.random::<f64>() < self.hop;
        let jitter = 1.0 + self.jitter * rng.sample::<f64, _>(StandardNormal);
        let gamma = if hops { 1.0 } else { jitter * 2.38 / (2.0 * current.len() as f64).sqrt() };
        let position = (0..current.len())
            .map(|i| {
                let noise = self.noise * spread(complement, i) * rng.sample::<f64, _>(StandardNormal);
                current[i] + gamma * (complement[first][i] - complement[second][i]) + noise
            })
            .collect();
        Proposal { position, log_factor: 0.0, by: MoveKind::DifferentialEvolution, translation: true }
    }
}

/// Standard deviation of coordinate `i` over the walkers.
fn spread(walkers: &[Vec<f64>], i: usize) -> f64 {
    let count = walkers.len() as f64;
    let mean = walkers.iter().map(|x| x[i]).sum::<f64>() / count;
    (walkers.iter().map(|x| (x[i] - mean).powi(2)).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::ensemble::moves::{Mix, harness};

    #[test]
    fn recovers_its_targets() {
        harness::check(|| Mix::default().with(1.0, Box::new(DifferentialEvolution::default()))).unwrap();
    }
}
