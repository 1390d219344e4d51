//! The posterior with the spots that the map leaves over counted as noise.
//!
//! Where the quadratic holds, what they change is the difference of two quadratics: with spots left over as large as the data
//! say at the reference (`spots`), and with spots as the entropy has them. Far from the reference, where ln L is not the
//! quadratic any more, it falls in the same proportion: `ln L' = q' + rho (ln L - q)` with q and q' the two quadratics' changes
//! from the reference and `rho` the ratio of their drops, softened where these are nothing: 1 at the reference, and at most 1 where
//! spots left over make the data less certain. Left out: where the reference is.

use super::{Expansion, STELLAR, nuisances};
use crate::log_density::{Evaluation, Status};
use crate::objective::{Parameter, ParameterSpace, ParameterValues, Posterior};

/// Drops of ln L below this are nothing.
const SOFT: f64 = 0.1;

/// What a posterior becomes where spots left over count as noise.
#[derive(Clone, Debug)]
pub struct SpotsCounted {
    /// ln L as the objective has it at the reference.
    at_reference: f64,
    entropy: Expansion,
    fitted: Expansion,
}

impl SpotsCounted {
    /// Of `posterior`, spots left over as large as they are at its reference; `None` where there is no such size.
    pub fn new(posterior: &Posterior) -> Option<Self> {
        let free = posterior.space().free();
        let stellar: Vec<Parameter> = STELLAR.into_iter().filter(|&p| free.iter().any(|f| f.parameter == p)).collect();
        let reference = posterior.reference();
        let entropy = Expansion::of(posterior.imager(), reference, &stellar);
        let fitted = entropy.with_spots_left(entropy.spots_left(&nuisances(free))?)?;
        let theta = posterior.space().theta_of(&reference.values);
        let at_reference = posterior.likelihood(&theta).likelihood?.log_likelihood;
        Some(SpotsCounted { at_reference, entropy, fitted })
    }

    /// ln L at the reference to second order, spots left over counted: what a surrogate is made of.
    pub fn expansion(&self) -> &Expansion {
        &self.fitted
    }

    /// ln L with spots left over counted, where it is `log_likelihood` with spots as the entropy has them.
    pub fn log_likelihood(&self, values: &ParameterValues, log_likelihood: f64) -> f64 {
        let change = |expansion: &Expansion| expansion.log_likelihood_at(values) - expansion.log_likelihood;
        let (entropy, fitted) = (change(&self.entropy), change(&self.fitted));
        let drop = |change: f64| SOFT + (-change).max(0.0);
        self.at_reference + fitted + drop(fitted) / drop(entropy) * (log_likelihood - self.at_reference - entropy)
    }

    /// The posterior's `evaluation` at `theta`, spots left over counted.
    pub fn recount(&self, space: &ParameterSpace, theta: &[f64], evaluation: Evaluation) -> Evaluation {
        if !evaluation.log_prob.is_finite() {
            return evaluation;
        }
        let log_prior = space.log_prior(theta);
        let log_likelihood = self.log_likelihood(&space.values_at(theta), evaluation.log_prob - log_prior);
        if log_likelihood.is_nan() {
            return Evaluation { passes: evaluation.passes, ..Evaluation::rejected(Status::NonFinite) };
        }
        Evaluation { log_prob: log_prior + log_likelihood, ..evaluation }
    }
}
