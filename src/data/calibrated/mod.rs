//! From observations as read from their files to a new value for the model: profiles within the velocity range and in
//! units of their continua, uncertainties scaled or measured, light curves in bins, a map for each season; and the
//! quantities then measured on them: target chi2, RV jitter, RV offsets of data sets.

mod errors;
mod imager;
mod indicators;
mod light_curves;
mod seasons;
mod strength;

pub use imager::imager;
pub use light_curves::with_light_curves;
pub use strength::star_for;

use crate::data::config::{Automatic, ConfigError, DataSetSettings, ObservationSource, Settings, VelocityJitter};
use crate::data::dataset::{Dataset, ProfileSet, SceneError};
use crate::data::ephemeris;
use crate::data::io::lsd::{self, LsdError};
use crate::data::io::provenance::{Measured, MeasuredSet};
use crate::model::Parameter;
use crate::star::observation::Observations;
use crate::surface::calibration::noise::MeasuredErrors;
use crate::surface::calibration::target;
use crate::surface::calibration::target::ChosenTarget;
use crate::surface::imaging::Imager;
use crate::surface::photometry::{Flux, LightCurve};
use light_curves::Binned;
use sha2::{Digest, Sha256};

/// Observations as they enter the model.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The profiles; of several data sets one after the other.
    pub observations: Observations,
    /// SHA-256 (hex): of the bytes of their files where these are used, else of the numbers.
    pub sha256: String,
    /// What was measured on them.
    pub measured: Measured,
    /// Target chi2 per datum, adjusted for noise that is correlated between bins; measured where the config leaves it
    /// to the observations.
    pub chi2_target: f64,
    /// Their imager; indicators are added once they are fitted.
    pub imager: Imager,
    /// The values of each indicator, in the order of time.
    pub indicators: Vec<Vec<Flux>>,
}

impl Calibrated {
    /// The observations of `data` prepared according to `settings`.
    ///
    /// # Errors
    /// Settings that are invalid for these observations.
    pub fn of(settings: &Settings, data: &Dataset) -> Result<Self, SceneError> {
        let light_curves = light_curves::binned(settings, &data.light_curves)?;
        let sets = || settings.sets.iter().zip(&data.sets);
        let mut parts = sets().map(|(set, profiles)| used(set, profiles)).collect::<Result<Vec<_>, _>>()?;
        // uncertainties are measured on residuals of maps, and a map is of one season of all sets
        let seasons = seasons::seasons(settings, &parts)?;
        let (mut errors, mut hashes) = (Vec::new(), Vec::new());
        for ((set, profiles), part) in sets().zip(&mut parts) {
            let measured = errors::measured(settings, set, &profiles.observations, part, &seasons)?;
            measured.iter().for_each(|measured| measured.apply(part));
            // velocity range and factor are part of the fingerprint of the config
            let of_files = profiles.sha256.clone().filter(|_| measured.is_none() && set.continuum_level() == 1.0);
            hashes.push(of_files.unwrap_or_else(|| fingerprint(part)));
            errors.push(measured);
        }
        let sha256 = match &hashes[..] {
            [one] => one.clone(),
            several => format!("{:x}", Sha256::digest(several.concat())),
        };
        ephemeris::check(settings, &parts)?;
        let mut imager = imager(settings, &settings.sets, &parts, &seasons)?;
        imager.light_curves = light_curves::near(settings, &parts, &light_curves)?;
        imager.data.correlated_bins = correlated_bins(&parts, &errors);
        let (chi2_target, chosen) = chi2_target(settings, &imager)?;
        let (zero_points, velocity_jitter) =
            errors::zero_points(settings, &imager, settings.velocity_jitter, chi2_target)?;
        let mut imager = zero_points.iter().fold(imager, |imager, points| points.counted_in(imager));
        let mut remarks = remarks(settings, data);
        remarks.extend(cut_lines(settings, &parts));
        let mut held = imager::hold_offsets(settings, &mut imager, &suspects(&remarks))?.into_iter();
        let (indicators, indicator_notes) = indicators::used(settings, &parts, &data.indicators)?;
        let mut measured = Measured {
            profiles: remarks,
            indicator_notes,
            velocity_jitter,
            seasons: if seasons.len() > 1 { seasons } else { Vec::new() },
            light_curves: light_curves.iter().map(Binned::line).collect(),
            light_curve_notes: light_curves.iter().flat_map(Binned::notes).cloned().collect(),
            chi2_target: chosen,
            ..Measured::default()
        };
        match settings.sets.len() {
            1 => measured.errors = errors.into_iter().next().flatten(),
            _ => {
                let of_set = |((set, part), errors): ((&DataSetSettings, &Observations), _)| MeasuredSet {
                    name: set.name.clone(),
                    profiles: part.profiles.len(),
                    errors,
                    zero_point: if set.zero_point.is_word() { held.next() } else { None },
                    contrast: None,
                };
                measured.sets = settings.sets.iter().zip(&parts).zip(errors).map(of_set).collect();
            }
        }
        let sha256 = indicators::fingerprint(with_light_curves(sha256, &imager.light_curves), &indicators);
        let observations = Observations::joined(parts);
        Ok(Calibrated { observations, sha256, measured, chi2_target, imager, indicators })
    }

