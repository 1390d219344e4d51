//! Windows of time in a config, and the seasons of a star that does not change.

use super::ImagingSettings;
use super::domain::{check_size, most};
use super::error::Fault;
use crate::surface::objective::ObjectiveKind;

/// What tells the seasons apart.
pub(super) fn check_seasons(imaging: &ImagingSettings) -> Result<(), Fault> {
    const GAP: &str = "imaging.season_gap_d";
    let ImagingSettings { season_gap_d: gap, seasons, objective, .. } = imaging;
    let given = [(gap.is_some(), GAP), (!seasons.is_empty(), "imaging.seasons")].map(|(is, key)| is.then_some(key));
    match (given, *objective) {
        ([Some(key), _] | [None, Some(key)], ObjectiveKind::MarginalLikelihood) => {
            let problem = "leave it out: with imaging.objective \"marginal-likelihood\", the default, spots change \
                           all the time; for a map of each season give the objective \"spottedness\"";
            return Err(Fault::new(key, problem));
        }
        ([Some(_), Some(key)], _) => return Err(Fault::new(key, "stands in place of season_gap_d: give one of them")),
        _ => {}
    }
    if let Some(gap) = gap.filter(|gap| gap.is_nan() || *gap <= 0.0) {
        return Err(Fault::new(GAP, format!("{gap} must be above 0")));
    }
    check_windows(seasons, "imaging.seasons")?;
    match seasons.windows(2).position(|two| two[1][0] <= two[0][1]) {
        None => Ok(()),
        Some(k) => {
            let [[_, end], [start, _]] = [seasons[k], seasons[k + 1]];
            let problem = format!("begins at {start} d, and imaging.seasons[{k}] ends only at {end} d");
            Err(Fault::new(format!("imaging.seasons[{}]", k + 1), problem))
        }
    }
}

/// Windows of time `[start, end]` (d) that stand at `key`.
pub(super) fn check_windows(windows: &[[f64; 2]], key: &str) -> Result<(), Fault> {
    for (k, [start, end]) in windows.iter().enumerate() {
        let key = format!("{key}[{k}]");
        check_size(&key, *start, most::TIME)?;
        check_size(&key, *end, most::TIME)?;
        if start >= end {
            return Err(Fault::new(key, format!("the start {start} must be before the end {end}")));
        }
    }
    Ok(())
}
