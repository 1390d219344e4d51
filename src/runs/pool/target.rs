//! What a run samples: the posterior, with unresolved spots counted as noise or not where one map counts.

use crate::inference::surrogate::Surrogate;
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity};
use crate::surface::density::Density;
use crate::surface::objective::UnresolvedSpots;
use crate::surface::static_map::SpotsCounted;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The density that is sampled.
pub struct Target {
    posterior: Density,
    counted: Option<SpotsCounted>,
    /// Of the surrogates' kind, before it is fitted; none where there is none.
    surrogate: Option<Surrogate>,
}

/// Draws of the surrogate that stand for where a chain goes.
const DRAWS: usize = 200;

/// Evaluations that a chain is expected to take at least.
const EVALUATIONS: usize = 3000;

/// The unresolved spots have no size that fits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "imaging.unresolved_spots: no size of the unresolved spots fits the data; \"entropy\" takes them as the entropy \
    has them"
)]
pub struct UnresolvedSpotsError;

impl Target {
    /// Of `posterior`, unresolved spots taken as the config says, with warm starts where the surrogate says that a
    /// chain goes: a function of posterior and config alone, so that a resumed run, or another process, has the same.
    ///
    /// # Errors
    /// [`UnresolvedSpotsError`].
    pub fn new(posterior: Density, unresolved_spots: UnresolvedSpots) -> Result<Self, UnresolvedSpotsError> {
        let counted = match (&posterior, unresolved_spots) {
            (Density::Integrated(_), _) | (_, UnresolvedSpots::Entropy) => None,
            (Density::Mapped(posterior), UnresolvedSpots::Fitted) => {
                Some(SpotsCounted::new(posterior).ok_or(UnresolvedSpotsError)?)
            }
        };
        let (imager, space) = (posterior.imager(), posterior.space());
        let surrogate = match (&posterior, &counted) {
            (Density::Integrated(posterior), _) => {
                posterior.expansion().ok().and_then(|expansion| Surrogate::of_expansion(expansion, space, imager))
            }
            (_, Some(counted)) => Surrogate::of_expansion(counted.expansion(), space, imager),
            (Density::Mapped(posterior), None) => Surrogate::new(imager, space, posterior.reference()),
        };
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let draws = (0..DRAWS).filter_map(|_| surrogate.as_ref()?.draw(&mut rng));
        let draws: Vec<Vec<f64>> = draws.map(|position| space.to_physical(&position)).collect();
        let posterior = posterior.with_warm_starts_for(&draws, EVALUATIONS);
        Ok(Target { posterior, counted, surrogate })
    }

    /// The posterior.
    pub fn posterior(&self) -> &Density {
        &self.posterior
    }

    /// The surrogate, if there is one, and the share of its proposals accepted on trial: a function of the density
    /// alone, so that a resumed run has the same.
    pub fn surrogate(&self, evaluator: &dyn Evaluator) -> Option<(Surrogate, f64)> {
        let surrogate = self.surrogate.clone()?;
        Some(match &self.posterior {
            Density::Mapped(_) => surrogate.fitted(self, evaluator),
            // it is the density's own expansion
            Density::Integrated(_) => surrogate.fitted_if_poor(self, evaluator),
        })
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
        let evaluation = self.posterior.evaluate(theta);
        match &self.counted {
            Some(counted) => counted.recount(self.posterior.space(), theta, evaluation),
            None => evaluation,
        }
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
