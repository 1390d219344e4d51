//! What a config leaves to the profiles, measured before anything else: their errors, and the scatter of their velocity
//! zero points.

use super::imager;
use crate::data::config::{ConfigError, DataSetSettings, Settings, VelocityJitter};
use crate::star::observation::Observations;
use crate::surface::ObjectiveKind;
use crate::surface::calibration::jitter::{JitterError, MeasuredJitter, ZeroPoints};
use crate::surface::calibration::noise;
use crate::surface::calibration::noise::{ErrorSettings, MeasuredErrors, NoiseError};
use crate::surface::imaging::Imager;

/// The velocity zero points of the config, where there are any, and how large they are where the profiles say so. The
/// target chi2 is per datum, independent or not.
pub(super) fn zero_points(
    settings: &Settings,
    imager: &Imager,
    chi2_target: f64,
) -> Result<(Option<ZeroPoints>, Option<MeasuredJitter>), ConfigError> {
    let fault = |e: JitterError| settings.fault("observations.velocity_jitter_kms", &e.to_string());
    let (sd_kms, measured) = match settings.velocity_jitter {
        VelocityJitter::Known(0.0) => return Ok((None, None)),
        // it is counted with the field
        _ if settings.imaging.objective == ObjectiveKind::MarginalLikelihood => return Ok((None, None)),
        VelocityJitter::Known(sd_kms) => (sd_kms, None),
        VelocityJitter::Fitted => {
            let measured = MeasuredJitter::of(imager, settings.values, chi2_target).map_err(fault)?;
            (measured.value_kms, Some(measured))
        }
    };
    let zero_points = ZeroPoints::new(imager, settings.values, chi2_target, sd_kms).map_err(|e| fault(e.into()))?;
    Ok((Some(zero_points), measured))
}

/// Errors and velocity zero points are settled in turn that many times at most, until errors move by less than this
/// part.
const SETTLED: (usize, f64) = (3, 0.03);

/// The errors that the observations of a `set`, `cut` as they are used, and the `whole` profiles ask for.
pub(super) fn measured_errors(
    settings: &Settings,
    set: &DataSetSettings,
    wanted: ErrorSettings,
    whole: &Observations,
    cut: &Observations,
) -> Result<MeasuredErrors, ConfigError> {
    let fault = |e: NoiseError| settings.fault(&e.key().replacen("observations", &set.key, 1), &e.to_string());
    let scaled = |measured: &MeasuredErrors| {
        let mut observations = cut.clone();
        measured.apply(&mut observations);
        observations
    };
    let continuum = noise::by_continuum(whole, &set.star, &settings.values, wanted).map_err(fault)?;
    // what a map leaves over is no noise where stars may change
    if !wanted.measured || settings.imaging.objective == ObjectiveKind::MarginalLikelihood {
        return Ok(continuum);
    }
    let alone = &Settings { sets: vec![set.clone()], ..settings.clone() };
    let before = scaled(&continuum);
    let chi2_target = settings.imaging.chi2_target.value() / continuum.correlated_bins;
    let mut measured = continuum.clone();
    for _ in 0..SETTLED.0 {
        // a map that knows nothing of zero points leaves them over, and errors that are too small look like zero points
        let (zero_points, _) = zero_points(alone, &imager(alone, &[scaled(&measured)])?, chi2_target)?;
        let with_factor = |factor: f64| {
            let mut observations = before.clone();
            observations.profiles.iter_mut().flat_map(|p| &mut p.sigma).for_each(|sigma| *sigma *= factor);
            let imager = imager(alone, &[observations])?;
            Ok(zero_points.iter().fold(imager, |imager, zero_points| zero_points.counted_in(imager)))
        };
        let then = std::mem::replace(&mut measured, continuum.clone()).sigma_scale.unwrap_or(1.0);
        measured.count_residuals(settings.values, with_factor)?.map_err(fault)?;
        let moved = (measured.sigma_scale.unwrap_or(1.0) / then).ln().abs();
        if settings.velocity_jitter != VelocityJitter::Fitted || moved < SETTLED.1 {
            break;
        }
    }
    Ok(measured)
}
