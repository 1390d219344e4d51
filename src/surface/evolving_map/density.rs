//! The marginal posterior behind the interface of all surface models, and what is written of its reference.

use super::{Held, MarginalPosterior};
use crate::model::{Parameter, ParameterSpace};
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity as _};
use crate::surface::density::{Density, SurfaceDensity, UnresolvedSpotsError};
use crate::surface::imaging::Imager;
use crate::surface::objective::UnresolvedSpots;
use crate::surface::record::{SurfaceRecord, by_name};
use crate::surface::surrogate::Surrogate;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The most probable maps, one a profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldRecord {
    /// All parameters, those of the field among them; without a lifetime spots live for ever.
    pub parameters: BTreeMap<String, f64>,
    /// Degree below which the spectrum of the spots is flat.
    #[serde(default)]
    pub spot_break_degree: f64,
    /// Scatter of the profiles' velocity zero points (km/s).
    pub velocity_jitter_kms: f64,
    /// ln of the evidence.
    pub ln_evidence: f64,
    /// Number of data.
    pub data: usize,
}

impl FieldRecord {
    pub(super) fn of(posterior: &MarginalPosterior) -> Self {
        let Held { break_degree, jitter_kms } = posterior.reference().assumed.held();
        FieldRecord {
            parameters: by_name(&posterior.reference().values),
            spot_break_degree: break_degree,
            velocity_jitter_kms: jitter_kms,
            ln_evidence: posterior.reference_ln_evidence(),
            data: posterior.imager().data.depth.len(),
        }
    }

    /// What is no parameter.
    pub(super) fn held(&self) -> Held {
        Held { break_degree: self.spot_break_degree, jitter_kms: self.velocity_jitter_kms }
    }

    /// Parameters of the field that lie on a bound of its search, and free ones whose errors are too small.
    pub(in crate::surface) fn warnings(&self, free: &[String]) -> Vec<String> {
        /// Nearer than this part a bound is reached.
        const REACHED: f64 = 0.01;
        let on_bound = |p: &Parameter| {
            let (value, (low, high)) = (*self.parameters.get(p.name())?, p.widest());
            let near = |bound: f64| (value / bound - 1.0).abs() < REACHED;
            let bound = [low, high].into_iter().find(|bound| near(*bound))?;
            Some(match (p, bound == high) {
                (Parameter::SpotLifetime, true) => "the profiles do not show that the spots change".to_owned(),
                _ => format!("{} lies on the bound of its search, {bound}", p.name()),
            })
        };
        Parameter::FIELD.iter().filter_map(on_bound).chain(self.too_sure(free)).collect()
    }

    /// Which errors are known to be too small (`results/calibration-stellar.md`).
    fn too_sure(&self, free: &[String]) -> Option<String> {
        /// Above this vsini (km/s) they are.
        const FAST_KMS: f64 = 45.0;
        let is_fast = *self.parameters.get(Parameter::Vsini.name())? > FAST_KMS;
        let of = [Parameter::OmegaEq, Parameter::DOmega, Parameter::Inclination].map(Parameter::name);
        let of: Vec<&str> = of.into_iter().filter(|name| free.iter().any(|free| free == name)).collect();
        (is_fast && !of.is_empty()).then(|| {
            format!(
                "vsini is above {FAST_KMS:.0} km/s: take {} with twice the errors, which on simulated stars with spots \
                like discs were too small by factors of 1.4 to 1.7",
                of.join(", ")
            )
        })
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

    /// It is the density's own expansion.
    fn fitted(&self, surrogate: Surrogate, evaluator: &dyn Evaluator) -> (Surrogate, f64) {
        surrogate.fitted_if_poor(self, evaluator)
    }

    fn any(&self) -> &dyn Any {
        self
    }
}
