//! What every command begins with: a config file, the observations it names or simulates, and what they are imaged with.
//!
//! Left out: anything that takes a reconstruction.

use crate::config::{self, ConfigError, ObservationSource, Settings};
use crate::imaging::Imager;
use crate::io::lsd::{self, LsdError};
use crate::io::provenance::Provenance;
use crate::io::truth::Truth;
use crate::objective::{FreeParameter, ParameterSpace, ParameterValues};
use crate::observation::Observations;
use crate::simulate::Simulation;
use crate::star::{Quadrature, SurfaceGrid};
use sha2::{Digest, Sha256};
use std::path::Path;

/// A config with its observations.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The config, resolved.
    pub settings: Settings,
    /// The line profiles, read or simulated.
    pub observations: Observations,
    /// SHA-256 (hex) of the observations: of the bytes of their files, or of the numbers simulated.
    pub data_sha256: String,
    /// The parameters that were simulated; `None` for observations from files.
    pub truth: Option<ParameterValues>,
    /// What the observations are imaged with.
    pub imager: Imager,
    /// The free parameters, starting at the config's values; its dimension may be 0.
    pub space: ParameterSpace,
}

/// Why there is no scene: one line that names file, and line or key.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The config is at fault.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The observations are.
    #[error(transparent)]
    Observations(#[from] LsdError),
}

impl Scene {
    /// Reads the config at `path` and reads or simulates its observations.
    ///
    /// # Errors
    /// A config or observations that cannot be read or make no sense.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Scene::new(config::load(path)?)
    }

    /// Reads or simulates the observations of `settings`.
    ///
    /// # Errors
    /// Observations that cannot be read or make no sense.
    pub fn new(settings: Settings) -> Result<Self, SceneError> {
        let (observations, data_sha256, truth) = match &settings.source {
            ObservationSource::Files { path, options } => {
                let data = lsd::read(path, options)?;
                (data.observations, data.sha256, None)
            }
            ObservationSource::Simulate(simulation) => {
                settings.check_velocity_grid(&simulation.truth, simulation.step_kms)?;
                let observations = simulation.observe(&settings.star);
                let sha256 = fingerprint(&observations);
                (observations, sha256, Some(simulation.truth))
            }
        };
        Ok(Scene { data_sha256, truth, ..Scene::of(settings, observations)? })
    }

    /// The scene of observations at hand, whatever `settings` say of where they come from.
    ///
    /// # Errors
    /// Settings that make no sense with these observations.
    pub fn of(settings: Settings, observations: Observations) -> Result<Self, ConfigError> {
        settings.check_velocity_grid(&settings.values, observations.step_kms)?;
        let star = settings.star_for(&observations)?;
        let mut imager = Imager::new(star, &observations, settings.imaging.pixels, settings.imaging.default_spot);
        if let Some(priors) = settings.imaging.nuisances {
            imager = imager.with_nuisances(priors, &observations);
        }
        let space = space(&settings.free, &settings, &imager);
        let data_sha256 = fingerprint(&observations);
        Ok(Scene { settings, observations, data_sha256, truth: None, imager, space })
    }

    /// The space of the parameters in `free`, starting at the config's values, all others fixed there.
    pub fn space_of(&self, free: &[FreeParameter]) -> ParameterSpace {
        space(free, &self.settings, &self.imager)
    }

    /// The true spot map on the pixels of the image, if the observations are simulated.
    pub fn true_spot_filling(&self) -> Option<Vec<f64>> {
        match &self.settings.source {
            ObservationSource::Simulate(simulation) => Some(simulation.spot_filling(&self.imager.grid)),
            ObservationSource::Files { .. } => None,
        }
    }

    /// What the scene's `simulation` was made with.
    pub fn truth_of(&self, simulation: &Simulation) -> Truth {
        let grid = SurfaceGrid::equal_area(simulation.pixels, Quadrature::Gauss2x2);
        let filling = simulation.spot_filling(&grid);
        let state = simulation.truth.state();
        let velocity = |time: &f64| state.vsys_kms + state.orbit.velocity_kms(self.imager.star.cycle(*time));
        Truth {
            parameters: simulation.truth,
            // as the user wrote them: degrees of radians of degrees are not
            spots: self.settings.resolved["observations"]["simulate"]["spots"].clone(),
            continuum: simulation.nuisances(),
            spottedness: filling.iter().zip(&grid.area).map(|(s, a)| s * a).sum(),
            snr: simulation.snr,
            sigma: simulation.sigma(),
            seed: simulation.seed,
            pixels: grid.len(),
            orbit_kms: simulation.times_d.iter().map(velocity).collect(),
            times_d: simulation.times_d.clone(),
            provenance: self.provenance(),
        }
    }

    /// What results say of where they came from.
    pub fn provenance(&self) -> Provenance {
        Provenance {
            version: env!("CARGO_PKG_VERSION"),
            data_sha256: self.data_sha256.clone(),
            config_sha256: self.settings.sha256.clone(),
            config: self.settings.resolved.clone(),
        }
    }
}

fn space(free: &[FreeParameter], settings: &Settings, imager: &Imager) -> ParameterSpace {
    let (mid, base) = (imager.mid_cycle(), imager.time_base_cycles());
    ParameterSpace::new(free.to_vec(), settings.values, mid, base, imager.star.rotation_period_d)
}

/// SHA-256 (hex) of the numbers of `observations`, little-endian: the step, then for each profile time, number of bins, and
/// velocity, intensity and sigma of each bin.
pub fn fingerprint(observations: &Observations) -> String {
    let step = observations.step_kms;
    let mut hash = Sha256::new();
    hash.update(step.to_le_bytes());
    for profile in &observations.profiles {
        hash.update(profile.time_d.to_le_bytes());
        hash.update((profile.intensity.len() as u64).to_le_bytes());
        for (j, (intensity, sigma)) in profile.intensity.iter().zip(&profile.sigma).enumerate() {
            for number in [profile.velocity_kms(j, step), *intensity, *sigma] {
                hash.update(number.to_le_bytes());
            }
        }
    }
    format!("{:x}", hash.finalize())
}
