//! The linearised blind search with an injected orbit, to second order around the image without a planet.
//!
//! It is that of `periodogram`: the same nuisances, and the same jitter and field of spots, which respond to an orbit
//! that is not in the model. A planet in the original profiles is removed first, with the spots fitted together with
//! it.

use crate::inference::detection::{Detection, DetectionSettings};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::injections::Highest;
use crate::planets::periodogram::orbits::{Trial, scan};
use crate::planets::periodogram::window::is_same_frequency;
use crate::planets::periodogram::{CircularOrbit, Frequencies, Injections, Jitter, OfField, Search, Unbounded};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::CANDIDATE_FAP;
use crate::star::Orbit;
use crate::surface::expansion::Expansion;
use crate::surface::imaging::Imager;
use crate::surface::{At, Linearised, SurfaceError, SurfaceModel, WithoutJitter};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// The settings of the search for orbits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LimitSettings {
    /// The blind search.
    pub detection: DetectionSettings,
    /// Its trial periods.
    pub frequencies: Frequencies,
    /// Whether the best orbit of the original profiles is removed first.
    pub best: BestOrbit,
}

/// The treatment of the best orbit of the original profiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum BestOrbit {
    /// Removed if it is a candidate.
    OutIfCandidate,
    /// Removed.
    Out,
    /// Kept.
    In,
}

/// The result of a blind search for an injected orbit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// ln L of the highest peak relative to no planet.
    pub delta_ln_l: f64,
    /// Its period over the rotation period.
    pub porb_over_prot: f64,
    /// Its semi-amplitude (km/s).
    pub k_kms: f64,
    /// Whether its false-alarm probability is that of a detection.
    pub detected: bool,
    /// Whether it also has the period of the orbit.
    pub recovered: bool,
}

impl Outcome {
    /// For the highest peak when the orbit `injected` was injected.
    pub(super) fn of(highest: Highest, injected: &Orbit, time_base_cycles: f64) -> Self {
        let Highest { frequency, delta_ln_l, k_kms, level } = highest;
        let detected = delta_ln_l > level;
        let recovered = detected && is_same_frequency(frequency, 1.0 / injected.porb_over_prot, time_base_cycles);
        Outcome { delta_ln_l, porb_over_prot: 1.0 / frequency, k_kms, detected, recovered }
    }
}

/// The star without a planet, and the settings of its search.
pub struct Shortcut<'a> {
    /// The settings of its search.
    pub settings: &'a LimitSettings,
    /// The assumptions on its spots.
    surface: Box<dyn SurfaceModel>,
    /// The search of the original profiles.
    pub found: Detection,
    /// The removed orbit: the orbit found, with the opposite sign.
    pub removed: Option<Orbit>,
    /// The star into which orbits are injected.
    star: Linearised,
    /// The same with fields of spots that absorb less and more of an orbit, where spots are a field.
    fields: Vec<OfField>,
    /// Its jitter.
    jitter: Jitter,
    /// The search of that star.
    pub before: Search,
    /// Delta ln L of a detection in it.
    pub level: f64,
}

impl<'a> Shortcut<'a> {
    /// Searches the star in `imager`, all but the orbit as in `values`, and removes the planet that is found.
    ///
    /// # Errors
    /// [`SurfaceError`].
    pub fn new(imager: &Imager, values: ParameterValues, settings: &'a LimitSettings) -> Result<Self, SurfaceError> {
        let LimitSettings { detection, frequencies, best } = settings;
        let found = Detection::find(imager, values, frequencies.clone(), detection, &|_| ())?;
        let surface = detection.surface.model();
        let removes = match best {
            BestOrbit::OutIfCandidate => found.is_candidate(),
            BestOrbit::Out => true,
            BestOrbit::In => false,
        };
        let mut star = found.planet_free.clone();
        let fitted = |of: &WithoutJitter| Jitter::Fitted(of.stability_kms, of.nights.clone());
        let jitter = found.without_jitter.as_ref().map_or(Jitter::Known, fitted);
        let (mut before, mut removed) = (found.blind.clone(), None);
        let mut at = At { imager, values, nuisances: &detection.nuisances };
        found.known.write(&mut at.values);
        if removes {
            let CircularOrbit { k_kms, phi, .. } = found.highest().orbit;
            let porb_over_prot = found.highest().porb_over_prot;
            let orbit = Orbit { k_kms: -k_kms, porb_over_prot, phi };
            if found.known.first().is_none() {
                at.values.set(Parameter::K, k_kms);
                at.values.set(Parameter::PorbOverProt, porb_over_prot);
                at.values.set(Parameter::Phi, phi);
            }
            // spots and jitter fitted together with the planet
            star = found.last().clone();
            let mut without_jitter = surface.without_jitter(at, &star)?;
            for here in std::iter::once(&mut star).chain(without_jitter.as_mut().map(|without| &mut without.here)) {
                here.expansion = with(&here.expansion, &orbit);
                here.quadratic = surface.velocities(&here.expansion, &detection.nuisances).ok_or(Unbounded)?;
            }
            let jitters = found.known.jitters(&star, without_jitter.as_ref());
            before = Search::with_jitter(&jitters, frequencies, detection.search)?;
            removed = Some(orbit);
        }
        let mut fields = surface.absorbing(at, &star)?;
        if let Some(orbit) = removed {
            for OfField { velocities, held, .. } in &mut fields {
                put_into(velocities, &orbit);
                put_into(held, &orbit);
            }
        }
        // orbits are searched with known planets in the model
        for OfField { velocities, held, .. } in &mut fields {
            *velocities = found.known.beside(velocities).into_owned();
            *held = found.known.beside(held).into_owned();
        }
        let level = before.false_alarm.level(CANDIDATE_FAP);
        Ok(Shortcut { settings, surface, found, removed, star, fields, jitter, before, level })
    }

