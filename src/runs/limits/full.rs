//! The whole way, for a few orbits: profiles resampled with the orbit in them, imaged without a planet, and searched.

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

/// One orbit, both ways.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The orbit.
    #[serde(flatten)]
    pub orbit: Orbit,
    /// By the shortcut.
    pub shortcut: Outcome,
    /// By the whole way; `None` where the star with the orbit cannot be imaged without it.
    pub full: Option<Outcome>,
}

/// How often both ways agree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Agreement {
    /// Orbits tried both ways.
    pub orbits: usize,
    /// Orbits that both recover or both miss.
    pub agree: usize,
    /// Orbits recovered by the shortcut.
    pub by_shortcut: usize,
    /// Orbits recovered by the whole way.
    pub by_full: usize,
}

impl Agreement {
    /// Of some comparisons.
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

/// How far from the limit orbits are drawn, in powers of 2 of K.
const REACH: f64 = 1.0;

/// `count` orbits around the `limits`, where both ways are most likely to differ.
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

/// The whole way, by what another process must know to go it: it costs seconds an orbit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WholeWay {
    /// The config file, which paths in the config start from.
    pub config: PathBuf,
    /// The config, resolved.
    pub resolved: Value,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// How orbits are looked for.
    pub settings: LimitSettings,
    /// What was taken out of the profiles.
    pub removed: Option<Orbit>,
}

/// Why it cannot be gone.
#[derive(Debug, thiserror::Error)]
pub enum WholeWayError {
    /// The config or the observations are not to be had.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The observations are others.
    #[error("{}: the observations are not those that the search began with", .0.display())]
    Changed(PathBuf),
}

impl WholeWay {
    /// That of the star in `scene`, searched as the `shortcut` is.
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
    /// A config or profiles that are no longer what they were.
    pub fn scene(&self) -> Result<Scene, WholeWayError> {
        let scene = Scene::new(&Config::at(self.resolved.clone(), &self.config))?;
        match scene.data_sha256 == self.data_sha256 {
            true => Ok(fitted(scene, &|_| ())),
            false => Err(WholeWayError::Changed(self.config.clone())),
        }
    }

    /// The blind search of the profiles in `scene` with an orbit in them; `None` where they or their image make no
    /// sense any more.
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
