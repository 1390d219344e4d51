//! The full pipeline, for a few orbits: profiles resampled with the orbit in them, imaged without a planet, and
//! searched.

use super::cells::Limit;
use super::shortcut::{LimitSettings, Outcome, Shortcut};
use crate::data::config::Config;
use crate::data::scene::{Scene, SceneError};
use crate::inference::detection::PlanetFree;
use crate::model::for_blind_search;
use crate::planets::periodogram::injections::Highest;
use crate::planets::verdict::CANDIDATE_FAP;
use crate::runs::fitted::fitted;
use crate::star::Orbit;
use crate::surface::At;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::PathBuf;

/// One orbit by both methods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The orbit.
    #[serde(flatten)]
    pub orbit: Orbit,
    /// The linearised result.
    pub shortcut: Outcome,
    /// The result of the full pipeline; `None` where the star with the orbit cannot be imaged without it.
    pub full: Option<Outcome>,
}

/// Agreement of both methods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    /// Orbits tried by both methods.
    pub orbits: usize,
    /// Orbits that both recover or both miss.
    pub agree: usize,
    /// Orbits recovered in the linearised search.
    pub by_shortcut: usize,
    /// Orbits recovered by the full pipeline.
    pub by_full: usize,
}

impl Agreement {
    /// For some comparisons.
    pub fn of(comparisons: &[Comparison]) -> Self {
        let full = |c: &Comparison| c.full.is_some_and(|full| full.recovered);
        let count = |f: &dyn Fn(&Comparison) -> bool| comparisons.iter().filter(|c| f(c)).count();
        Agreement {
            orbits: comparisons.len(),
            agree: count(&|c| c.shortcut.recovered == full(c)),
            by_shortcut: count(&|c| c.shortcut.recovered),
            by_full: count(&full),
        }
    }
}

/// Range of the drawn orbits around the limit, in powers of 2 of K.
const REACH: f64 = 1.0;

/// `count` orbits around the `limits`, where both methods are most likely to differ.
pub fn drawn(shortcut: &Shortcut, limits: &[Limit], count: usize) -> Vec<Orbit> {
    let mut rng = ChaCha8Rng::seed_from_u64(shortcut.settings.detection.search.seed);
    let (_, largest) = shortcut.k_range_kms().unwrap_or_default();
    let mut orbit = || {
        let limit = limits[rng.random_range(0..limits.len())];
        let factor = rng.random_range(-REACH..REACH).exp2();
        Orbit {
            k_kms: limit.k50_kms.map_or(largest, |k| k * factor),
            porb_over_prot: limit.porb_over_prot,
            phi: rng.random_range(0.0..1.0),
        }
    };
    (0..count).map(|_| orbit()).collect()
}

/// The input of the full pipeline for another process: it costs seconds per orbit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WholeWay {
    /// The config file, to which paths in the config are relative.
    pub config: PathBuf,
    /// The config, resolved.
    pub resolved: Value,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// The settings of the search for orbits.
    pub settings: LimitSettings,
    /// The orbit that was removed from the profiles.
    pub removed: Option<Orbit>,
}

/// Why it cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum WholeWayError {
    /// The config or the observations are not available.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The observations differ.
    #[error("{}: the observations are not those that the search began with", .0.display())]
    Changed(PathBuf),
}

impl WholeWay {
    /// For the star in `scene`, with the search of the `shortcut`.
    pub fn new(scene: &Scene, shortcut: &Shortcut) -> Self {
        WholeWay {
            config: scene.settings.path.clone(),
            resolved: scene.settings.resolved.clone(),
            data_sha256: scene.data_sha256.clone(),
            settings: shortcut.settings.clone(),
            removed: shortcut.removed,
        }
    }

    /// The star, for another process.
    ///
    /// # Errors
    /// A config or profiles that have changed.
    pub fn scene(&self) -> Result<Scene, WholeWayError> {
        let scene = Scene::new(&Config::at(self.resolved.clone(), &self.config))?;
        match scene.data_sha256 == self.data_sha256 {
            true => Ok(fitted(scene, &|_| ())),
            false => Err(WholeWayError::Changed(self.config.clone())),
        }
    }

    /// The blind search of the profiles in `scene` with an orbit in them; `None` where they or their image become
    /// invalid.
    pub fn searcher(&self, scene: Scene) -> impl Fn(&Orbit) -> Option<Outcome> + Send + Sync + use<> {
        let WholeWay { settings, removed, .. } = self.clone();
        move |orbit: &Orbit| {
            let orbits: Vec<Orbit> = removed.into_iter().chain([*orbit]).collect();
            let star = scene.injected(&orbits).ok()?;
            let values = for_blind_search(star.settings.values, &star.settings.free);
            let at = At { imager: &star.imager, values, nuisances: &settings.detection.nuisances };
            let (surface, frequencies) = (settings.detection.surface.model(), &settings.frequencies);
            let found = PlanetFree::find(&*surface, at, frequencies, &settings.detection, &|_| ()).ok()?;
            let best = found.blind.best();
            let highest = Highest {
                frequency: 1.0 / best.porb_over_prot,
                delta_ln_l: best.orbit.delta_ln_l,
                k_kms: best.orbit.k_kms,
                level: found.blind.false_alarm.level(CANDIDATE_FAP),
            };
            Some(Outcome::of(highest, orbit, frequencies.time_base_cycles))
        }
    }
}