    /// Semi-amplitudes (km/s) between which planets begin to be detected: from a third of the lowest K that is detected
    /// half the time at any period to four times the K that is detected with certainty at nine periods of ten. `None`
    /// where nothing is bounded.
    pub fn k_range_kms(&self) -> Option<(f64, f64)> {
        let rows = &self.before.rows;
        let lowest = rows.iter().filter_map(|row| row.k_limit50_kms).fold(f64::INFINITY, f64::min);
        let mut highest: Vec<f64> = rows.iter().filter_map(|row| row.k_limit95_kms).collect();
        highest.sort_by(f64::total_cmp);
        let most = highest.get(9 * highest.len() / 10)?;
        Some((lowest / 3.0, 4.0 * most))
    }

    /// The searches with orbits of up to `most_kms` in the profiles.
    pub fn searches(&self, most_kms: f64) -> Searches<'_> {
        let LimitSettings { detection, frequencies, .. } = self.settings;
        let injections = (!self.fields.is_empty()).then(|| {
            Injections::new(&self.fields, &self.jitter, most_kms, frequencies, detection.search, CANDIDATE_FAP)
        });
        Searches { shortcut: self, injections }
    }
}

/// Searches with an orbit in the profiles.
pub struct Searches<'a> {
    shortcut: &'a Shortcut<'a>,
    /// Where spots are a field.
    injections: Option<Injections<'a>>,
}

impl Searches<'_> {
    /// Searches with orbits of one period over the rotation period, by semi-amplitude (km/s) and phase. Nothing is
    /// found where no orbit is bounded.
    pub fn of_period(&self, porb_over_prot: f64) -> impl Fn(f64, f64) -> Outcome + '_ {
        let column = self.injections.as_ref().map(|injections| injections.column(porb_over_prot));
        move |k_kms, phi| {
            let orbit = Orbit { k_kms, porb_over_prot, phi };
            let highest = match &column {
                Some(column) => column.highest(k_kms, phi),
                None => self.shortcut.without_a_field(&orbit),
            };
            let time_base_cycles = self.shortcut.settings.frequencies.time_base_cycles;
            highest.map_or_else(Outcome::default, |highest| Outcome::of(highest, &orbit, time_base_cycles))
        }
    }

    /// The search with `orbit`.
    pub fn of(&self, orbit: &Orbit) -> Outcome {
        self.of_period(orbit.porb_over_prot)(orbit.k_kms, orbit.phi)
    }
}

impl Shortcut<'_> {
    /// The highest peak with `orbit` in the profiles, where spots are not a field; unresolved spots may grow with the
    /// orbit.
    fn without_a_field(&self, orbit: &Orbit) -> Option<Highest> {
        let LimitSettings { detection, frequencies, .. } = self.settings;
        let moved = with(&self.star.expansion, orbit);
        let quadratic: VelocityQuadratic = self.surface.velocities(&moved, &detection.nuisances)?;
        let quadratic = self.found.known.beside(&quadratic);
        let trials = scan(&quadratic, &frequencies.per_cycle);
        let summits = scan(&quadratic, &summits(&trials));
        let highest = |trials: &[Trial]| {
            let orbits = trials.iter().filter_map(|trial| Some((trial.frequency, trial.orbit?)));
            orbits.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l))
        };
        let trial = highest(&trials)?;
        // at an end of the search there is no maximum
        let summit = highest(&summits).filter(|summit| summit.1.delta_ln_l >= trial.1.delta_ln_l).unwrap_or(trial);
        // the level is from draws at the trial periods, and so is the height that is compared with it
        let (frequency, k_kms) = (summit.0, summit.1.k_kms);
        Some(Highest { frequency, delta_ln_l: trial.1.delta_ln_l, k_kms, level: self.level })
    }
}

/// Largest fraction of ln L that is lost half way between two trial frequencies: with all profiles at both ends of the
/// time base 3 %. A neighbouring season's peak has 99 % of the right one's.
const LOST: f64 = 0.05;

/// The frequencies between those of `trials` at which peaks are highest, for all that may be the highest.
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

/// Injects `orbit` into the profiles of `quadratic`.
fn put_into(quadratic: &mut VelocityQuadratic, orbit: &Orbit) {
    let velocities = DVector::from_iterator(quadratic.len(), orbit.velocities_kms(&quadratic.cycles));
    quadratic.gradient += &quadratic.information * velocities;
}
