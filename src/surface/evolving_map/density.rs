//! The marginal posterior behind the interface of all surface models.

use super::{Held, MarginalPosterior};
use crate::model::ParameterSpace;
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity as _};
use crate::surface::density::{Density, SurfaceDensity, UnresolvedSpotsError};
use crate::surface::imaging::Imager;
use crate::surface::objective::UnresolvedSpots;
use crate::surface::record::{FieldRecord, SurfaceRecord, by_name};
use crate::surface::surrogate::Surrogate;
use std::any::Any;
use std::sync::Arc;

impl FieldRecord {
    pub(super) fn of(posterior: &MarginalPosterior) -> Self {
        let Held { break_degree, jitter_kms, night_kms } = posterior.reference().assumed.held();
        FieldRecord {
            parameters: by_name(&posterior.reference().values),
            spot_break_degree: break_degree,
            velocity_jitter_kms: jitter_kms,
            night_offsets_kms: night_kms,
            ln_evidence: posterior.reference_ln_evidence(),
            data: posterior.imager().data.depth.len(),
        }
    }

    /// The assumptions that are not parameters.
    pub(super) fn held(&self) -> Held {
        let (jitter_kms, night_kms) = (self.velocity_jitter_kms, self.night_offsets_kms);
        Held { break_degree: self.spot_break_degree, jitter_kms, night_kms }
    }
}

impl SurfaceDensity for MarginalPosterior {
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
        self.number_names()
    }

    fn with_warm_starts_for(self: Arc<Self>, _: &[Vec<f64>], _: usize) -> Density {
        self
    }

    fn with_warm_starts(self: Arc<Self>, _: &[Vec<f64>]) -> Density {
        self
    }

    fn record(&self) -> SurfaceRecord {
        FieldRecord::of(self).into()
    }

    fn sampled(self: Arc<Self>, _: UnresolvedSpots) -> Result<Density, UnresolvedSpotsError> {
        Ok(self)
    }

    fn surrogate(&self) -> Option<Surrogate> {
        Surrogate::of_expansion(self.expansion().ok()?, self.space(), self.imager())
    }

    /// It is the density's expansion.
    fn fitted(&self, surrogate: Surrogate, evaluator: &dyn Evaluator) -> (Surrogate, f64) {
        match self.finds_only_maps_anew() {
            true => {
                surrogate.refined(self.imager().mid_cycle(), self, &|theta| self.expansion_at(theta).ok(), evaluator)
            }
            false => surrogate.fitted_if_poor(self, evaluator),
        }
    }

    fn any(&self) -> &dyn Any {
        self
    }
}