    /// The same with other profiles of each data set than those used for measurement: target chi2, RV jitter and RV
    /// offsets of data sets are kept.
    ///
    /// # Errors
    /// Profiles that are invalid.
    pub fn of_others(self, settings: &Settings, parts: Vec<Observations>) -> Result<Self, ConfigError> {
        let mut imager = imager(settings, &settings.sets, &parts, &self.measured.seasons)?;
        imager.light_curves = self.imager.light_curves;
        imager.indicators = self.imager.indicators;
        imager.data.correlated_bins = self.imager.data.correlated_bins;
        let jitter = self.measured.velocity_jitter.as_ref().map(|measured| VelocityJitter::Number(measured.value_kms));
        let jitter = jitter.unwrap_or(settings.velocity_jitter);
        let (zero_points, _) = errors::zero_points(settings, &imager, jitter, self.chi2_target)?;
        let mut imager = zero_points.iter().fold(imager, |imager, points| points.counted_in(imager));
        let held = self.measured.sets.iter().filter_map(|set| set.zero_point);
        held.enumerate().for_each(|(z, held)| imager.move_zero_point(z, held.held_kms));
        let observations = Observations::joined(parts);
        Ok(Calibrated { sha256: fingerprint(&observations), observations, imager, ..self })
    }
}

/// The light curves of `data`, together with profiles of these `parts`.
///
/// # Errors
/// A light curve without remaining measurements, or too far in time to constrain the spots of these profiles.
pub fn light_curves(
    settings: &Settings,
    data: &Dataset,
    parts: &[Observations],
) -> Result<Vec<LightCurve>, ConfigError> {
    light_curves::near(settings, parts, &light_curves::binned(settings, &data.light_curves)?)
}

/// The profiles of each data set that `imager` contains.
pub fn of_sets(imager: &Imager, observations: &Observations) -> Vec<Observations> {
    let part = |set: std::ops::Range<usize>| Observations { profiles: observations.profiles[set].to_vec() };
    imager.profiles_of_sets().into_iter().map(part).collect()
}

/// The profiles of a `set` within its velocity range, in units of their continuum, uncertainties times the factor of
/// the config, with its exposure time where they have none.
fn used(set: &DataSetSettings, profiles: &ProfileSet) -> Result<Observations, LsdError> {
    let mut used = match set.source {
        ObservationSource::Files { velocity_range_kms, sigma_scale, continuum_level, .. } => {
            let observations = profiles.within(velocity_range_kms, sigma_scale)?;
            if continuum_level == 1.0 { observations } else { observations.over_continuum(continuum_level) }
        }
        ObservationSource::Simulate(_) => profiles.observations.clone(),
    };
    used.profiles.iter_mut().for_each(|profile| profile.exposure_s = profile.exposure_s.or(set.exposure_s));
    Ok(used)
}

