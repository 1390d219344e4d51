//! Where the profiles come from: files, or a simulation of the config's own star and planet.

use super::domain::{check_size, check_value, most};
use super::error::Fault;
use super::raw_parts::{ObservationsSection, SimulateSection, VelocitySection};
use super::resolve::{automatic, check_nuisances, check_pixels, positive};
use super::resolve_simulation::{facula, spots, times_d};
use super::{Automatic, ObservationSource, VelocityJitter};
use crate::data::simulate::Simulation;
use crate::model::{Clock, Elements, ParameterValues};
use crate::star::StarSettings;
use crate::surface::nuisances::LineAndContinuum;
use crate::surface::static_map::noise::ErrorSettings;
use std::path::Path;

/// Levels of a continuum that profiles may be divided by: beyond, they are not in units of it at all.
const CONTINUUM_LEVELS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Resolves the data set at `key`; fills the default of its `sigma_scale`. `config` is the config's path, whose folder
/// paths start from.
pub(super) fn resolve_observations(
    section: &mut ObservationsSection,
    key: &str,
    star: &StarSettings,
    values: &ParameterValues,
    config: &Path,
) -> Result<ObservationSource, Fault> {
    let at = |field: &str| format!("{key}.{field}");
    if let Some(VelocityJitter::Number(kms)) = section.velocity_jitter_kms {
        check_jitter(&at("velocity_jitter_kms"), kms)?;
    }
    let path = match (&section.path, &section.simulate) {
        (Some(path), None) => path,
        (None, Some(simulate)) => {
            let file_only = [
                ("velocity_range_kms", section.velocity_range_kms.is_some()),
                ("sigma_scale", section.sigma_scale.is_some()),
                ("continuum_level", section.continuum_level.is_some()),
                ("weights", !section.weights.is_default()),
                ("exclude", !section.exclude.is_empty()),
            ];
            if let Some((name, _)) = file_only.iter().find(|(_, given)| *given) {
                return Err(Fault::new(at(name), "for observations from files only"));
            }
            if star.line.equivalent_width_kms.is_nan() {
                return Err(Fault::new("star.line.equivalent_width_kms", "auto is for observations from files only"));
            }
            return Ok(ObservationSource::Simulate(simulation(simulate, star, values, key)?));
        }
        (Some(_), Some(_)) => return Err(Fault::new(key, "give either path or simulate, not both")),
        (None, None) => return Err(Fault::new(key, "give path (of the list of profiles) or simulate")),
    };
    if path.as_os_str().is_empty() {
        return Err(Fault::new(at("path"), "is empty"));
    }
    let sigma_scale = *section.sigma_scale.get_or_insert(Automatic::Number(1.0));
    automatic(&at("sigma_scale"), sigma_scale)?;
    let errors = ErrorSettings { measured: sigma_scale.is_word(), weights: section.weights };
    let sigma_scale = sigma_scale.number().unwrap_or(1.0);
    for end in section.velocity_range_kms.into_iter().flatten() {
        check_size(&at("velocity_range_kms"), end, most::VELOCITY_KMS)?;
    }
    let continuum_level = section.continuum_level.unwrap_or(1.0);
    if !CONTINUUM_LEVELS.contains(&continuum_level) {
        let (min, max) = (CONTINUUM_LEVELS.start(), CONTINUUM_LEVELS.end());
        let problem = format!("{continuum_level} must be from {min} to {max}");
        return Err(Fault::new(at("continuum_level"), problem));
    }
    if let Some([min, max]) = section.velocity_range_kms
        && min >= max
    {
        let problem = format!("first velocity {min} must be below last velocity {max}");
        return Err(Fault::new(at("velocity_range_kms"), problem));
    }
    let velocity_range_kms = section.velocity_range_kms.map(Into::into);
    let path = config.parent().unwrap_or(Path::new("")).join(path);
    Ok(ObservationSource::Files { path, velocity_range_kms, sigma_scale, continuum_level, errors })
}

