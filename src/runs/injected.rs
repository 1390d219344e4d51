//! The results of `inject`: the profiles of a scene with the orbit of a planet in them, the config for these, and the
//! true parameters.

use crate::data::calibrated::of_sets;
use crate::data::config::{self, DataSetSettings, Settings};
use crate::data::io::atomic::{self, WriteError, write_set};
use crate::data::io::lsd;
use crate::data::io::truth::{self, InjectedTruth};
use crate::data::scene::Scene;
use crate::model::Parameter;
use crate::star::Orbit;
use crate::star::injection::inject;
use crate::star::observation::{Observations, Profile};
use std::path::Path;

/// Name of the config that is written beside the profiles.
pub const CONFIG: &str = "config.json";

/// Profiles with an injected orbit.
#[derive(Clone, Debug)]
pub struct Injected<'a> {
    scene: &'a Scene,
    orbit: Orbit,
    /// The profiles of each data set.
    sets: Vec<Observations>,
    /// The velocity of the orbit at each profile of all sets (km/s).
    velocity_kms: Vec<f64>,
}

/// Why nothing was injected.
#[derive(Debug, thiserror::Error)]
pub enum InjectError {
    /// An orbit that is invalid for these profiles.
    #[error("--{option}: must be {must}, not {value}")]
    Orbit {
        /// The invalid option.
        option: &'static str,
        /// Its value.
        value: f64,
        /// Its requirement.
        must: String,
    },
}

/// Folder of the profiles of a data set, relative to the output: the output folder itself for one set, otherwise a
/// folder of its name.
pub fn folder_of(scene: &Scene, set: &DataSetSettings) -> String {
    if scene.settings.sets.len() > 1 { format!("{}/", set.name) } else { String::new() }
}

impl<'a> Injected<'a> {
    /// The profiles of `scene` with `orbit`.
    ///
    /// # Errors
    /// [`InjectError::Orbit`].
    pub fn of(scene: &'a Scene, orbit: Orbit) -> Result<Self, InjectError> {
        let whole = scene.whole();
        let orbit = checked(orbit, &whole)?;
        let star = &scene.imager.star;
        let sets = of_sets(&scene.imager, &inject(&whole, star, &[orbit]));
        let velocity = |profile: &Profile| orbit.velocity_kms(star.cycle(profile.time_d));
        let velocity_kms = whole.profiles.iter().map(velocity).collect();
        Ok(Injected { scene, orbit, sets, velocity_kms })
    }

    /// Writes `observations.txt`, the profiles that it lists and `truth.json` into `folder`, which must exist, for
    /// several data sets each into a folder of its name there; and `config.json`.
    ///
    /// # Errors
    /// A folder that cannot be made, a file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_set(folder, &|stage| self.fill(stage))
    }

    fn fill(&self, folder: &Path) -> Result<(), WriteError> {
        let Injected { scene, orbit, sets, velocity_kms } = self;
        for (s, (set, own)) in scene.settings.sets.iter().zip(sets).enumerate() {
            let folder = folder.join(folder_of(scene, set));
            if let Err(source) = std::fs::create_dir_all(&folder) {
                return Err(WriteError { path: folder, source });
            }
            lsd::write_as(&folder, own, &scene.data.sets[s].labels, "with an injected orbit")?;
            let truth = InjectedTruth {
                injected: *orbit,
                before: scene.truth,
                times_d: own.times_d(),
                velocity_kms: velocity_kms[scene.imager.profiles_of(s)].to_vec(),
                provenance: scene.provenance(),
            };
            truth::write(&folder, &truth)?;
        }
        let config = scene.settings.with_observations(|set| format!("{}observations.txt", folder_of(scene, set)));
        atomic::write(&folder.join(CONFIG), config::to_text(&config).as_bytes())
    }

    /// The results, one label and text per line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let Injected { orbit, velocity_kms, .. } = self;
        let largest = velocity_kms.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let mut lines = vec![
            ("profiles", format!("{}, shifted by up to {largest:.4} km/s", velocity_kms.len())),
            ("orbit", format!("K {} km/s, Porb/Prot {}, phi {}", orbit.k_kms, orbit.porb_over_prot, orbit.phi)),
        ];
        lines.extend(outside(&self.scene.settings, orbit).into_iter().map(|note| ("note", note)));
        lines
    }
}

/// The orbit, if it leaves the line within the data.
fn checked(orbit: Orbit, whole: &Observations) -> Result<Orbit, InjectError> {
    let Orbit { k_kms, porb_over_prot, phi } = orbit;
    let width_kms = |p: &Profile| p.intensity.len() as f64 * p.step_kms;
    let most = 0.25 * whole.profiles.iter().map(width_kms).fold(f64::INFINITY, f64::min);
    let wrong = |option, value, must| Err(InjectError::Orbit { option, value, must });
    match () {
        _ if !(k_kms >= 0.0 && k_kms <= most) => {
            wrong("k-kms", k_kms, format!("from 0 to {most:.1}, a quarter of the width of the profiles"))
        }
        _ if !(porb_over_prot > 0.0 && porb_over_prot.is_finite()) => {
            wrong("porb-over-prot", porb_over_prot, "above 0".into())
        }
        _ if !phi.is_finite() => wrong("phi", phi, "finite".into()),
        _ => Ok(Orbit { phi: phi.rem_euclid(1.0), ..orbit }),
    }
}

/// Priors that exclude the orbit.
fn outside(settings: &Settings, orbit: &Orbit) -> Vec<String> {
    let value = |parameter| match parameter {
        Parameter::K => Some(orbit.k_kms),
        Parameter::PorbOverProt => Some(orbit.porb_over_prot),
        Parameter::Phi => Some(orbit.phi),
        _ => None,
    };
    let missed = settings.free.iter().filter_map(|f| Some((f, value(f.parameter).filter(|x| !f.prior.contains(*x))?)));
    missed.map(|(f, x)| format!("{x} is outside the prior of parameters.{}", f.parameter.name())).collect()
}
