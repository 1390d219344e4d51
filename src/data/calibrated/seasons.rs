//! The seasons of static maps: one map per season.

use crate::data::config::{ConfigError, DataSetSettings, ImagingSettings, ObservationSource, Settings};
use crate::data::dataset::is_within;
use crate::data::io::provenance::Season;
use crate::star::observation::Observations;
use crate::star::{OwnMap, StarSettings};
use crate::surface::imaging::Imager;

/// The seasons of profiles, in the order of time: as the config has them, or separated by gaps. An evolving map has one
/// season.
///
/// # Errors
/// A profile in none of the config's seasons, and one of these without a profile.
pub(super) fn seasons(settings: &Settings, parts: &[Observations]) -> Result<Vec<Season>, ConfigError> {
    let ImagingSettings { seasons: windows, .. } = &settings.imaging;
    let star = &settings.sets[0].star;
    let times = times_d(parts);
    if windows.is_empty() {
        let gap = settings.imaging.longest_gap_d();
        return Ok(times.chunk_by(|a, b| b - a <= gap).map(|of| season(star, of)).collect());
    }
    for (set, part) in settings.sets.iter().zip(parts) {
        if let Some(time) = part.times_d().into_iter().find(|time| !is_within(windows, *time)) {
            let cure = match set.source {
                ObservationSource::Files { .. } => format!("; {}.exclude leaves profiles out", set.key),
                ObservationSource::Simulate(_) => String::new(),
            };
            let problem = format!("the profile at {time} d ({}) is in none of the seasons{cure}", set.key);
            return Err(settings.fault("imaging.seasons", &problem));
        }
    }
    match windows.iter().position(|window| !times.iter().any(|time| is_within(&[*window], *time))) {
        Some(k) => Err(settings.fault(&format!("imaging.seasons[{k}]"), "there is no profile in it")),
        None => Ok(of_windows(star, windows, &times)),
    }
}

/// Those of the seasons of all data sets in which a `set` has profiles, by the times of these.
pub(super) fn as_parted(set: &DataSetSettings, part: &Observations, all: &[Season]) -> Vec<Season> {
    let windows: Vec<[f64; 2]> = all.iter().map(|season| [season.first_d, season.last_d]).collect();
    of_windows(&set.star, &windows, &times_d(std::slice::from_ref(part)))
}

/// All times (d) in their order.
fn times_d(parts: &[Observations]) -> Vec<f64> {
    let mut times: Vec<f64> = parts.iter().flat_map(Observations::times_d).collect();
    times.sort_by(f64::total_cmp);
    times
}

/// The season of each window that holds one of these times (d), which rise.
fn of_windows(star: &StarSettings, windows: &[[f64; 2]], times: &[f64]) -> Vec<Season> {
    let of_window = |window: &[f64; 2]| {
        let of: Vec<f64> = times.iter().copied().filter(|time| is_within(&[*window], *time)).collect();
        (!of.is_empty()).then(|| season(star, &of))
    };
    windows.iter().filter_map(of_window).collect()
}

/// The season of profiles at these times (d), which rise.
fn season(star: &StarSettings, times: &[f64]) -> Season {
    let (first_d, last_d) = (times[0], times[times.len() - 1]);
    let cycles = star.cycle(0.5 * (first_d + last_d)).round();
    Season { first_d, last_d, profiles: times.len(), epoch_d: star.epoch_d + cycles * star.rotation_period_d }
}

/// The imager of the observations with one map per season.
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
