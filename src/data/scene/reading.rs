//! One data set of a config: its profiles read or simulated, those of excluded times left out, errors as they are
//! asked for.

use super::measuring::measured_errors;
use super::seasons::is_within;
use super::{SceneError, fingerprint};
use crate::data::config::{ConfigError, DataSetSettings, ObservationSource, Settings};
use crate::data::io::lsd::{self, Label, LsdError, ReadOptions};
use crate::star::observation::{Observations, Profile};
use crate::surface::calibration::noise::{ErrorSettings, MeasuredErrors};

/// What became of a data set.
pub(super) struct Part {
    pub observations: Observations,
    /// SHA-256 (hex) of the bytes of its files, or of the numbers.
    pub sha256: String,
    pub errors: Option<MeasuredErrors>,
    /// What a reader of results must know.
    pub remarks: Vec<String>,
}

impl Part {
    /// Reads or simulates a `set` of `settings`, with errors as they are quoted.
    pub fn read(settings: &Settings, set: &DataSetSettings) -> Result<Self, SceneError> {
        match &set.source {
            ObservationSource::Files { path, options, continuum_level, .. } => {
                let data = lsd::read(path, options)?;
                let (mut observations, mut remarks) = (data.observations, data.remarks);
                let left_out = leave_out(settings, set, &mut observations)?;
                remarks.extend(remark(left_out));
                if *continuum_level == 1.0 {
                    return Ok(Part { observations, sha256: data.sha256, errors: None, remarks });
                }
                let observations = observations.over_continuum(*continuum_level);
                let sha256 = fingerprint(&observations);
                Ok(Part { observations, sha256, errors: None, remarks })
            }
            ObservationSource::Simulate(simulation) => {
                settings.check_velocity_grid(&set.star, &simulation.truth, simulation.step_kms)?;
                let observations = simulation.observe(&set.star);
                let sha256 = fingerprint(&observations);
                Ok(Part { observations, sha256, errors: None, remarks: Vec::new() })
            }
        }
    }

    /// Measures the errors that the config leaves to the profiles of this `set`.
    pub fn measure_errors(&mut self, settings: &Settings, set: &DataSetSettings) -> Result<(), SceneError> {
        let ObservationSource::Files { path, continuum_level, errors: wanted, .. } = &set.source else { return Ok(()) };
        if *wanted == ErrorSettings::default() {
            return Ok(());
        }
        let mut whole = lsd::read(path, &ReadOptions::default())?.observations;
        leave_out(settings, set, &mut whole)?;
        let whole = whole.over_continuum(*continuum_level);
        let measured = measured_errors(settings, set, *wanted, &whole, &self.observations)?;
        measured.apply(&mut self.observations);
        self.sha256 = fingerprint(&self.observations);
        self.errors = Some(measured);
        Ok(())
    }
}

/// That days of all data sets are of one count.
pub(super) fn one_day_count(settings: &Settings, parts: &[Part]) -> Result<(), ConfigError> {
    let firsts = || parts.iter().filter_map(|part| part.observations.times_d().into_iter().reduce(f64::min));
    let Some(first) = firsts().next() else { return Ok(()) };
    let far = |(_, time): &(&DataSetSettings, f64)| (time - first).abs() > lsd::LONGEST_D;
    match settings.sets.iter().zip(firsts()).find(far) {
        None => Ok(()),
        Some((set, time)) => {
            let problem = format!(
                "its times begin at {time} d, those of {} at {first} d: another zero point? Days of all data sets are \
                 of one count (MJD is JD - 2400000.5)",
                settings.sets[0].key
            );
            Err(settings.fault(&set.key, &problem))
        }
    }
}

/// The profiles of a `set` in their whole width, as they are in their files, with what the list says of each.
pub(super) fn whole(settings: &Settings, set: &DataSetSettings) -> Result<(Observations, Vec<Label>), LsdError> {
    match &set.source {
        ObservationSource::Files { path, .. } => {
            let mut whole = lsd::read(path, &ReadOptions::default())?.observations;
            let times_d = whole.times_d();
            let labels = lsd::labels(path)?.into_iter().zip(times_d);
            let labels = labels.filter(|(_, time_d)| !is_excluded(set, *time_d)).map(|(label, _)| label).collect();
            whole.profiles.retain(|profile| !is_excluded(set, profile.time_d));
            Ok((whole, labels))
        }
        ObservationSource::Simulate(simulation) => {
            let whole = simulation.observe(&set.star);
            let of = if settings.sets.len() > 1 { format!(" of {}", set.name) } else { String::new() };
            let name = |k: usize| Label { file: format!("simulated profile {k}{of}"), vrad_kms: 0.0 };
            let labels = (0..whole.profiles.len()).map(name).collect();
            Ok((whole, labels))
        }
    }
}

fn is_excluded(set: &DataSetSettings, time_d: f64) -> bool {
    set.exclude.iter().any(|window| is_within(window, time_d))
}

/// Leaves out the profiles of excluded times; says how many they are, of how many.
fn leave_out(
    settings: &Settings,
    set: &DataSetSettings,
    observations: &mut Observations,
) -> Result<(usize, usize), ConfigError> {
    let all = observations.profiles.len();
    observations.profiles.retain(|profile: &Profile| !is_excluded(set, profile.time_d));
    let left = observations.profiles.len();
    let fewest = if settings.sets.len() > 1 { 1 } else { 2 };
    match left < all && left < fewest {
        true => {
            let problem = format!(
                "leaves {left} of {all} profiles, {fewest} at least {} needed",
                match fewest {
                    1 => "is",
                    _ => "are",
                }
            );
            Err(settings.fault(&format!("{}.exclude", set.key), &problem))
        }
        false => Ok((all - left, all)),
    }
}

fn remark((left_out, all): (usize, usize)) -> Option<String> {
    (left_out > 0).then(|| format!("{left_out} of {all} left out: they lie within the times of exclude"))
}
