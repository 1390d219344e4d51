//! The observations of a config as read from files or simulated: profiles over their full width and light curves, with
//! quoted uncertainties. A command reads or simulates them once, and they stay constant:
//! [`calibrated`](super::calibrated) derives the input of the model.

use crate::data::config::{
    ConfigError, DataSetSettings, IndicatorSettings, LightCurveSettings, LightSource, ObservationSource, Settings,
    too_long,
};
use crate::data::io::FileError;
use crate::data::io::light_curve::{self, Measurements};
use crate::data::io::lsd::{self, Label, LsdError};
use crate::data::simulate::Simulation;
use crate::star::observation::Observations;
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

pub use crate::data::io::lsd::ProfileSet;

/// More measurements of a light curve are not simulated.
const MOST_SIMULATED: f64 = 50_000.0;

/// The observations of a config.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// The profiles of each data set, those of excluded times left out.
    pub sets: Vec<ProfileSet>,
    /// The light curves.
    pub light_curves: Vec<Measurements>,
    /// The activity indicators, their values in place of fluxes.
    pub indicators: Vec<Measurements>,
    /// Their files.
    pub files: Vec<PathBuf>,
}

/// Why there are no valid observations: one line that names file, and line or key.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The config is at fault.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The observations are.
    #[error(transparent)]
    Observations(#[from] LsdError),
    /// A light curve is.
    #[error(transparent)]
    LightCurve(#[from] FileError),
}

impl Dataset {
    /// Reads or simulates the observations of `settings`.
    ///
    /// # Errors
    /// Files that cannot be read or are invalid, and days in several time systems.
    pub fn read(settings: &Settings) -> Result<Self, SceneError> {
        let light_curves = light_curves(settings)?;
        let sets = settings.sets.iter().map(|set| profiles(settings, set)).collect::<Result<Vec<_>, _>>()?;
        Dataset::of(settings, sets, light_curves)
    }

    /// The same with these profiles in place of those of each data set.
    ///
    /// # Errors
    /// As [`Dataset::read`], another number of data sets, and ones that are simulated.
    pub fn with_profiles(settings: &Settings, profiles: Vec<ProfileSet>) -> Result<Self, SceneError> {
        let light_curves = light_curves(settings)?;
        let fault = |problem: &str| settings.fault("observations", problem);
        profiles.iter().try_for_each(|set| set.observations.check()).map_err(|problem| fault(&problem))?;
        match profiles.len() {
            sets if sets == settings.sets.len() => {}
            1 => return Err(fault("the profiles in memory are one data set: give one").into()),
            _ => return Err(fault("give as many data sets in memory as the config has").into()),
        }
        if settings.sets.iter().any(|set| matches!(set.source, ObservationSource::Simulate(_))) {
            return Err(fault("profiles are given and simulated: leave out `simulate`").into());
        }
        Dataset::of(settings, profiles, light_curves)
    }

    fn of(settings: &Settings, all: Vec<ProfileSet>, mut light_curves: Vec<Measurements>) -> Result<Self, SceneError> {
        let (mut files, mut sets) = (Vec::new(), Vec::new());
        for (set, profiles) in settings.sets.iter().zip(all) {
            if let ObservationSource::Files { path, .. } = &set.source {
                files.push(path.clone());
            }
            files.extend(profiles.labels.iter().filter_map(|label| label.path.clone()));
            check_exposures(settings, set, &profiles)?;
            sets.push(without_excluded(settings, set, profiles)?);
        }
        files.extend(settings.light_curves.iter().filter_map(|curve| match &curve.source {
            LightSource::File(path) => Some(path.clone()),
            LightSource::Simulate(_) => None,
        }));
        enough(settings, &sets)?;
        one_day_count(settings, &sets)?;
        no_profile_twice(settings, &sets)?;
        no_light_curve_twice(settings, &light_curves)?;
        let times_d: Vec<f64> = sets.iter().flat_map(|set: &ProfileSet| set.observations.times_d()).collect();
        light_curves.iter_mut().for_each(|curve| curve.count_as(&times_d));
        files.extend(settings.indicators.iter().map(|indicator| indicator.path.clone()));
        let read = |indicator: &IndicatorSettings| light_curve::read_indicator(&indicator.path);
        let mut indicators = settings.indicators.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        indicators.iter_mut().for_each(|indicator| indicator.count_as(&times_d));
        Ok(Dataset { sets, light_curves, indicators, files })
    }
}

/// Profiles from memory, with names for them.
pub fn in_memory(observations: Observations, name: impl Fn(usize) -> String) -> ProfileSet {
    let label = |k: usize| Label { file: name(k), path: None, vrad_kms: 0.0, line: 0 };
    let labels = (0..observations.profiles.len()).map(label).collect();
    ProfileSet { observations, labels, sha256: None, remarks: Vec::new() }
}

/// The profiles of a data `set`, read or simulated.
fn profiles(settings: &Settings, set: &DataSetSettings) -> Result<ProfileSet, SceneError> {
    match &set.source {
        ObservationSource::Files { path, velocity_range_kms, .. } => Ok(match settings.sets.len() {
            1 => lsd::read_around(path, *velocity_range_kms)?,
            _ => lsd::read_one_of_several(path, *velocity_range_kms)?,
        }),
        ObservationSource::Simulate(simulation) => {
            settings.check_velocity_grid(&set.star, &simulation.truth, simulation.step_kms)?;
            let of = if settings.sets.len() > 1 { format!(" of {}", set.name) } else { String::new() };
            Ok(in_memory(simulation.observe(&set.star), |k| format!("simulated profile {k}{of}")))
        }
    }
}

/// Whether a time (d) lies in one of these windows.
pub(super) fn is_within(windows: &[[f64; 2]], time_d: f64) -> bool {
    windows.iter().any(|[start, end]| *start <= time_d && time_d <= *end)
}

/// The profiles of a `set` without those of excluded times.
fn without_excluded(
    settings: &Settings,
    set: &DataSetSettings,
    mut all: ProfileSet,
) -> Result<ProfileSet, ConfigError> {
    let before = all.labels.len();
    let mut times_d = all.observations.times_d().into_iter();
    all.labels.retain(|_| times_d.next().is_some_and(|time_d| !is_within(&set.exclude, time_d)));
    all.observations.profiles.retain(|profile| !is_within(&set.exclude, profile.time_d));
    let left = all.labels.len();
    let (fewest, are) = if settings.sets.len() > 1 { (1, "is") } else { (lsd::FEWEST, "are") };
    if left < before && left < fewest {
        let problem = format!("leaves {left} of {before} profiles, {fewest} at least {are} needed");
        return Err(settings.fault(&format!("{}.exclude", set.key), &problem));
    }
    if left < before {
        let left_out = before - left;
        all.remarks.push(format!("{left_out} of {before} left out: they lie within the times of exclude"));
    }
    Ok(all)
}

/// Checks that no profile is exposed for longer than is modelled.
fn check_exposures(settings: &Settings, set: &DataSetSettings, profiles: &ProfileSet) -> Result<(), SceneError> {
    for (profile, label) in profiles.observations.profiles.iter().zip(&profiles.labels) {
        let Some(problem) = profile.exposure_s.and_then(|seconds| too_long(seconds, &set.star)) else { continue };
        let problem = format!("{}: exposure time of {problem}", label.file);
        return Err(match &set.source {
            ObservationSource::Files { path, .. } if label.line > 0 => {
                FileError::Line { path: path.clone(), line: label.line, problem }.into()
            }
            _ => settings.fault(&set.key, &problem).into(),
        });
    }
    Ok(())
}

/// Checks that the star was observed more than once, over all data sets.
fn enough(settings: &Settings, sets: &[ProfileSet]) -> Result<(), ConfigError> {
    let count: usize = sets.iter().map(|set| set.labels.len()).sum();
    let is_observed = settings.sets.iter().any(|set| matches!(set.source, ObservationSource::Files { .. }));
    match sets.len() > 1 && is_observed && count < lsd::FEWEST {
        true => Err(settings.fault("observations", &format!("{count} profile in all, {} are needed", lsd::FEWEST))),
        false => Ok(()),
    }
}

/// Checks that no profile is in two data sets: its noise would look like a repeated signal.
fn no_profile_twice(settings: &Settings, sets: &[ProfileSet]) -> Result<(), ConfigError> {
    let mut seen: HashMap<Vec<u64>, (usize, &Label)> = HashMap::new();
    for (s, set) in sets.iter().enumerate() {
        for (profile, label) in set.observations.profiles.iter().zip(&set.labels) {
            let numbers = std::iter::once(profile.time_d + 0.0).chain(profile.intensity.iter().copied());
            match seen.insert(numbers.map(f64::to_bits).collect(), (s, label)) {
                Some((other, its)) if other != s => {
                    let [one, other] = [s, other].map(|s| &settings.sets[s]);
                    let problem = format!(
                        "{} ({} d) is {} of {} ({}) as well: give each profile once",
                        label.file, profile.time_d, its.file, other.key, other.name
                    );
                    return Err(settings.fault(&one.key, &problem));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Checks that no two light curves are mostly the same measurements.
fn no_light_curve_twice(settings: &Settings, curves: &[Measurements]) -> Result<(), ConfigError> {
    let numbers = |curve: &Measurements| {
        curve.fluxes.iter().map(|one| [one.time_d, one.flux].map(f64::to_bits)).collect::<HashSet<_>>()
    };
    let all: Vec<HashSet<[u64; 2]>> = curves.iter().map(numbers).collect();
    for (k, one) in all.iter().enumerate() {
        let shared = |other: &HashSet<[u64; 2]>| one.intersection(other).count();
        if let Some(other) = (0..k).find(|j| 2 * shared(&all[*j]) > one.len().min(all[*j].len())) {
            let (count, other) = (shared(&all[other]), &settings.light_curves[other]);
            let problem =
                format!("{count} of its measurements are those of {} ({}): give each once", other.key, other.name);
            return Err(settings.fault(&settings.light_curves[k].key, &problem));
        }
    }
    Ok(())
}

/// Checks that all data sets use one time system.
fn one_day_count(settings: &Settings, sets: &[ProfileSet]) -> Result<(), ConfigError> {
    let firsts = || sets.iter().filter_map(|set| set.observations.times_d().into_iter().reduce(f64::min));
    let Some(first) = firsts().next() else { return Ok(()) };
    let far = |(_, time): &(&DataSetSettings, f64)| (time - first).abs() > lsd::LONGEST_D;
    match settings.sets.iter().zip(firsts()).find(far) {
        None => Ok(()),
        Some((set, time)) => {
            let problem = format!(
                "its times begin at {time} d, those of {} at {first} d: use one time system for all data sets (MJD \
                is JD - 2400000.5)",
                settings.sets[0].key
            );
            Err(settings.fault(&set.key, &problem))
        }
    }
}

/// Times (d) of a light curve from a first to a last time, one each `cadence_d`; `key` is its section.
///
/// # Errors
/// Too many measurements.
pub fn at_cadence(
    settings: &Settings,
    key: &str,
    cadence_d: f64,
    [first, last]: [f64; 2],
) -> Result<Vec<f64>, ConfigError> {
    let count = ((last - first) / cadence_d).floor() + 1.0;
    if count > MOST_SIMULATED {
        let problem = format!("{cadence_d} makes {count} measurements, over {MOST_SIMULATED}");
        return Err(settings.fault(&format!("{key}.cadence_d"), &problem));
    }
    Ok((0..count as usize).map(|k| first + k as f64 * cadence_d).collect())
}

/// The measurements of all light curves, read or simulated.
fn light_curves(settings: &Settings) -> Result<Vec<Measurements>, SceneError> {
    let of = |curve: &LightCurveSettings| match &curve.source {
        LightSource::File(path) => Ok(light_curve::read(path)?),
        LightSource::Simulate(light) => {
            let simulations: Vec<&Simulation> = settings.sets.iter().filter_map(DataSetSettings::simulation).collect();
            let times = || simulations.iter().flat_map(|simulation| &simulation.times_d).copied();
            let ends = [times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)];
            let times_d = at_cadence(settings, &format!("{}.simulate", curve.key), light.cadence_d, ends)?;
            let fluxes = simulations[0].fluxes(&settings.star, &curve.band, &times_d, (light.sigma, light.seed));
            Ok(Measurements { fluxes, ..Measurements::default() })
        }
    };
    settings.light_curves.iter().map(of).collect()
}
