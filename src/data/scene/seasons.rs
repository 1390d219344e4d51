//! The seasons of a star that does not change within one: each has a map of its own.

use crate::data::config::{ConfigError, ImagingSettings, ObservationSource, SEASON_GAP_D, Settings};
use crate::data::io::provenance::Season;
use crate::star::OwnMap;
use crate::star::observation::Observations;
use crate::surface::ObjectiveKind;
use crate::surface::imaging::Imager;

/// The seasons of profiles, in the order of time: as the config has them, or parted by gaps. Integrated maps, which
/// change, have one.
///
/// # Errors
/// A profile in none of the config's seasons.
pub(super) fn seasons(settings: &Settings, parts: &[Observations]) -> Result<Vec<Season>, ConfigError> {
    let ImagingSettings { seasons: windows, season_gap_d, objective, .. } = &settings.imaging;
    let mut times: Vec<f64> = parts.iter().flat_map(Observations::times_d).collect();
    times.sort_by(f64::total_cmp);
    if windows.is_empty() {
        let gap = match objective {
            ObjectiveKind::MarginalLikelihood => f64::INFINITY,
            _ => season_gap_d.unwrap_or(SEASON_GAP_D),
        };
        return Ok(times.chunk_by(|a, b| b - a <= gap).map(|of| season(settings, of)).collect());
    }
    for (set, part) in settings.sets.iter().zip(parts) {
        let left = |time: &f64| !windows.iter().any(|window| is_within(window, *time));
        if let Some(time) = part.times_d().into_iter().find(left) {
            let cure = match set.source {
                ObservationSource::Files { .. } => format!("; {}.exclude leaves profiles out", set.key),
                ObservationSource::Simulate(_) => String::new(),
            };
            let problem = format!("the profile at {time} d ({}) is in none of the seasons{cure}", set.key);
            return Err(settings.fault("imaging.seasons", &problem));
        }
    }
    let of_window = |window: &[f64; 2]| {
        let of: Vec<f64> = times.iter().copied().filter(|time| is_within(window, *time)).collect();
        (!of.is_empty()).then(|| season(settings, &of))
    };
    Ok(windows.iter().filter_map(of_window).collect())
}

/// Whether a time (d) lies in a window.
pub(super) fn is_within([start, end]: &[f64; 2], time: f64) -> bool {
    *start <= time && time <= *end
}

/// The season of profiles at these times (d), which rise.
fn season(settings: &Settings, times: &[f64]) -> Season {
    let star = &settings.sets[0].star;
    let (first_d, last_d) = (times[0], times[times.len() - 1]);
    let cycles = star.cycle(0.5 * (first_d + last_d)).round();
    Season { first_d, last_d, profiles: times.len(), epoch_d: star.epoch_d + cycles * star.rotation_period_d }
}

/// First and last time (d) of each season of the data sets' profiles.
///
/// # Errors
/// As [`seasons`].
pub(super) fn windows<'a>(
    settings: &Settings,
    parts: impl Iterator<Item = &'a Observations>,
) -> Result<Vec<[f64; 2]>, ConfigError> {
    let found = seasons(settings, &parts.cloned().collect::<Vec<_>>())?;
    Ok(found.iter().map(|season| [season.first_d, season.last_d]).collect())
}

/// What results say of the seasons of all profiles; nothing of one.
///
/// # Errors
/// As [`seasons`], and a season of the config without a profile.
pub(super) fn measured(settings: &Settings, parts: &[Observations]) -> Result<Vec<Season>, ConfigError> {
    let found = seasons(settings, parts)?;
    let is_seen = |window: &[f64; 2]| found.iter().any(|season| is_within(window, season.first_d));
    match settings.imaging.seasons.iter().position(|window| !is_seen(window)) {
        Some(k) => Err(settings.fault(&format!("imaging.seasons[{k}]"), "there is no profile in it")),
        None if found.len() == 1 => Ok(Vec::new()),
        None => Ok(found),
    }
}

/// What images the observations with a map of each season.
pub(super) fn with_seasons(imager: Imager, seasons: &[Season]) -> Imager {
    let own_map = |time: f64| {
        let number = seasons.partition_point(|season| season.first_d <= time).saturating_sub(1);
        OwnMap { number, epoch_d: seasons[number].epoch_d }
    };
    match seasons.len() {
        0 | 1 => imager,
        maps => imager.with_maps(maps, own_map),
    }
}
