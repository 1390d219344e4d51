//! From a config and the observations of its data sets to what they are imaged with, the zero points of the sets held
//! where they belong.

use super::light_curves;
use super::seasons::{seasons, with_seasons};
use crate::data::config::{ConfigError, DataSetSettings, Settings, ZeroPoint};
use crate::planets::periodogram::{Frequencies, FrequencySettings};
use crate::star::observation::Observations;
use crate::star::{Sampling, Seen, StarSettings};
use crate::surface::calibration::offsets;
use crate::surface::imaging::{Imager, ZeroPointPrior};

/// What the observations of all data sets are imaged with.
///
/// # Errors
/// Settings that make no sense with these observations.
pub fn imager(settings: &Settings, parts: &[Observations]) -> Result<Imager, ConfigError> {
    let mut stars = Vec::new();
    for (set, part) in settings.sets.iter().zip(parts) {
        settings.check_velocity_grid(&set.star, &settings.values, part.step_kms())?;
        stars.push(settings.star_for(set, part)?);
    }
    let star = stars[0].clone();
    let seen = |(own, part): (&StarSettings, &Observations)| Seen {
        line: Some(own.line).filter(|line| *line != star.line),
        contrast: Some(own.contrast).filter(|contrast| *contrast != star.contrast),
        sampling: Sampling::of(part),
        own_maps: Vec::new(),
    };
    let sets: Vec<Seen> = stars.iter().zip(parts).map(seen).collect();
    let all = Observations { profiles: parts.iter().flat_map(|part| part.profiles.iter().cloned()).collect() };
    let imager = Imager::of_sets(star, sets, &all, settings.imaging.pixels, settings.imaging.entropy());
    let mut imager = with_seasons(imager, &seasons(settings, parts)?);
    if settings.sets.iter().any(|set| set.nuisances.is_some()) {
        let priors = settings.sets.iter().map(|set| set.nuisances.unwrap_or_default());
        imager = imager.with_nuisances_of(&priors.zip(parts).collect::<Vec<_>>());
    }
    imager.light_curves = light_curves::near(settings, &all)?;
    for (s, set) in settings.sets.iter().enumerate() {
        match set.zero_point {
            ZeroPoint::Known(0.0) => {}
            ZeroPoint::Known(kms) => imager.move_set(s, kms),
            ZeroPoint::Fitted => {
                let held = set.held.map_or(0.0, |held| held.value_kms);
                let prior = ZeroPointPrior { set: s, mean_kms: 0.0, sd_kms: offsets::PRIOR_KMS };
                imager.zero_points.push(prior);
                imager.move_zero_point(imager.zero_points.len() - 1, held);
            }
        }
    }
    Ok(imager)
}

/// Finds the zero points of data sets that are fitted, if they are not known yet, and holds them in `imager`.
pub(super) fn hold_zero_points(settings: &mut Settings, imager: &mut Imager) -> Result<(), ConfigError> {
    let unknown = |set: &&mut DataSetSettings| set.zero_point == ZeroPoint::Fitted;
    if imager.zero_points.is_empty() || settings.sets.iter().any(|set| set.held.is_some()) {
        return Ok(());
    }
    let usual = FrequencySettings::default();
    let frequencies = Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, usual).ok();
    let first = imager.zero_points[0].set;
    let held = offsets::hold(imager, settings.values, settings.known_field(), frequencies.as_ref())
        .map_err(|e| settings.fault(&format!("{}.zero_point_kms", settings.sets[first].key), &e.to_string()))?;
    for (set, held) in settings.sets.iter_mut().filter(unknown).zip(held) {
        set.held = Some(held);
    }
    Ok(())
}
