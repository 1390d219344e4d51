//! The light curves.

use super::checks::{check_size, check_windows, most, names, positive};
use super::star::{contrast, limb_darkening};
use crate::data::config::error::Fault;
use crate::data::config::written::{Config, OutlierTreatment, PhotometrySection, SimulatedLight};
use crate::star::Band;
use std::path::{Path, PathBuf};

/// Longest gap within a segment (d): level and slope do not persist for longer.
const LONGEST_GAP_D: f64 = 1000.0;

/// A light curve.
#[derive(Clone, Debug)]
pub struct LightCurveSettings {
    /// Its key in the config.
    pub key: String,
    /// Its name.
    pub name: String,
    /// Properties of the star that differ in its band.
    pub band: Band,
    /// Where it comes from.
    pub source: LightSource,
    /// Gaps longer than this (d) separate segments.
    pub segment_gap_d: f64,
    /// Factor on the standard errors.
    pub sigma_scale: f64,
    /// Windows `[start, end]` (d) whose measurements are left out.
    pub exclude: Vec<[f64; 2]>,
    /// Treatment of measurements that no spot explains.
    pub outliers: OutlierTreatment,
}

/// Where a light curve comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum LightSource {
    /// A table, relative to the working directory.
    File(PathBuf),
    /// The star that is simulated.
    Simulate(SimulatedLight),
}

/// Resolves the light curves of `written`. `config` is the config's path, whose folder paths start from.
pub(super) fn resolve_photometry(written: &Config, config: &Path) -> Result<Vec<LightCurveSettings>, Fault> {
    let Some(photometry) = &written.photometry else { return Ok(Vec::new()) };
    if !written.imaging.objective.properties().takes_light_curves {
        let problem = format!(
            "imaging.objective {:?} has no model of light curves: set \"marginal-likelihood\"",
            written.imaging.objective.name()
        );
        return Err(Fault::new("photometry", problem));
    }
    let sections = &photometry.sections;
    let mut curves = Vec::new();
    for (s, section) in sections.iter().enumerate() {
        let key = photometry.key(s);
        let at = |field: &str| format!("{key}.{field}");
        positive(&at("sigma_scale"), section.sigma_scale)?;
        if !(0.0..=LONGEST_GAP_D).contains(&section.segment_gap_d) {
            let problem = format!("{} must be from 0 to {LONGEST_GAP_D} d", section.segment_gap_d);
            return Err(Fault::new(at("segment_gap_d"), problem));
        }
        check_windows(&section.exclude, &at("exclude"))?;
        let usual_name = match sections.len() {
            1 => "photometry".to_owned(),
            _ => format!("photometry{}", s + 1),
        };
        curves.push(LightCurveSettings {
            name: section.name.clone().unwrap_or(usual_name),
            band: band(written, section, &key)?,
            source: source(written, section, &key, config)?,
            segment_gap_d: section.segment_gap_d,
            sigma_scale: section.sigma_scale,
            exclude: section.exclude.clone(),
            outliers: section.outliers,
            key,
        });
    }
    names(&curves.iter().map(|curve| (&*curve.key, &*curve.name)).collect::<Vec<_>>())?;
    Ok(curves)
}

/// Contrast and limb darkening where they differ from the star's.
fn band(written: &Config, section: &PhotometrySection, key: &str) -> Result<Band, Fault> {
    let mut own = written.star.clone();
    let at_key = |fault: Fault| Fault::new(format!("{key}.{}", fault.key.trim_start_matches("star.")), fault.problem);
    let contrast = match (section.contrast, section.wavelength_nm) {
        (None, None) => None,
        (Some(_), Some(_)) => {
            let problem = "give either contrast or wavelength_nm, not both";
            return Err(Fault::new(format!("{key}.wavelength_nm"), problem));
        }
        (Some(given), None) => {
            (own.contrast, own.photosphere_k, own.spot_k) = (Some(given), None, None);
            Some(contrast(&own).map_err(at_key)?)
        }
        (None, Some(_)) if own.contrast.is_some() => {
            let problem = "star.contrast does not depend on wavelength: give star.photosphere_k and .spot_k instead";
            return Err(Fault::new(format!("{key}.wavelength_nm"), problem));
        }
        (None, Some(wavelength_nm)) => {
            own.wavelength_nm = wavelength_nm;
            Some(contrast(&own).map_err(at_key)?)
        }
    };
    let limb_darkening = section.limb_darkening.as_ref().map(limb_darkening).transpose().map_err(at_key)?;
    Ok(Band { contrast, limb_darkening })
}

/// Checks a cadence (d) and an error in units of the flux; `key` is their section.
pub(super) fn check_light(key: &str, cadence_d: f64, sigma: f64) -> Result<(), Fault> {
    let [cadence, error] = ["cadence_d", "sigma"].map(|field| format!("{key}.{field}"));
    positive(&cadence, cadence_d)?;
    check_size(&cadence, cadence_d, most::TIME)?;
    positive(&error, sigma)?;
    match sigma > 1.0 {
        true => Err(Fault::new(error, format!("{sigma} must be at most 1, the flux itself"))),
        false => Ok(()),
    }
}

fn source(written: &Config, section: &PhotometrySection, key: &str, config: &Path) -> Result<LightSource, Fault> {
    let at = |field: &str| format!("{key}.{field}");
    match (&section.path, &section.simulate) {
        (Some(path), None) if path.as_os_str().is_empty() => Err(Fault::new(at("path"), "is empty")),
        (Some(path), None) => Ok(LightSource::File(config.parent().unwrap_or(Path::new("")).join(path))),
        (None, Some(simulate)) => {
            let SimulatedLight { cadence_d, sigma, .. } = *simulate;
            check_light(&at("simulate"), cadence_d, sigma)?;
            if written.observations.sections[0].simulate.is_none() {
                let problem = "the star is not simulated: give observations.simulate, or a path";
                return Err(Fault::new(at("simulate"), problem));
            }
            Ok(LightSource::Simulate(*simulate))
        }
        (Some(_), Some(_)) => Err(Fault::new(key, "give either path or simulate, not both")),
        (None, None) => Err(Fault::new(key, "give path (of a table of time, flux and sigma) or simulate")),
    }
}
