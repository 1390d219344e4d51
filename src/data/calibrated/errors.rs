//! Quantities that a config leaves to the profiles, measured first: their uncertainties and their RV jitter.

use super::imager::imager;
use super::seasons;
use crate::data::config::{ConfigError, DataSetSettings, ObservationSource, Settings, VelocityJitter};
use crate::data::io::provenance::Season;
use crate::star::observation::Observations;
use crate::surface::calibration::jitter::{JitterError, MeasuredJitter, ZeroPoints};
use crate::surface::calibration::noise;
use crate::surface::calibration::noise::{ErrorSettings, MeasuredErrors, NoiseError};
use crate::surface::imaging::Imager;

/// The RV jitter of the profiles, if any, and its measured size where it is fitted. The target chi2 is per datum,
/// independent or not.
pub(super) fn zero_points(
    settings: &Settings,
    imager: &Imager,
    jitter: VelocityJitter,
    chi2_target: f64,
) -> Result<(Option<ZeroPoints>, Option<MeasuredJitter>), ConfigError> {
    let fault = |e: JitterError| settings.fault("observations.velocity_jitter_kms", &e.to_string());
    let (sd_kms, measured) = match jitter {
        VelocityJitter::Number(0.0) => return Ok((None, None)),
        // it is included with the maps
        _ if settings.imaging.objective.properties().marginalises => return Ok((None, None)),
        VelocityJitter::Number(sd_kms) => (sd_kms, None),
        VelocityJitter::Word(_) => {
            let measured = MeasuredJitter::of(imager, settings.values, chi2_target).map_err(fault)?;
            (measured.value_kms, Some(measured))
        }
    };
    let zero_points = ZeroPoints::new(imager, settings.values, chi2_target, sd_kms).map_err(|e| fault(e.into()))?;
    Ok((Some(zero_points), measured))
}

/// Uncertainties and RV jitter are measured in turn at most this many times, until uncertainties change by less than
/// this fraction.
const SETTLED: (usize, f64) = (3, 0.03);

/// The uncertainties that the config leaves to the profiles of a `set`, if it does: `whole` profiles as in their files,
/// and `used` ones as they enter the model, with quoted uncertainties. There is one map per season in `seasons` of all
/// sets.
pub(super) fn measured(
    settings: &Settings,
    set: &DataSetSettings,
    whole: &Observations,
    used: &Observations,
    all_seasons: &[Season],
) -> Result<Option<MeasuredErrors>, ConfigError> {
    let wanted = match set.source {
        ObservationSource::Files { errors, .. } if errors != ErrorSettings::default() => errors,
        _ => return Ok(None),
    };
    let fault = |e: NoiseError| settings.fault(&e.key().replacen("observations", &set.key, 1), &e.to_string());
    let whole = whole.clone().over_continuum(set.continuum_level());
    let continuum = noise::by_continuum(&whole, &set.star, &settings.values, wanted).map_err(fault)?;
    // residuals of a map are not noise where spots may evolve
    if !wanted.measured || settings.imaging.objective.properties().map_changes {
        return Ok(Some(continuum));
    }
    let seasons = seasons::as_parted(set, used, all_seasons);
    let imager = |part: Observations| imager(settings, std::slice::from_ref(set), &[part], &seasons);
    let scaled = |measured: &MeasuredErrors| {
        let mut observations = used.clone();
        measured.apply(&mut observations);
        observations
    };
    let before = scaled(&continuum);
    let mut measured = continuum.clone();
    for _ in 0..SETTLED.0 {
        // RV offsets of profiles appear as residuals of a map without jitter, and underestimated uncertainties look
        // like RV jitter
        let zero_points = match settings.imaging.chi2_target.number() {
            Some(target) => {
                let target = target / continuum.correlated_bins;
                zero_points(settings, &imager(scaled(&measured))?, settings.velocity_jitter, target)?.0
            }
            // a given one depends on velocities: the config has no RV jitter with it
            None => None,
        };
        let with_factor = |factor: f64| {
            let mut observations = before.clone();
            observations.profiles.iter_mut().flat_map(|p| &mut p.sigma).for_each(|sigma| *sigma *= factor);
            let imager = imager(observations)?;
            Ok(zero_points.iter().fold(imager, |imager, zero_points| zero_points.counted_in(imager)))
        };
        let then = std::mem::replace(&mut measured, continuum.clone()).sigma_scale.unwrap_or(1.0);
        measured.count_residuals(settings.values, with_factor)?.map_err(fault)?;
        let moved = (measured.sigma_scale.unwrap_or(1.0) / then).ln().abs();
        if !settings.velocity_jitter.is_word() || moved < SETTLED.1 {
            break;
        }
    }
    Ok(Some(measured))
}
