//! What `simulate` makes: profiles of a spotted star with a planet, and the truth behind them.

use crate::data::config::{Config, ConfigError, ObservationSource};
use crate::data::io::lsd::{self, LsdError};
use crate::data::io::truth::{self, Truth};
use crate::data::scene::{Scene, SceneError};
use crate::posterior::simulate::Simulation;
use crate::star::observation::Observations;
use std::path::{Path, PathBuf};

/// The simulation that a config describes under `observations.simulate`, carried out.
#[derive(Clone, Debug)]
pub struct Simulated {
    scene: Scene,
    simulation: Simulation,
    truth: Truth,
}

/// Why nothing was simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// The config describes no simulation.
    #[error("{}: observations.simulate: missing, a simulation needs its spots, times and velocities", .0.display())]
    Nothing(PathBuf),
    /// Config or profiles make no sense.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl From<ConfigError> for SimulateError {
    fn from(error: ConfigError) -> Self {
        SimulateError::Scene(error.into())
    }
}

impl Simulated {
    /// Simulates what `config` describes.
    ///
    /// # Errors
    /// [`SimulateError`].
    pub fn of(config: &Config) -> Result<Self, SimulateError> {
        let settings = config.settings()?;
        let ObservationSource::Simulate(simulation) = settings.source else {
            return Err(SimulateError::Nothing(settings.path));
        };
        let scene = Scene::new(config)?;
        let truth = scene.truth_of(&simulation);
        Ok(Simulated { scene, simulation, truth })
    }

    /// The profiles.
    pub fn observations(&self) -> &Observations {
        &self.scene.observations
    }

    /// The files that it was read from.
    #[doc(hidden)]
    pub fn read(&self) -> Vec<PathBuf> {
        self.scene.files()
    }

    /// Writes `observations.txt`, the profiles that it lists and `truth.json` into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), LsdError> {
        lsd::write(folder, &self.scene.observations)?;
        Ok(truth::write(folder, &self.truth)?)
    }

    /// What was made, label and text a line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let Simulated { simulation, truth, .. } = self;
        let bins = simulation.bins;
        let snr = simulation.snr.map_or("without noise".into(), |snr| format!("S/N {snr}, seed {}", simulation.seed));
        let range = match simulation.is_changing() {
            true => {
                let least = truth.coverage.iter().copied().fold(f64::INFINITY, f64::min);
                let most = truth.coverage.iter().copied().fold(0.0, f64::max);
                format!(" in the mean, from {least:.5} to {most:.5} as spots come and go")
            }
            false => String::new(),
        };
        vec![
            ("profiles", format!("{} of {bins} bins, {snr}", self.observations().profiles.len())),
            ("spottedness", format!("{:.5}{range}", truth.spottedness)),
        ]
    }
}
