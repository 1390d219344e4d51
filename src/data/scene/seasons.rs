//! The seasons of a star that does not change within one: each has a map of its own.

use crate::data::config::{ConfigError, ImagingSettings, SEASON_GAP_D, Settings};
use crate::data::io::provenance::Season;
use crate::posterior::imaging::Imager;
use crate::posterior::objective::ObjectiveKind;
use crate::star::observation::Observations;

/// The seasons of profiles, in the order of time: as the config has them, or parted by gaps.
///
/// # Errors
/// A profile in none of the config's seasons.
pub(super) fn seasons(settings: &Settings, parts: &[Observations]) -> Result<Vec<Season>, ConfigError> {
    let mut times: Vec<f64> = parts.iter().flat_map(Observations::times_d).collect();
    times.sort_by(f64::total_cmp);
    let ImagingSettings { seasons: windows, season_gap_d, .. } = &settings.imaging;
    let season = |of: &[f64]| Season { first_d: of[0], last_d: of[of.len() - 1], profiles: of.len() };
    if windows.is_empty() {
        let gap = season_gap_d.unwrap_or(SEASON_GAP_D);
        return Ok(times.chunk_by(|a, b| b - a <= gap).map(season).collect());
    }
    let within = |[start, end]: [f64; 2], time: f64| start <= time && time <= end;
    if let Some(time) = times.iter().find(|time| !windows.iter().any(|window| within(*window, **time))) {
        let key = format!("{}.exclude", settings.sets[0].key);
        let problem = format!("the profile at {time} d is in none of them; {key} leaves profiles out");
        return Err(settings.fault("imaging.seasons", &problem));
    }
    let of_window = |window: &[f64; 2]| {
        let of: Vec<f64> = times.iter().copied().filter(|time| within(*window, *time)).collect();
        (!of.is_empty()).then(|| season(&of))
    };
    Ok(windows.iter().filter_map(of_window).collect())
}

/// What results say of the seasons of all profiles; nothing of one.
///
/// # Errors
/// As [`seasons`], and a season of the config without a profile.
pub(super) fn measured(settings: &Settings, parts: &[Observations]) -> Result<Vec<Season>, ConfigError> {
    let found = seasons(settings, parts)?;
    let is_seen =
        |[start, end]: &[f64; 2]| found.iter().any(|season| *start <= season.last_d && season.first_d <= *end);
    match settings.imaging.seasons.iter().position(|window| !is_seen(window)) {
        Some(k) => Err(settings.fault(&format!("imaging.seasons[{k}]"), "there is no profile in it")),
        None if found.len() == 1 || settings.imaging.objective == ObjectiveKind::MarginalLikelihood => Ok(Vec::new()),
        None => Ok(found),
    }
}

/// What images the observations with a map of each season.
pub(super) fn with_seasons(imager: Imager, seasons: &[Season]) -> Imager {
    let map_of = |time: f64| seasons.partition_point(|season| season.first_d <= time).saturating_sub(1);
    imager.with_maps(seasons.len().max(1), map_of)
}
