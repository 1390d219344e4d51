//! The activity indicators of a config, binned to few values.

use super::light_curves::{far_from_profiles, remembered_d, with_tables};
use crate::data::config::{ConfigError, IndicatorSettings, Settings};
use crate::data::dataset::is_within;
use crate::data::io::light_curve::Measurements;
use crate::star::observation::Observations;
use crate::surface::photometry::{Flux, bin_width_d, in_bins};

/// Fewest values of an indicator: level, slope, gain and jitter are fitted to them; ...
const FEWEST: usize = 6;

/// ... and most: each is a row of the covariance of the data.
const MOST: usize = 400;

/// The values of each indicator that lie outside of its excluded windows and near profiles in time, the mean of
/// neighbours where there are many; and a description in words.
///
/// # Errors
/// An indicator with too few or too many remaining values, or whose times are all far from those of the profiles.
pub(super) fn used(
    settings: &Settings,
    parts: &[Observations],
    measured: &[Measurements],
) -> Result<(Vec<Vec<Flux>>, Vec<String>), ConfigError> {
    let of_each = settings.indicators.iter().zip(measured);
    let used = of_each.map(|(indicator, all)| used_of(settings, parts, indicator, all));
    let (values, notes): (Vec<_>, Vec<_>) = used.collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    Ok((values, notes.concat()))
}

fn used_of(
    settings: &Settings,
    parts: &[Observations],
    indicator: &IndicatorSettings,
    all: &Measurements,
) -> Result<(Vec<Flux>, Vec<String>), ConfigError> {
    let is_kept = |one: &&Flux| !is_within(&indicator.exclude, one.time_d);
    let mut kept: Vec<Flux> = all.fluxes.iter().filter(is_kept).copied().collect();
    if kept.len() < FEWEST {
        let (left, before) = (kept.len(), all.fluxes.len());
        let key = if left < before { format!("{}.exclude", indicator.key) } else { indicator.key.clone() };
        let problem = format!("{left} of {before} values left, at least {FEWEST} are needed");
        return Err(settings.fault(&key, &problem));
    }
    let times_d: Vec<f64> = kept.iter().map(|one| one.time_d).collect();
    if let Some(problem) = far_from_profiles(settings, parts, &times_d) {
        return Err(settings.fault(&indicator.key, &problem));
    }
    let mut notes = all.remarks.clone();
    let of_profiles: Vec<f64> = parts.iter().flat_map(Observations::times_d).collect();
    let near_d = remembered_d(settings);
    kept.retain(|one| of_profiles.iter().any(|time_d| (time_d - one.time_d).abs() <= near_d));
    if kept.len() < times_d.len() {
        let (far, all) = (times_d.len() - kept.len(), times_d.len());
        notes.push(format!("{far} of {all} values left out, {near_d:.0} d or more from any profile"));
    }
    let times_d: Vec<f64> = kept.iter().map(|one| one.time_d).collect();
    let values = in_bins(&kept, bin_width_d(&[times_d], settings.star.rotation_period_d));
    if !(FEWEST..=MOST).contains(&values.len()) {
        let left = values.len();
        let problem = format!("{left} values near the profiles, {FEWEST} to {MOST} are needed: see exclude");
        return Err(settings.fault(&indicator.key, &problem));
    }
    let notes = notes.into_iter().map(|note| format!("{}: {note}", indicator.name)).collect();
    Ok((values, notes))
}

/// The fingerprint of all other observations with that of the indicators, where there are any.
pub(super) fn fingerprint(others: String, indicators: &[Vec<Flux>]) -> String {
    let rows = |values: &Vec<Flux>| values.iter().map(|one| [one.time_d, one.flux, one.sigma]).collect();
    with_tables(others, &indicators.iter().map(rows).collect::<Vec<Vec<_>>>())
}
