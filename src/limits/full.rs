//! The whole way, for a few orbits: profiles resampled with the orbit in them, imaged without a planet, and searched.

use super::Limit;
use super::shortcut::{Outcome, Shortcut};
use crate::detection::View;
use crate::io::lsd::LsdError;
use crate::objective::Parameter;
use crate::observation::Observations;
use crate::periodogram::{DETECTION_FAP, Search};
use crate::scene::Scene;
use crate::star::Orbit;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// One orbit, both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// The orbit.
    pub orbit: Orbit,
    /// By the shortcut.
    pub shortcut: Outcome,
    /// By the whole way; `None` where the star with the orbit cannot be imaged without it.
    pub full: Option<Outcome>,
}

/// How often both ways agree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
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

/// Tries `count` orbits around the `limits` both ways, where they are most likely to differ; `progress` is called after each.
///
/// # Errors
/// Profiles that are no longer what they were.
pub fn compare(
    scene: &Scene,
    shortcut: &Shortcut,
    limits: &[Limit],
    count: usize,
    progress: &dyn Fn(),
) -> Result<Vec<Comparison>, LsdError> {
    let whole = if count > 0 { scene.whole()?.0 } else { scene.observations.clone() };
    let mut rng = ChaCha8Rng::seed_from_u64(shortcut.settings.detection.search.seed);
    let (_, largest) = shortcut.k_range_kms().unwrap_or_default();
    let mut comparisons = Vec::with_capacity(count);
    for _ in 0..count {
        let limit = limits[rng.random_range(0..limits.len())];
        let factor = rng.random_range(-REACH..REACH).exp2();
        let orbit = Orbit {
            k_kms: limit.k50_kms.map_or(largest, |k| k * factor),
            porb_over_prot: limit.porb_over_prot,
            phi: rng.random_range(0.0..1.0),
        };
        let full = search(scene, &whole, shortcut, &orbit);
        comparisons.push(Comparison { orbit, shortcut: shortcut.search(&orbit), full });
        progress();
    }
    Ok(comparisons)
}

/// The blind search of profiles with `orbit` in them; `None` where they or their image make no sense any more.
fn search(scene: &Scene, whole: &Observations, shortcut: &Shortcut, orbit: &Orbit) -> Option<Outcome> {
    let settings = shortcut.settings;
    let orbits: Vec<Orbit> = shortcut.removed.into_iter().chain([*orbit]).collect();
    let star = scene.injected(whole, &orbits).ok()?;
    let mut values = star.settings.values;
    values[Parameter::K] = 0.0;
    let view = View::new(&star.imager, values, &settings.detection).ok()?;
    let search = Search::new(&view.quadratic, &settings.frequencies, settings.detection.search).ok()?;
    let best = search.best();
    let peak = (1.0 / best.porb_over_prot, best.orbit.delta_ln_l, best.orbit.k_kms);
    let level = search.false_alarm.level(DETECTION_FAP);
    Some(Outcome::of(peak, level, orbit, settings.frequencies.time_base_cycles))
}
