//! Moves: proposals for a walker, given the walkers of the other half. One file per move.
//!
//! Moves see sampling coordinates only. A new move is one file, one field of [`MoveWeights`] and one line of
//! [`MoveWeights::mix`]; a move that needs its own data is added with [`Mix::with`]. The tests of every move call
//! `harness::check`.

mod differential_evolution;
#[cfg(test)]
pub(crate) mod harness;
mod stretch;

pub use differential_evolution::DifferentialEvolution;
pub use stretch::Stretch;

use crate::sampling::chain::MoveKind;
use crate::sampling::ensemble::EnsembleError;
use rand::{Rng, RngCore};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The new position, in sampling coordinates.
    pub position: Vec<f64>,
    /// ln of the Hastings factor: ln q(current | proposed) - ln q(proposed | current), with any Jacobian of the move.
    pub log_factor: f64,
    /// The move that made it.
    pub by: MoveKind,
    /// Whether the move added a vector that does not depend on `current` and whose opposite was equally probable. Only
    /// such a move is still reversible after a periodic coordinate was wrapped; of any other, the sampler refuses
    /// proposals beyond the wrap.
    pub translation: bool,
}

/// A way of proposing a new position.
pub trait Move: Send + Sync {
    /// Proposes a position for a walker at `current`, given the positions `complement` of the other half of its
    /// ensemble (at least two), all in sampling coordinates. May draw up to 2^15 words of random numbers.
    fn propose(&self, current: &[f64], complement: &[Vec<f64>], rng: &mut dyn RngCore) -> Proposal;
}

/// Relative weights of the moves: at each step, a walker draws its move with these.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MoveWeights {
    /// Weight of the stretch move (Goodman & Weare 2010).
    pub stretch: f64,
    /// Weight of differential evolution (ter Braak 2006).
    pub differential_evolution: f64,
    /// Weight of the surrogate move (proposals from the quadratic posterior around the reference), times the square of
    /// the share of its proposals that are accepted on trial. 0 turns it off; there is none where K or phi is fixed.
    pub surrogate: f64,
}

impl Default for MoveWeights {
    fn default() -> Self {
        MoveWeights { stretch: 0.25, differential_evolution: 0.75, surrogate: 20.0 }
    }
}

impl MoveWeights {
    /// Checks that the weights are finite, not negative, and those of the affine-invariant moves not all zero: they
    /// find what the surrogate misses.
    ///
    /// # Errors
    /// [`EnsembleError::Setting`].
    pub fn validate(&self) -> Result<(), EnsembleError> {
        let refuse = |problem| Err(EnsembleError::Setting { key: "sampler.moves", problem });
        let MoveWeights { stretch, differential_evolution, surrogate } = *self;
        let weights = [stretch, differential_evolution, surrogate];
        if let Some(bad) = weights.iter().find(|weight| !(weight.is_finite() && **weight >= 0.0)) {
            return refuse(format!("a weight must be a finite number, 0 or above, not {bad}"));
        }
        if stretch + differential_evolution == 0.0 {
            return refuse("the weights of stretch and differential_evolution must not both be zero".to_owned());
        }
        if !weights.iter().sum::<f64>().is_finite() {
            return refuse("the sum of the weights must be finite".to_owned());
        }
        Ok(())
    }

    /// The moves that need only the walkers.
    pub fn mix(&self) -> Mix {
        Mix::default()
            .with(self.stretch, Box::new(Stretch::default()))
            .with(self.differential_evolution, Box::new(DifferentialEvolution::default()))
    }
}

/// Moves with weights: one of them, drawn at random, is used each time.
#[derive(Default)]
pub struct Mix {
    moves: Vec<(f64, Box<dyn Move>)>,
}

impl Mix {
    /// This mix with one more move; `weight` is relative to those already there.
    pub fn with(mut self, weight: f64, one: Box<dyn Move>) -> Self {
        self.moves.push((weight, one));
        self
    }
}

impl Move for Mix {
    fn propose(&self, current: &[f64], complement: &[Vec<f64>], rng: &mut dyn RngCore) -> Proposal {
        let total: f64 = self.moves.iter().map(|(weight, _)| weight).sum();
        let mut target = rng.random::<f64>() * total;
        let drawn = self.moves.iter().find(|(weight, _)| {
            target -= weight;
            target < 0.0
        });
        // Rounding can leave the target at the very end of the sum.
        let last = || self.moves.iter().rfind(|(weight, _)| *weight > 0.0);
        let (_, one) = drawn.or_else(last).expect("a mix holds a move of positive weight");
        one.propose(current, complement, rng)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_mix_recovers_its_targets() {
        harness::check(|| MoveWeights::default().mix()).unwrap();
    }

    #[test]
    fn the_harness_catches_a_wrong_move() {
        struct NoFactor;
        impl Move for NoFactor {
            fn propose(&self, current: &[f64], complement: &[Vec<f64>], rng: &mut dyn RngCore) -> Proposal {
                Proposal { log_factor: 0.0, ..Stretch::default().propose(current, complement, rng) }
            }
        }
        assert!(harness::check(|| Mix::default().with(1.0, Box::new(NoFactor))).is_err());
    }

    #[test]
    fn a_move_of_weight_zero_is_never_drawn() {
        struct Never;
        impl Move for Never {
            fn propose(&self, _: &[f64], _: &[Vec<f64>], _: &mut dyn RngCore) -> Proposal {
                panic!("drawn")
            }
        }
        let mix = MoveWeights::default().mix().with(0.0, Box::new(Never));
        let mut rng = <rand_chacha::ChaCha8Rng as rand::SeedableRng>::seed_from_u64(1);
        for _ in 0..1000 {
            mix.propose(&[0.0], &[vec![1.0], vec![2.0]], &mut rng);
        }
    }
}
