//! The light curves of a config.

use super::checks::{check_windows, names, positive};
use super::domain::{check_size, most};
use super::error::Fault;
use super::photometry::{PhotometrySection, SimulatedLight};
use super::raw::Config;
use super::resolve_star::{contrast, limb_darkening};
use super::{LightCurveSettings, LightSource};
use crate::star::Band;
use std::path::Path;

/// Longest gap within a segment (d): level and slope do not hold for longer.
const LONGEST_GAP_D: f64 = 1000.0;

/// Resolves the light curves of `raw`. `config` is the config's path, whose folder paths start from.
pub(super) fn resolve_photometry(raw: &Config, config: &Path) -> Result<Vec<LightCurveSettings>, Fault> {
    let Some(photometry) = &raw.photometry else { return Ok(Vec::new()) };
    if !raw.imaging.objective.evolves() {
        let problem = format!(
            "imaging.objective {:?} does not know of light curves: they take \"marginal-likelihood\"",
            raw.imaging.objective.name()
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
            band: band(raw, section, &key)?,
            source: source(raw, section, &key, config)?,
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

/// Contrast and limb darkening, as far as they are not the star's.
fn band(raw: &Config, section: &PhotometrySection, key: &str) -> Result<Band, Fault> {
    let mut own = raw.star.clone();
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
            let problem = "star.contrast knows no wavelength: give star.photosphere_k and .spot_k instead";
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

fn source(raw: &Config, section: &PhotometrySection, key: &str, config: &Path) -> Result<LightSource, Fault> {
    let at = |field: &str| format!("{key}.{field}");
    match (&section.path, &section.simulate) {
        (Some(path), None) if path.as_os_str().is_empty() => Err(Fault::new(at("path"), "is empty")),
        (Some(path), None) => Ok(LightSource::File(config.parent().unwrap_or(Path::new("")).join(path))),
        (None, Some(simulate)) => {
            let SimulatedLight { cadence_d, sigma, .. } = *simulate;
            positive(&at("simulate.cadence_d"), cadence_d)?;
            check_size(&at("simulate.cadence_d"), cadence_d, most::TIME)?;
            positive(&at("simulate.sigma"), sigma)?;
            if sigma > 1.0 {
                return Err(Fault::new(at("simulate.sigma"), format!("{sigma} must be at most 1, the flux itself")));
            }
            if raw.observations.sections[0].simulate.is_none() {
                let problem = "the star is not simulated: give observations.simulate, or a path";
                return Err(Fault::new(at("simulate"), problem));
            }
            Ok(LightSource::Simulate(*simulate))
        }
        (Some(_), Some(_)) => Err(Fault::new(key, "give either path or simulate, not both")),
        (None, None) => Err(Fault::new(key, "give path (of a table of time, flux and sigma) or simulate")),
    }
}
