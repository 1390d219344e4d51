//! Configs as JSON and observations as arrays: what every call begins with.

use crate::fault::Fault;
use dimcmc::{Config, Observations, Profile, Scene};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use std::ffi::CString;
use std::path::PathBuf;

/// A config as JSON text, and the file that it was read from.
#[derive(Clone, FromPyObject)]
pub struct ConfigText(String, Option<PathBuf>);

impl ConfigText {
    /// The config, checked.
    pub fn config(&self) -> Result<Config, Fault> {
        Ok(match &self.1 {
            Some(path) => Config::from_json_at(&self.0, path)?,
            None => Config::from_json(&self.0)?,
        })
    }
}

/// Times (d), first velocity of each profile and velocity step (km/s), intensities and errors `[profile, bin]`.
#[derive(FromPyObject)]
pub struct Arrays<'py>(
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, f64>,
    f64,
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray2<'py, f64>,
);

/// The same as arrays that are returned.
pub type NewArrays<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>, f64, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

impl Arrays<'_> {
    /// The profiles; shapes agree.
    pub fn observations(&self) -> PyResult<Observations> {
        let Arrays(times, first, step_kms, intensity, sigma) = self;
        let (times, first) = (times.as_array(), first.as_array());
        let (intensity, sigma) = (intensity.as_array(), sigma.as_array());
        if intensity.nrows() != times.len() || first.len() != times.len() || sigma.dim() != intensity.dim() {
            return Err(PyValueError::new_err("observations: arrays of different shapes"));
        }
        let profile = |k: usize| Profile {
            time_d: times[k],
            first_velocity_kms: first[k],
            step_kms: *step_kms,
            intensity: intensity.row(k).to_vec(),
            sigma: sigma.row(k).to_vec(),
            exposure_s: None,
        };
        Ok(Observations { profiles: (0..times.len()).map(profile).collect() })
    }
}

/// Arrays of profiles that all have as many bins.
pub fn arrays<'py>(py: Python<'py>, observations: &Observations) -> PyResult<NewArrays<'py>> {
    let profiles = &observations.profiles;
    let of = |number: fn(&Profile) -> f64| profiles.iter().map(number).collect::<Vec<_>>().to_pyarray(py);
    let rows = |numbers: fn(&Profile) -> &Vec<f64>| {
        PyArray2::from_vec2(py, &profiles.iter().map(|p| numbers(p).clone()).collect::<Vec<_>>())
            .map_err(|e| PyValueError::new_err(format!("observations: {e}")))
    };
    let (times, first) = (of(|p| p.time_d), of(|p| p.first_velocity_kms));
    Ok((times, first, observations.step_kms(), rows(|p| &p.intensity)?, rows(|p| &p.sigma)?))
}

/// What a scene is made of, owned.
pub struct Source {
    config: ConfigText,
    observations: Option<Observations>,
}

impl Source {
    /// Of a call's arguments; warns of a config that names no objective.
    pub fn new(py: Python, config: ConfigText, observations: Option<Arrays>) -> PyResult<Self> {
        // one that cannot be read is told of with its scene
        if let Some(text) = config.config().ok().and_then(|config| config.assumed_objective()) {
            let text = CString::new(text)?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        let observations = observations.map(|arrays| arrays.observations()).transpose()?;
        Ok(Source { config, observations })
    }

    /// The scene, its observations read, simulated or at hand.
    pub fn scene(self, seed: Option<u64>) -> Result<Scene, Fault> {
        let config = self.config.config()?;
        let config = match seed {
            Some(seed) => config.with("sampler.seed", seed),
            None => config,
        };
        Ok(match self.observations {
            Some(observations) => Scene::with_profiles(&config, observations)?,
            None => Scene::new(&config)?,
        })
    }
}

/// Reads a config: as written, and with all defaults filled in.
#[pyfunction]
pub fn load_config(path: PathBuf) -> Result<(String, String), Fault> {
    let config = Config::load(&path)?;
    Ok((config.to_json(), config.resolved()?.to_string()))
}

/// The config with all defaults filled in.
#[pyfunction]
pub fn check_config(config: ConfigText) -> Result<String, Fault> {
    Ok(config.config()?.resolved()?.to_string())
}

/// Whether profiles make sense.
#[pyfunction]
pub fn check_observations(observations: Arrays) -> PyResult<()> {
    let checked = observations.observations()?.check();
    checked.map_err(|problem| PyValueError::new_err(format!("observations: {problem}")))
}

/// Reads the profiles that a list names.
#[pyfunction]
pub fn read_observations(py: Python<'_>, list: PathBuf) -> PyResult<NewArrays<'_>> {
    arrays(py, &dimcmc::read_observations(&list).map_err(Fault::from)?)
}

/// Writes a list and its profiles into a folder.
#[pyfunction]
pub fn write_observations(observations: Arrays, folder: PathBuf) -> PyResult<()> {
    let observations = observations.observations()?;
    Ok(dimcmc::write_observations(&folder, &observations).map_err(Fault::from)?)
}
