//! The posterior by one map of maximum entropy behind the interface of all surface models.

use super::{LIKELIHOOD_NUMBERS, Posterior, Reference, SpotsCounted};
use crate::model::ParameterSpace;
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity};
use crate::surface::density::{Density, SurfaceDensity, UnresolvedSpotsError};
use crate::surface::imaging::Imager;
use crate::surface::objective::UnresolvedSpots;
use crate::surface::record::{ImageRecord, SurfaceRecord, by_name};
use crate::surface::surrogate::Surrogate;
use std::any::Any;
use std::sync::Arc;

impl ImageRecord {
    pub(super) fn of(reference: &Reference) -> Self {
        let solution = &reference.solution;
        ImageRecord {
            parameters: by_name(&reference.values),
            chi2_target: reference.chi2_target,
            chi2: solution.chi2,
            lambda: solution.image.lambda,
            entropy: solution.entropy,
            spottedness: solution.spottedness,
            chi2_reach: reference.tradeoff.nodes().last().map_or(solution.chi2, |node| node.chi2),
            data: reference.response.data_len(),
        }
    }
}

impl SurfaceDensity for Posterior {
    fn space(&self) -> &ParameterSpace {
        self.space()
    }

    fn imager(&self) -> &Imager {
        self.imager()
    }

    fn likelihood(&self, theta: &[f64]) -> Evaluation {
        self.likelihood(theta)
    }

    fn likelihood_numbers(&self) -> &[&str] {
        &LIKELIHOOD_NUMBERS
    }

    fn with_warm_starts_for(self: Arc<Self>, thetas: &[Vec<f64>], evaluations: usize) -> Density {
        Arc::new(Arc::unwrap_or_clone(self).with_warm_starts_for(thetas, evaluations))
    }

    fn with_warm_starts(self: Arc<Self>, thetas: &[Vec<f64>]) -> Density {
        Arc::new(Arc::unwrap_or_clone(self).with_warm_starts(thetas))
    }

    fn warm_starts(&self) -> Vec<Vec<f64>> {
        self.warm_starts().map(<[f64]>::to_vec).collect()
    }

    fn record(&self) -> SurfaceRecord {
        ImageRecord::of(self.reference()).into()
    }

    fn sampled(self: Arc<Self>, unresolved_spots: UnresolvedSpots) -> Result<Density, UnresolvedSpotsError> {
        Ok(match unresolved_spots {
            UnresolvedSpots::Entropy => self,
            UnresolvedSpots::Fitted => {
                let counted = SpotsCounted::new(&self).ok_or(UnresolvedSpotsError)?;
                Arc::new(Counted { posterior: Arc::unwrap_or_clone(self), counted })
            }
        })
    }

    fn surrogate(&self) -> Option<Surrogate> {
        Surrogate::new(self.imager(), self.space(), self.reference())
    }

    fn fitted(&self, surrogate: Surrogate, evaluator: &dyn Evaluator) -> (Surrogate, f64) {
        surrogate.fitted(self, evaluator)
    }

    fn any(&self) -> &dyn Any {
        self
    }
}

/// The same with unresolved spots counted as noise.
#[derive(Clone, Debug)]
struct Counted {
    posterior: Posterior,
    counted: SpotsCounted,
}

impl LogDensity for Counted {
    fn names(&self) -> &[String] {
        self.posterior.names()
    }

    fn number_names(&self) -> &[&str] {
        self.posterior.number_names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.counted.recount(self.posterior.space(), theta, self.posterior.evaluate(theta))
    }

    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        self.posterior.to_sampling(theta)
    }

    fn to_physical(&self, x: &[f64]) -> Vec<f64> {
        self.posterior.to_physical(x)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.posterior.log_jacobian(theta)
    }
}

impl SurfaceDensity for Counted {
    fn space(&self) -> &ParameterSpace {
        self.posterior.space()
    }

    fn imager(&self) -> &Imager {
        self.posterior.imager()
    }

    fn likelihood(&self, theta: &[f64]) -> Evaluation {
        self.posterior.likelihood(theta)
    }

    fn likelihood_numbers(&self) -> &[&str] {
        &LIKELIHOOD_NUMBERS
    }

    fn with_warm_starts_for(self: Arc<Self>, thetas: &[Vec<f64>], evaluations: usize) -> Density {
        let Counted { posterior, counted } = Arc::unwrap_or_clone(self);
        Arc::new(Counted { posterior: posterior.with_warm_starts_for(thetas, evaluations), counted })
    }

    fn with_warm_starts(self: Arc<Self>, thetas: &[Vec<f64>]) -> Density {
        let Counted { posterior, counted } = Arc::unwrap_or_clone(self);
        Arc::new(Counted { posterior: posterior.with_warm_starts(thetas), counted })
    }

    fn warm_starts(&self) -> Vec<Vec<f64>> {
        SurfaceDensity::warm_starts(&self.posterior)
    }

    fn record(&self) -> SurfaceRecord {
        self.posterior.record()
    }

    fn sampled(self: Arc<Self>, _: UnresolvedSpots) -> Result<Density, UnresolvedSpotsError> {
        Ok(self)
    }

    fn surrogate(&self) -> Option<Surrogate> {
        Surrogate::of_expansion(self.counted.expansion(), self.space(), self.imager())
    }

    fn fitted(&self, surrogate: Surrogate, evaluator: &dyn Evaluator) -> (Surrogate, f64) {
        surrogate.fitted(self, evaluator)
    }

    fn any(&self) -> &dyn Any {
        &self.posterior
    }
}

impl Posterior {
    /// The posterior of one map behind a density; `None` where it is another one.
    pub fn behind(density: &dyn SurfaceDensity) -> Option<&Self> {
        density.any().downcast_ref()
    }
}