/// Remarks on the files for readers of results.
fn remarks(settings: &Settings, data: &Dataset) -> Vec<String> {
    let several = settings.sets.len() > 1;
    let of_set = |(set, profiles): (&DataSetSettings, &ProfileSet)| {
        let of = |remark: &String| if several { format!("{}: {remark}", set.name) } else { remark.clone() };
        profiles.remarks.iter().map(of).collect::<Vec<_>>()
    };
    settings.sets.iter().zip(&data.sets).flat_map(of_set).collect()
}

/// That the velocities in use end within the line of the star, of each data set.
fn cut_lines(settings: &Settings, parts: &[Observations]) -> Vec<String> {
    let [vsys_kms, vsini_kms] = [Parameter::Vsys, Parameter::Vsini].map(|parameter| settings.values[parameter]);
    let of = |(set, part): (&DataSetSettings, &Observations)| {
        let profile = part.profiles.first()?;
        let from = profile.first_velocity_kms;
        let to = from + profile.intensity.len().saturating_sub(1) as f64 * profile.step_kms;
        let cuts = (vsys_kms - from).min(to - vsys_kms) < vsini_kms;
        let name = if settings.sets.len() > 1 { format!("{}: ", set.name) } else { String::new() };
        cuts.then(|| {
            format!(
                "{name}the velocities in use, {from:.0} to {to:.0} km/s, end within the line (vsini {vsini_kms:.0} \
                km/s): line, vsini and limb darkening are poorly constrained; use a wider velocity range"
            )
        })
    };
    settings.sets.iter().zip(parts).filter_map(of).collect()
}

/// Those `remarks` on profiles that may explain a bad fit, each after `; `.
pub fn suspects(remarks: &[String]) -> String {
    remarks.iter().filter(|remark| lsd::tells_of_wild_bin(remark)).map(|remark| format!("; {remark}")).collect()
}

/// The target chi2 per datum, and how it was chosen where the config leaves it to the observations. That of the config
/// is per independent datum.
fn chi2_target(settings: &Settings, imager: &Imager) -> Result<(f64, Option<ChosenTarget>), ConfigError> {
    let correlated_bins = imager.data.correlated_bins;
    match settings.imaging.chi2_target {
        Automatic::Number(target) => Ok((target / correlated_bins, None)),
        Automatic::Word(_) => {
            let chosen = target::choose(imager, settings.values, correlated_bins)
                .map_err(|e| settings.fault("imaging.chi2_target", &e.to_string()))?;
            Ok((chosen.value, Some(chosen)))
        }
    }
}

/// Correlation length of the noise in bins: number of data over that of independent ones.
fn correlated_bins(parts: &[Observations], errors: &[Option<MeasuredErrors>]) -> f64 {
    let of_each: Vec<f64> = errors.iter().map(|e| e.as_ref().map_or(1.0, |e| e.correlated_bins)).collect();
    match &of_each[..] {
        [one] => *one,
        several => {
            let data = |part: &Observations| part.len() as f64;
            let independent: f64 = parts.iter().zip(several).map(|(part, bins)| data(part) / bins).sum();
            parts.iter().map(data).sum::<f64>() / independent
        }
    }
}

/// SHA-256 (hex) of the numbers of `observations`, little-endian: the first step, then for each profile time, number of
/// bins, exposure time where it is known, and velocity, intensity and sigma of each bin.
pub fn fingerprint(observations: &Observations) -> String {
    let step = observations.step_kms();
    let mut hash = Sha256::new();
    hash.update(step.to_le_bytes());
    for profile in &observations.profiles {
        hash.update(profile.time_d.to_le_bytes());
        hash.update((profile.intensity.len() as u64).to_le_bytes());
        if let Some(exposure_s) = profile.exposure_s {
            hash.update(exposure_s.to_le_bytes());
        }
        for (j, (intensity, sigma)) in profile.intensity.iter().zip(&profile.sigma).enumerate() {
            for number in [profile.velocity_kms(j), *intensity, *sigma] {
                hash.update(number.to_le_bytes());
            }
        }
    }
    format!("{:x}", hash.finalize())
}
