//! The blind search after an orbit has been put in, to second order around the image without a planet.

use crate::inference::detection::DetectionSettings;
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::orbits::{Trial, scan};
use crate::planets::periodogram::window::is_same_frequency;
use crate::planets::periodogram::{CircularOrbit, Frequencies, Search, Unbounded};
use crate::planets::verdict::CANDIDATE_FAP;
use crate::star::Orbit;
use crate::surface::expansion::Expansion;
use crate::surface::imaging::Imager;
use crate::surface::{At, Change, Linearised, NoFit, SurfaceError, SurfaceModel};
use serde::{Deserialize, Serialize};

/// How orbits are looked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LimitSettings {
    /// The blind search.
    pub detection: DetectionSettings,
    /// Its trial periods.
    pub frequencies: Frequencies,
    /// Whether the best orbit of the profiles as they are is taken out first.
    pub without_best: bool,
}

/// What a blind search makes of an orbit that was put in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// ln L of the highest peak above no planet.
    pub delta_ln_l: f64,
    /// Its period over the rotation period.
    pub porb_over_prot: f64,
    /// Its semi-amplitude (km/s).
    pub k_kms: f64,
    /// Whether its false-alarm probability is that of a detection.
    pub detected: bool,
    /// Whether it has the period of the orbit, too.
    pub recovered: bool,
}

impl Outcome {
    /// Of a peak when an orbit of `injected` was put in; a detection is above `level`.
    pub(super) fn of(peak: (f64, f64, f64), level: f64, injected: &Orbit, time_base_cycles: f64) -> Self {
        let (frequency, delta_ln_l, k_kms) = peak;
        let detected = delta_ln_l > level;
        let recovered = detected && is_same_frequency(frequency, 1.0 / injected.porb_over_prot, time_base_cycles);
        Outcome { delta_ln_l, porb_over_prot: 1.0 / frequency, k_kms, detected, recovered }
    }
}

/// The star without a planet, and how it is searched.
pub struct Shortcut<'a> {
    /// How it is searched.
    pub settings: &'a LimitSettings,
    /// What is assumed of its spots.
    surface: Box<dyn SurfaceModel>,
    /// Maps and expansion.
    pub here: Linearised,
    /// Whether the star changes, where spots are taken for unchanging.
    pub change: Option<Result<Change, NoFit>>,
    /// What was taken out of the profiles: the orbit found, with the opposite sign.
    pub removed: Option<Orbit>,
    /// The search before anything is put in.
    pub before: Search,
    /// Delta ln L of a detection.
    pub level: f64,
}

impl<'a> Shortcut<'a> {
    /// Images the star in `imager`, all but the orbit as in `values`, without a planet.
    ///
    /// # Errors
    /// [`SurfaceError`].
    pub fn new(
        imager: &Imager,
        mut values: ParameterValues,
        settings: &'a LimitSettings,
    ) -> Result<Self, SurfaceError> {
        values.set(Parameter::K, 0.0);
        let surface = settings.detection.surface.model();
        let nuisances = &settings.detection.nuisances;
        let at = At { imager, values, nuisances };
        let mut here = surface.linearise(at, None)?;
        let change = surface.evolution(at, &settings.frequencies);
        let search = |here: &Linearised| Search::new(&here.quadratic, &settings.frequencies, settings.detection.search);
        let mut before = search(&here)?;
        let mut removed = None;
        if settings.without_best {
            let CircularOrbit { k_kms, phi, .. } = before.best().orbit;
            let orbit = Orbit { k_kms: -k_kms, porb_over_prot: before.best().porb_over_prot, phi };
            here.expansion = with(&here.expansion, &orbit);
            here.quadratic = surface.velocities(&here.expansion, nuisances).ok_or(Unbounded)?;
            before = search(&here)?;
            removed = Some(orbit);
        }
        let level = before.false_alarm.level(CANDIDATE_FAP);
        Ok(Shortcut { settings, surface, here, change, removed, before, level })
    }

    /// Semi-amplitudes (km/s) between which planets begin to be found: from a third of the lowest K that is found half
    /// the time at any period to four times the K that is found for certain at nine periods of ten. `None` where
    /// nothing is bounded.
    pub fn k_range_kms(&self) -> Option<(f64, f64)> {
        let rows = &self.before.rows;
        let lowest = rows.iter().filter_map(|row| row.k_limit50_kms).fold(f64::INFINITY, f64::min);
        let mut highest: Vec<f64> = rows.iter().filter_map(|row| row.k_limit95_kms).collect();
        highest.sort_by(f64::total_cmp);
        let most = highest.get(9 * highest.len() / 10)?;
        Some((lowest / 3.0, 4.0 * most))
    }

    /// The search with `orbit` in the profiles. Nothing is found where no orbit is bounded.
    pub fn search(&self, orbit: &Orbit) -> Outcome {
        let frequencies = &self.settings.frequencies;
        let moved = with(&self.here.expansion, orbit);
        let Some(quadratic) = self.surface.velocities(&moved, &self.settings.detection.nuisances) else {
            return Outcome::default();
        };
        let trials = scan(&quadratic, &frequencies.per_cycle);
        let summits = scan(&quadratic, &summits(&trials));
        let highest = |trials: &[Trial]| {
            let orbits = trials.iter().filter_map(|trial| Some((trial.frequency, trial.orbit?)));
            orbits.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l))
        };
        let Some(trial) = highest(&trials) else { return Outcome::default() };
        // at an end of the search there is no summit
        let summit = highest(&summits).filter(|summit| summit.1.delta_ln_l >= trial.1.delta_ln_l).unwrap_or(trial);
        // the level is of draws at the trial periods, and so is what is held against it
        let peak = (summit.0, trial.1.delta_ln_l, summit.1.k_kms);
        Outcome::of(peak, self.level, orbit, frequencies.time_base_cycles)
    }
}

/// Share of ln L that is lost half way between two trial frequencies, at most: with all profiles at both ends of the
/// time base 3 %. A neighbouring season's peak has 99 % of the right one's.
const LOST: f64 = 0.05;

/// The frequencies between those of `trials` at which peaks are highest, of all that may be the highest.
fn summits(trials: &[Trial]) -> Vec<f64> {
    let height = |trial: &Trial| trial.orbit.map_or(0.0, |orbit| orbit.delta_ln_l);
    let least = (1.0 - LOST) * trials.iter().map(height).fold(0.0, f64::max);
    let summit = |around: &[Trial]| {
        let [before, here, after] = [0, 1, 2].map(|k| height(&around[k]));
        let bend = 2.0 * here - before - after;
        let is_peak = here >= before && here >= after && here >= least && bend > 0.0;
        let step = 0.5 * (around[2].frequency - around[0].frequency);
        is_peak.then(|| around[1].frequency + 0.5 * step * (after - before) / bend)
    };
    trials.windows(3).filter_map(summit).collect()
}

/// `expansion` with `orbit` in the profiles: `ln L(x)` becomes `ln L(x - V)`, whose gradient is `g + I V`.
fn with(expansion: &Expansion, orbit: &Orbit) -> Expansion {
    let mut moved = expansion.clone();
    for (k, velocity) in orbit.velocities_kms(&expansion.cycles).enumerate() {
        moved.gradient.axpy(velocity, &expansion.information.column(k), 1.0);
    }
    moved
}
