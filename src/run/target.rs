//! What a run samples: the posterior, with spots left over counted as noise or not; and how often it was evaluated.
//!
//! Left out: what the posterior is worth anywhere (`objective`, `expansion`).

use super::RunError;
use crate::expansion::SpotsCounted;
use crate::log_density::{Evaluation, LogDensity, Threads};
use crate::objective::{Posterior, SpotsLeft};
use crate::surrogate::Surrogate;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// The density that is sampled.
pub(super) struct Target {
    posterior: Posterior,
    counted: Option<SpotsCounted>,
    evaluations: AtomicUsize,
}

impl Target {
    /// Of `posterior`, spots left over taken as the config says.
    pub(super) fn new(posterior: Posterior, spots_left: SpotsLeft) -> Result<Self, RunError> {
        let counted = match spots_left {
            SpotsLeft::Entropy => None,
            SpotsLeft::Fitted => Some(SpotsCounted::new(&posterior).ok_or(RunError::SpotsLeft)?),
        };
        Ok(Target { posterior, counted, evaluations: AtomicUsize::new(0) })
    }

    /// How often it was evaluated.
    pub(super) fn evaluations(&self) -> usize {
        self.evaluations.load(Relaxed)
    }

    /// The surrogate, if there is one, and the share of its proposals accepted on trial: a function of the density alone, so that
    /// a resumed run has the same.
    pub(super) fn surrogate(&self) -> Option<(Surrogate, f64)> {
        let (imager, space) = (self.posterior.imager(), self.posterior.space());
        let surrogate = match &self.counted {
            Some(counted) => Surrogate::of_expansion(counted.expansion(), space, imager),
            None => Surrogate::new(imager, space, self.posterior.reference()),
        };
        Some(surrogate?.fitted(self, &Threads(self)))
    }
}

impl LogDensity for Target {
    fn names(&self) -> &[String] {
        self.posterior.names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.evaluations.fetch_add(1, Relaxed);
        let evaluation = self.posterior.evaluate(theta);
        match &self.counted {
            Some(counted) => counted.recount(self.posterior.space(), theta, evaluation),
            None => evaluation,
        }
    }

    fn to_internal(&self, theta: &[f64]) -> Vec<f64> {
        self.posterior.to_internal(theta)
    }

    fn to_written(&self, internal: &[f64]) -> Vec<f64> {
        self.posterior.to_written(internal)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.posterior.log_jacobian(theta)
    }
}
