//! The results of `simulate`: profiles of a spotted star with a planet, one data set or several, and the true
//! parameters.

use crate::data::config::{Config, ConfigError, DataSetSettings, LightCurveSettings, LightSource};
use crate::data::io::atomic::{WriteError, write_set};
use crate::data::io::light_curve::{self, Measurements};
use crate::data::io::lsd;
use crate::data::io::truth::{self, Truth};
use crate::data::scene::{Scene, SceneError};
use crate::data::simulate::Simulation;
use crate::star::observation::Observations;
use crate::surface::photometry::Flux;
use std::path::{Path, PathBuf};

/// The simulation that a config describes under `observations.simulate`, carried out.
#[derive(Clone, Debug)]
pub struct Simulated {
    sets: Vec<SimulatedSet>,
    /// Light curves: name of the file, and measurements.
    light_curves: Vec<(String, Vec<Flux>)>,
    read: Vec<PathBuf>,
}

/// One data set of it.
#[derive(Clone, Debug)]
pub struct SimulatedSet {
    /// Its name.
    pub name: String,
    /// Its profiles.
    pub observations: Observations,
    simulation: Simulation,
    truth: Truth,
}

/// Why nothing was simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// The config describes no simulation.
    #[error("{}: {key}.simulate: missing, a simulation needs its spots, times and velocities", config.display())]
    Nothing {
        /// The config.
        config: PathBuf,
        /// The section of the data set.
        key: String,
    },
    /// A light curve that is observed, not simulated.
    #[error(
        "{}: {key}.path: a table beside profiles that are simulated: give simulate in its place, or leave it out",
        config.display()
    )]
    ObservedLight {
        /// The config.
        config: PathBuf,
        /// The section of the light curve.
        key: String,
    },
    /// Config or profiles are invalid.
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
        let simulation = |set: &DataSetSettings| set.simulation().cloned();
        let Some(simulations) = settings.sets.iter().map(simulation).collect::<Option<Vec<_>>>() else {
            return Err(SimulateError::Nothing { config: settings.path, key: settings.sets[0].key.clone() });
        };
        let observed = |curve: &&LightCurveSettings| matches!(curve.source, LightSource::File(_));
        if let Some(curve) = settings.light_curves.iter().find(observed) {
            return Err(SimulateError::ObservedLight { config: settings.path, key: curve.key.clone() });
        }
        let scene = Scene::new(config)?;
        let light =
            |(curve, of): (&LightCurveSettings, &Measurements)| (format!("{}.csv", curve.name), of.fluxes.clone());
        let light_curves = settings.light_curves.iter().zip(&scene.data.light_curves).map(light).collect();
        let set = |(s, simulation): (usize, Simulation)| SimulatedSet {
            name: settings.sets[s].name.clone(),
            observations: scene.data.sets[s].observations.clone(),
            truth: scene.truth_of(&simulation),
            simulation,
        };
        let sets = simulations.into_iter().enumerate().map(set).collect();
        Ok(Simulated { sets, light_curves, read: scene.files() })
    }

    /// The data sets, at least one.
    pub fn sets(&self) -> &[SimulatedSet] {
        &self.sets
    }

    /// Whether a file of this name is written.
    pub fn writes(&self, name: &str) -> bool {
        lsd::is_written(name) || name == truth::FILE || self.light_curves.iter().any(|(file, _)| file == name)
    }

    /// The input files.
    #[doc(hidden)]
    pub fn read(&self) -> &[PathBuf] {
        &self.read
    }

    /// Writes `observations.txt`, the profiles that it lists and `truth.json` into `folder`, which must exist; for
    /// several data sets each into a folder of its name there.
    ///
    /// # Errors
    /// A folder that cannot be made, a file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_set(folder, &|stage| self.fill(stage))
    }

    fn fill(&self, folder: &Path) -> Result<(), WriteError> {
        for set in &self.sets {
            let folder = if self.sets.len() == 1 { folder.to_owned() } else { folder.join(&set.name) };
            if let Err(source) = std::fs::create_dir_all(&folder) {
                return Err(WriteError { path: folder, source });
            }
            lsd::write(&folder, &set.observations)?;
            truth::write(&folder, &set.truth)?;
        }
        for (file, measured) in &self.light_curves {
            light_curve::write_to(&folder.join(file), measured)?;
        }
        Ok(())
    }

    /// The results, one label and text per line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let several = self.sets.len() > 1;
        let of = |set: &SimulatedSet| {
            let name = several.then(|| ("data set", set.name.clone()));
            name.into_iter().chain(set.lines()).collect::<Vec<_>>()
        };
        let light = |(file, measured): &(String, Vec<Flux>)| {
            ("light curve", format!("{file}: {} measurements", measured.len()))
        };
        self.sets.iter().flat_map(of).chain(self.light_curves.iter().map(light)).collect()
    }
}

impl SimulatedSet {
    fn lines(&self) -> [(&'static str, String); 2] {
        let SimulatedSet { observations, simulation, truth, .. } = self;
        let bins = simulation.bins;
        let snr = simulation.snr.map_or("without noise".into(), |snr| format!("S/N {snr}, seed {}", simulation.seed));
        let range = match simulation.is_changing() {
            true => {
                let least = truth.coverage.iter().copied().fold(f64::INFINITY, f64::min);
                let most = truth.coverage.iter().copied().fold(0.0, f64::max);
                format!(" in the mean, from {least:.5} to {most:.5} as spots evolve")
            }
            false => String::new(),
        };
        [
            ("profiles", format!("{} of {bins} bins, {snr}", observations.profiles.len())),
            ("spottedness", format!("{:.5}{range}", truth.spottedness)),
        ]
    }
}
