//! What another process must know to evaluate the same density to the bit: what the computation was begun with.
//!
//! It builds scene, reference and density as a resumed computation does, and with the same checks.

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

/// What others are told before they are asked.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum Brief {
    /// Questions are parameter vectors.
    Density(Box<Task>),
    /// Questions are stars of a batch.
    Stars,
    /// Questions are orbits that are put into profiles.
    Injections(Box<WholeWay>),
}

/// A density, by what it was begun with.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Task {
    /// The config file, which paths in the config start from.
    pub config: PathBuf,
    /// Config, data and reference.
    pub origin: Origin,
    /// Names of the free parameters.
    pub free: Vec<String>,
    /// What of it.
    pub asked: Asked,
}

/// What is asked for at a parameter vector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Asked {
    /// The log-probability that a chain samples.
    LogProbability,
    /// The likelihood of a landscape.
    Likelihood {
        /// Where evaluations start, besides the reference.
        warm_starts: Vec<Vec<f64>>,
    },
}

/// Why a process cannot evaluate what it is asked to.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// Config or observations are not to be had there.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// They are others, or the reference is.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// Orbits cannot be put in there.
    #[error(transparent)]
    Injections(#[from] WholeWayError),
    /// Unresolved spots have no size there.
    #[error(transparent)]
    UnresolvedSpots(#[from] UnresolvedSpotsError),
}

/// Answers questions, from any thread.
pub type Answerer = Box<dyn Fn(&[u8]) -> Vec<u8> + Send + Sync>;

impl Brief {
    /// As bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).expect("plain data")
    }

    /// Back; `None` if they are not what `to_bytes` makes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        serde_json::from_slice(bytes).ok()
    }
}

impl Task {
    /// The task of what began in `scene` with `origin`.
    pub fn new(scene: &Scene, origin: &Origin, free: &[String], asked: Asked) -> Self {
        Task { config: scene.settings.path.clone(), origin: origin.clone(), free: free.to_vec(), asked }
    }

    /// Builds the density.
    ///
    /// # Errors
    /// [`TaskError`]: data that are missing or others here, a reference that comes out differently.
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
