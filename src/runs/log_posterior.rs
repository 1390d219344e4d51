//! The density of a chain, for other samplers than this program's.

use crate::data::scene::Scene;
use crate::inference::search::Found;
use crate::model::{Elements, Parameter, ParameterSpace, Prior};
use crate::runs::origin::{Origin, OriginError};
use crate::runs::pool::Target;
use crate::runs::run::RunError;
use crate::sampling::log_density::{Evaluation, LogDensity};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The log-posterior of the free parameters of a [`Scene`], spots marginalised out: the density that a
/// [`Run`](crate::Run) samples, to the bit.
///
/// Vectors are in the order of [`LogDensity::names`] and in the units of these names.
pub struct LogPosterior {
    target: Target,
    origin: Origin,
}

impl LogPosterior {
    /// The density of `scene` with the reference that a search `found` ([`Scene::optimise`]).
    ///
    /// # Errors
    /// A config without a free parameter, and unresolved spots that have no size.
    pub fn new(scene: &Scene, found: Found) -> Result<Self, RunError> {
        scene.settings.require_free()?;
        let origin = Origin::of(scene, &found);
        let target = Target::new(found.posterior, scene.settings.imaging.unresolved_spots)?;
        Ok(LogPosterior { target, origin })
    }

    /// The same, rebuilt from [`LogPosterior::origin`] and the `scene` of the same config and observations; without a
    /// search. `place` is the name in errors.
    ///
    /// # Errors
    /// Another config or other observations, and a reference that differs here.
    pub fn again(scene: &Scene, origin: &str, place: &Path) -> Result<Self, RunError> {
        let origin: Origin =
            serde_json::from_str(origin).map_err(|source| OriginError::Json { path: place.into(), source })?;
        origin.check(scene, place)?;
        let posterior = origin.posterior(scene, scene.space.clone(), place)?;
        let target = Target::new(posterior, scene.settings.imaging.unresolved_spots)?;
        Ok(LogPosterior { target, origin })
    }

    /// Config, fingerprint of the data and reference as JSON: the input of another process beside config and data.
    pub fn origin(&self) -> String {
        serde_json::to_string(&self.origin).expect("plain data")
    }

    /// ln of the prior density at `theta`; minus infinity outside.
    pub fn log_prior(&self, theta: &[f64]) -> f64 {
        self.space().log_prior(theta)
    }

    /// The parameters at `unit`, a point of the unit cube: the prior transform of nested samplers.
    pub fn prior_transform(&self, unit: &[f64]) -> Vec<f64> {
        let free = self.space().free();
        let mut theta: Vec<f64> = free.iter().zip(unit).map(|(free, u)| free.prior.quantile(*u)).collect();
        for planet in &Elements::PLANETS {
            let place = |p: Parameter| free.iter().position(|f| f.parameter == p);
            // of two coordinates in one disc the second is uniform along the chord at the first
            if let [Some(x), Some(y)] = planet.shape.map(place)
                && let Prior::Disc { max_eccentricity } = free[x].prior
            {
                theta[y] = (2.0 * unit[y] - 1.0) * (max_eccentricity - theta[x] * theta[x]).max(0.0).sqrt();
            }
        }
        theta
    }

    /// Log-probabilities of the vectors that follow each other in `thetas`, on the threads of rayon's current pool;
    /// `None` where `stop` was set meanwhile.
    ///
    /// # Panics
    /// If `thetas` is not a whole number of vectors.
    pub fn batch(&self, thetas: &[f64], stop: &AtomicBool) -> Option<Vec<f64>> {
        let dimension = self.names().len();
        assert_eq!(thetas.len() % dimension, 0, "whole vectors");
        let one = |theta: &[f64]| (!stop.load(Relaxed)).then(|| self.evaluate(theta).log_prob);
        thetas.par_chunks_exact(dimension).with_max_len(1).map(one).collect()
    }

    /// The best parameters that the search found, in the order of the names.
    pub fn optimum(&self) -> Vec<f64> {
        self.names().iter().map(|name| self.origin.optimum.parameters[name]).collect()
    }

    /// Their standard deviations from the curvature there.
    pub fn sd(&self) -> Vec<f64> {
        self.names().iter().map(|name| self.origin.optimum.sd[name]).collect()
    }

    fn space(&self) -> &ParameterSpace {
        self.target.posterior().space()
    }
}

impl LogDensity for LogPosterior {
    fn names(&self) -> &[String] {
        self.target.names()
    }

    fn number_names(&self) -> &[&str] {
        self.target.number_names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.target.evaluate(theta)
    }

    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        self.target.to_sampling(theta)
    }

    fn to_physical(&self, x: &[f64]) -> Vec<f64> {
        self.target.to_physical(x)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.target.log_jacobian(theta)
    }
}
