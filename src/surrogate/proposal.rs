//! The surrogate as a move of the ensemble: the end of a walk on it, accepted by what the exact posterior says.
//!
//! The walk is reversible with respect to the surrogate density q, so that the Hastings factor is `q(current) / q(proposed)`
//! whatever q is (Liu 2001, *Monte Carlo Strategies in Scientific Computing*, section 9.4.3: surrogate transition). Where q is
//! the posterior up to a constant, every proposal is accepted, and the next state does not depend on the last.

use super::Surrogate;
use crate::ensemble::{Move, Proposal};
use rand::RngCore;

/// The move.
#[derive(Clone, Debug)]
pub struct SurrogateMove(pub Surrogate);

impl Move for SurrogateMove {
    fn propose(&self, current: &[f64], _complement: &[Vec<f64>], rng: &mut dyn RngCore) -> Proposal {
        let stay = || Proposal { position: current.to_vec(), log_factor: 0.0, translation: false };
        let Some(here) = self.0.place(current) else { return stay() };
        let there = self.0.walk(here.clone(), rng);
        Proposal { log_factor: here.log_density - there.log_density, position: there.position, translation: false }
    }
}
