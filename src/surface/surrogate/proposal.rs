//! The surrogate as a move of the ensemble: the end of a walk on it, accepted or rejected by the exact posterior.
//!
//! The walk is reversible with respect to the surrogate density q, so that the Hastings factor is `q(current) /
//! q(proposed)` whatever q is (Liu 2001, *Monte Carlo Strategies in Scientific Computing*, section 9.4.3: surrogate
//! transition). Where q is the posterior up to a constant, every proposal is accepted, and the next state hardly
//! depends on the last.

use super::Surrogate;
use crate::sampling::chain::MoveKind;
use crate::sampling::ensemble::{Move, Proposal};
use rand::RngCore;

/// The move.
#[derive(Clone, Debug)]
pub struct SurrogateMove(pub Surrogate);

impl Move for SurrogateMove {
    fn propose(&self, current: &[f64], _complement: &[Vec<f64>], rng: &mut dyn RngCore) -> Proposal {
        let proposal =
            |position, log_factor| Proposal { position, log_factor, by: MoveKind::Surrogate, translation: false };
        let Some(here) = self.0.place(current) else { return proposal(current.to_vec(), 0.0) };
        let log_density = here.log_density;
        let there = self.0.walk(here, rng);
        proposal(there.position, log_density - there.log_density)
    }
}
