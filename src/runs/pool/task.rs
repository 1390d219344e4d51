//! The input with which another process evaluates the same density to the bit: the origin of the computation.
//!
//! It builds scene, reference and density like a resumed computation, and with the same checks.

use super::message::{Answer as _, numbers_from_bytes};
use super::target::Target;
use crate::data::config::Config;
use crate::data::scene::{Scene, SceneError};
use crate::model::FreeParameter;
use crate::runs::limits::{WholeWay, WholeWayError};
use crate::runs::origin::{Origin, OriginError};
use crate::sampling::log_density::LogDensity as _;
use crate::surface::density::UnresolvedSpotsError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The brief for other processes before their questions.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Brief {
    /// Questions are parameter vectors.
    Density(Box<Task>),
    /// Questions are stars of a batch.
    Stars,
    /// Questions are orbits that are injected into profiles.
    Injections(Box<WholeWay>),
}

/// A density, by its origin.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Task {
    /// The config file, to which paths in the config are relative.
    pub config: PathBuf,
    /// Config, data and reference.
    pub origin: Origin,
    /// Names of the free parameters.
    pub free: Vec<String>,
    /// The requested quantity.
    pub asked: Asked,
}

/// The requested quantity at a parameter vector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Asked {
    /// The log-probability that a chain samples.
    LogProbability,
    /// The likelihood of a likelihood grid.
    Likelihood {
        /// Starts of evaluations, besides the reference.
        warm_starts: Vec<Vec<f64>>,
    },
}

/// Why a process cannot evaluate its questions.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// Config or observations are not available there.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// They differ, or the reference does.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// Orbits cannot be injected there.
    #[error(transparent)]
    Injections(#[from] WholeWayError),
    /// Unresolved spots have no size there.
    #[error(transparent)]
    UnresolvedSpots(#[from] UnresolvedSpotsError),
}

/// Answers questions, from any thread.
pub type Answerer = Box<dyn Fn(&[u8]) -> Vec<u8> + Send + Sync>;

impl Brief {
    /// Encodes it.
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).expect("plain data")
    }

    /// Decodes it; `None` for bytes that are not from `to_bytes`.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        serde_json::from_slice(bytes).ok()
    }
}

impl Task {
    /// The task of a computation that began in `scene` with `origin`.
    pub fn new(scene: &Scene, origin: &Origin, free: &[String], asked: Asked) -> Self {
        Task { config: scene.settings.path.clone(), origin: origin.clone(), free: free.to_vec(), asked }
    }

    /// Builds the density.
    ///
    /// # Errors
    /// [`TaskError`]: data that are missing or differ here, a reference that differs.
    pub fn answerer(&self) -> Result<Answerer, TaskError> {
        let scene = Scene::new(&Config::at(self.origin.config.clone(), &self.config))?;
        let place = self.config.as_path();
        self.origin.check(&scene, place)?;
        let settings = &scene.settings;
        let along_axes = settings.grid.iter().flat_map(|grid| &grid.free);
        let known: Vec<&FreeParameter> = settings.free.iter().chain(along_axes).collect();
        let find = |name: &String| known.iter().copied().find(|f| f.parameter.name() == name).copied();
        let space = scene.space_of(&self.free.iter().filter_map(find).collect::<Vec<_>>());
        let posterior = self.origin.posterior(&scene, space, place)?;
        Ok(match &self.asked {
            Asked::LogProbability => {
                let target = Target::new(posterior, settings.imaging.unresolved_spots)?;
                Box::new(move |question| target.evaluate(&numbers_from_bytes(question)).to_bytes())
            }
            Asked::Likelihood { warm_starts } => {
                let posterior = posterior.with_warm_starts(warm_starts);
                Box::new(move |question| posterior.likelihood(&numbers_from_bytes(question)).to_bytes())
            }
        })
    }
}