fn simulation(
    section: &SimulateSection,
    star: &StarSettings,
    values: &ParameterValues,
    set: &str,
) -> Result<Simulation, Fault> {
    let at = |field: &str| format!("{set}.simulate.{field}");
    let faculae = section.faculae.iter().enumerate().map(|(k, f)| facula(f, &at(&format!("faculae[{k}]"))));
    let times_d = times_d(section, star, set)?;
    if let Some(snr) = section.snr {
        positive(&at("snr"), snr)?;
    }
    check_pixels(&at("pixels"), section.pixels)?;
    let continuum = section
        .continuum
        .map_or(LineAndContinuum::default(), |c| LineAndContinuum::of_numbers([c.offset, c.slope, c.equivalent_width]));
    check_nuisances(&continuum, ["offset", "slope", "equivalent_width"].map(|name| at(&format!("continuum.{name}"))))?;
    check_jitter(&at("velocity_jitter_kms"), section.velocity_jitter_kms)?;
    if section.zero_point_kms.is_nan() || section.zero_point_kms.abs() > LARGEST_JITTER_KMS {
        let problem =
            format!("{} must be from -{LARGEST_JITTER_KMS} to {LARGEST_JITTER_KMS} km/s", section.zero_point_kms);
        return Err(Fault::new(at("zero_point_kms"), problem));
    }
    if !(section.correlated_bins >= 1.0 && section.correlated_bins <= MOST_CORRELATED_BINS) {
        let problem = format!("{} must be from 1 (white noise) to {MOST_CORRELATED_BINS}", section.correlated_bins);
        return Err(Fault::new(at("correlated_bins"), problem));
    }
    let mut truth = *values;
    for (parameter, value) in section.truth.entries() {
        check_value(parameter, value, &at(&format!("truth.{}", parameter.name())))?;
    }
    let clock = Clock { rotation_period_d: star.rotation_period_d, epoch_d: star.epoch_d };
    Elements::write(&mut truth, section.truth.entries().into_iter(), clock);
    if truth.motion().orbits().any(|planet| !(planet.shape.eccentricity() < 1.0 && planet.orbit.porb_over_prot > 0.0)) {
        return Err(Fault::new(at("truth"), "is no orbit: each planet needs a period, and an eccentricity below 1"));
    }
    Ok(Simulation {
        spots: spots(section, star, &truth, &times_d, set)?,
        faculae: faculae.collect::<Result<_, _>>()?,
        truth,
        times_d,
        first_velocity_kms: section.velocity_kms.min,
        step_kms: section.velocity_kms.step,
        bins: bins(&section.velocity_kms, &at("velocity_kms"))?,
        snr: section.snr,
        seed: section.seed,
        pixels: section.pixels,
        continuum,
        velocity_jitter_kms: section.velocity_jitter_kms,
        zero_point_kms: section.zero_point_kms,
        correlated_bins: section.correlated_bins,
    })
}

/// Noise that is correlated over more bins is a mistake.
const MOST_CORRELATED_BINS: f64 = 1000.0;

/// Velocity zero points that scatter by more (km/s) are a mistake: profiles would be seen as the wrong part of a line.
const LARGEST_JITTER_KMS: f64 = 100.0;

fn check_jitter(key: &str, kms: f64) -> Result<(), Fault> {
    match (0.0..=LARGEST_JITTER_KMS).contains(&kms) {
        true => Ok(()),
        false => Err(Fault::new(key, format!("{kms} must be from 0 to {LARGEST_JITTER_KMS} km/s"))),
    }
}

/// Number of velocity bins; the last lies at or below `max`.
fn bins(axis: &VelocitySection, key: &str) -> Result<usize, Fault> {
    const LEAST: f64 = 5.0;
    const MOST: f64 = 100_000.0;
    positive(&format!("{key}.step"), axis.step)?;
    check_size(&format!("{key}.min"), axis.min, most::VELOCITY_KMS)?;
    check_size(&format!("{key}.max"), axis.max, most::VELOCITY_KMS)?;
    if axis.min >= axis.max {
        return Err(Fault::new(format!("{key}.min"), format!("{} must be below max, which is {}", axis.min, axis.max)));
    }
    // Where max is meant to be a bin, rounding must not lose it.
    let bins = ((axis.max - axis.min) / axis.step + 1e-6).floor() + 1.0;
    if !(LEAST..=MOST).contains(&bins) {
        return Err(Fault::new(format!("{key}.step"), format!("makes {bins} bins, they must be {LEAST} to {MOST}")));
    }
    Ok(bins as usize)
}
