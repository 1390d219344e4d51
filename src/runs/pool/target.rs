//! The density that a run samples: the posterior, for one map with unresolved spots counted as noise or not.

use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity};
use crate::surface::UnresolvedSpots;
use crate::surface::density::{Density, UnresolvedSpotsError};
use crate::surface::surrogate::Surrogate;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The sampled density.
pub struct Target {
    posterior: Density,
    /// The surrogate of the density before it is fitted; `None` where there is none.
    surrogate: Option<Surrogate>,
}

/// Draws of the surrogate that represent the region of a chain.
const DRAWS: usize = 200;

/// Smallest expected number of evaluations of a chain.
const EVALUATIONS: usize = 3000;

impl Target {
    /// From `posterior`, with unresolved spots according to the config, and with warm starts in the region that the
    /// surrogate predicts for a chain: a function of posterior and config alone, so that a resumed run, or another
    /// process, has the same.
    ///
    /// # Errors
    /// [`UnresolvedSpotsError`].
    pub fn new(posterior: Density, unresolved_spots: UnresolvedSpots) -> Result<Self, UnresolvedSpotsError> {
        let posterior = posterior.sampled(unresolved_spots)?;
        let surrogate = posterior.surrogate();
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let draws = (0..DRAWS).filter_map(|_| surrogate.as_ref()?.draw(&mut rng));
        let draws: Vec<Vec<f64>> = draws.map(|position| posterior.to_physical(&position)).collect();
        let posterior = posterior.with_warm_starts_for(&draws, EVALUATIONS);
        Ok(Target { posterior, surrogate })
    }

    /// The posterior.
    pub fn posterior(&self) -> &Density {
        &self.posterior
    }

    /// The surrogate, if there is one, and the fraction of its proposals accepted in a test: a function of the density
    /// alone, so that a resumed run has the same.
    pub fn surrogate(&self, evaluator: &dyn Evaluator) -> Option<(Surrogate, f64)> {
        let surrogate = self.surrogate.clone()?;
        Some(self.posterior.fitted(surrogate, evaluator))
    }
}

impl LogDensity for Target {
    fn names(&self) -> &[String] {
        self.posterior.names()
    }

    fn number_names(&self) -> &[&str] {
        self.posterior.number_names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.posterior.evaluate(theta)
    }

    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        self.posterior.to_sampling(theta)
    }

    fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        self.posterior.to_physical(internal)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.posterior.log_jacobian(theta)
    }
}
