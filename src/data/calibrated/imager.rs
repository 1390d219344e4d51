//! From a config and the observations of its data sets to their imager, with the RV offsets of the sets at their
//! values.

use super::seasons::with_seasons;
use super::strength::star_for;
use crate::data::config::{ConfigError, DataSetSettings, Settings, VelocityDrift, ZeroPoint};
use crate::data::io::provenance::Season;
use crate::numerics::units::SECONDS_PER_DAY;
use crate::planets::periodogram::{Frequencies, FrequencySettings};
use crate::star::observation::{Observations, Profile};
use crate::star::{Sampling, Seen, StarSettings};
use crate::surface::calibration::offsets;
use crate::surface::calibration::offsets::HeldZeroPoint;
use crate::surface::calibration::star::too_wide_kms;
use crate::surface::expansion::nuisances;
use crate::surface::imaging::{Imager, ZeroPointPrior};

/// The imager of the observations `parts` of these data `sets`, with a map for each of the `seasons`. An offset to be
/// fitted is at 0.
///
/// # Errors
/// Settings that are invalid for these observations.
pub fn imager(
    settings: &Settings,
    sets: &[DataSetSettings],
    parts: &[Observations],
    seasons: &[Season],
) -> Result<Imager, ConfigError> {
    let mut stars = Vec::new();
    for (set, part) in sets.iter().zip(parts) {
        settings.check_velocity_grid(&set.star, &settings.values, part.step_kms())?;
        stars.push(star_for(settings, set, part)?);
    }
    let star = stars[0].clone();
    let seen = |((own, set), part): ((&StarSettings, &DataSetSettings), &Observations)| Seen {
        line: Some(own.line).filter(|line| *line != star.line),
        contrast: Some(own.contrast).filter(|contrast| *contrast != star.contrast || set.fits_contrast),
        limb_darkening: set.limb_darkening,
        regions: set.regions,
        sampling: Sampling::of(part),
        own_maps: Vec::new(),
        exposures: Vec::new(),
    };
    let mut seen: Vec<Seen> = stars.iter().zip(sets).zip(parts).map(seen).collect();
    for (set, part) in seen.iter_mut().zip(parts) {
        let length_d = |profile: &Profile| profile.exposure_s.map_or(0.0, |seconds| seconds / SECONDS_PER_DAY);
        let lengths_d: Vec<f64> = part.profiles.iter().map(length_d).collect();
        set.exposures = set.exposures(&star, &settings.values.state(), &lengths_d);
    }
    let all = Observations::joined(parts.to_vec());
    let imager = Imager::of_sets(star, seen, &all, settings.imaging.pixels, settings.imaging.entropy());
    if let Some(fwhm_kms) = too_wide_kms(&imager, &imager.star) {
        let problem = format!("the line of active regions, {fwhm_kms:.0} km/s wide, exceeds the velocity range");
        return Err(settings.fault("star.regions.line_width", &problem));
    }
    let mut imager = with_seasons(imager, seasons);
    if sets.iter().any(|set| set.nuisances.is_some()) {
        let priors = sets.iter().map(|set| set.nuisances.unwrap_or_default());
        imager = imager.with_nuisances_of(&priors.zip(parts).collect::<Vec<_>>());
    }
    for (set, DataSetSettings { zero_point, .. }) in sets.iter().enumerate() {
        match *zero_point {
            ZeroPoint::Number(0.0) => {}
            ZeroPoint::Number(kms) => imager.move_set(set, kms),
            ZeroPoint::Word(_) => {
                imager.zero_points.push(ZeroPointPrior { set, mean_kms: 0.0, sd_kms: offsets::PRIOR_KMS });
            }
        }
    }
    if sets.iter().any(|set| set.jitter_share != 1.0) {
        imager.jitter_shares = sets.iter().map(|set| set.jitter_share).collect();
    }
    if sets.iter().any(|set| set.night_jitter_kms.is_some()) {
        imager.night_jitters_kms = sets.iter().map(|set| set.night_jitter_kms).collect();
    }
    Ok(match settings.drift {
        None | Some(VelocityDrift::None) => imager,
        Some(drift) => imager.with_drifts(drift == VelocityDrift::Quadratic),
    })
}

/// Fits the free RV offsets of data sets, and sets them in `imager`.
pub(super) fn hold_offsets(
    settings: &Settings,
    imager: &mut Imager,
    suspects: &str,
) -> Result<Vec<HeldZeroPoint>, ConfigError> {
    let Some(first) = imager.zero_points.first().map(|prior| prior.set) else { return Ok(Vec::new()) };
    let usual = FrequencySettings::default();
    let frequencies = Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, usual).ok();
    let nuisances = nuisances(&settings.free);
    offsets::hold(imager, settings.values, &nuisances, settings.known_field(), frequencies.as_ref()).map_err(|e| {
        let set = &settings.sets[first].key;
        let problem = format!("no spots fit the profiles, so that the RV offset of {set} cannot be found: {e}");
        settings.fault("observations", &format!("{problem}{suspects}"))
    })
}
