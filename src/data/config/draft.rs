//! A config to be written: the keys that a first config of an observed star has, in the order and layout in which
//! people read them. Defaults that nobody asked about are left to the program.

use super::per_parameter::{PerParameter, Planet};
use super::raw::{Instrument, LimbDarkeningSection, LimbLaw, Line, LineShape, Star};
use super::raw_parts::{ObservationsSection, PriorSection};
use super::{Automatic, EquivalentWidth, ImagingSettings, VelocityJitter};
use crate::model::{Parameter, PriorKind};
use crate::surface::ObjectiveKind;
use serde::Serialize;
use std::path::PathBuf;

/// Longest line of a config that is written.
const WIDTH: usize = 110;

/// A config of observations from files with the orbit and the systemic velocity free.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    /// Where the JSON Schema is, relative to the config.
    pub schema: Option<String>,
    /// Rotation period (d); `None` writes a null, which every command refuses.
    pub rotation_period_d: Option<f64>,
    /// Time of rotation cycle 0 (d).
    pub epoch_d: f64,
    /// Inclination (degrees).
    pub inclination_deg: f64,
    /// Projected equatorial rotation velocity (km/s).
    pub vsini_kms: f64,
    /// Systemic velocity (km/s) after the subtraction of VRAD.
    pub vsys_kms: f64,
    /// Equator minus pole (rad/d).
    pub domega_rad_d: f64,
    /// Coefficient of linear limb darkening.
    pub limb_darkening: f64,
    /// Temperature of the photosphere (K).
    pub photosphere_k: f64,
    /// Temperature of the spots (K).
    pub spot_k: f64,
    /// Wavelength (nm).
    pub wavelength_nm: f64,
    /// Standard deviation (km/s) of the local line, of its Gaussian.
    pub line_sigma_kms: f64,
    /// Half width at half depth (km/s) of its Lorentzian, which makes it a Voigt profile.
    pub line_gamma_kms: Option<f64>,
    /// Its equivalent width.
    pub equivalent_width: EquivalentWidth,
    /// Resolving power of the spectrograph.
    pub resolving_power: f64,
    /// The list of profiles, relative to the config.
    pub observations: PathBuf,
    /// First and last velocity (km/s) used.
    pub velocity_range_kms: (f64, f64),
    /// Factor on the standard errors.
    pub sigma_scale: Automatic,
    /// Level of the continuum in the files, where it is not 1.
    pub continuum_level: Option<f64>,
    /// Scatter of the velocity zero points.
    pub velocity_jitter: VelocityJitter,
    /// The image.
    pub imaging: ImagingSettings,
    /// Starts of the orbit: semi-amplitude (km/s), 0 for no planet; period over the rotation period; phase.
    pub orbit: (f64, f64, f64),
    /// Bounds of its prior, uniform in the logarithm.
    pub porb_over_prot_range: (f64, f64),
    /// Upper bound of the prior of K (km/s), uniform from 0.
    pub k_max_kms: f64,
    /// Bounds of the prior of the systemic velocity (km/s), uniform.
    pub vsys_range_kms: (f64, f64),
}

/// The sections that are written, in their order.
#[derive(Serialize)]
struct Sections {
    #[serde(rename = "$schema", skip_serializing_if = "Option::is_none")]
    schema: Option<String>,
    star: Star,
    instrument: Instrument,
    planet: Planet,
    observations: ObservationsSection,
    imaging: ImagingSettings,
    parameters: PerParameter<PriorSection>,
}

impl Draft {
    /// The config as text.
    ///
    /// # Errors
    /// If the path of the observations is not Unicode, as JSON must be.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(compact(&serde_json::to_string_pretty(&self.sections())?))
    }

    fn sections(&self) -> Sections {
        let integrated = self.imaging.objective == ObjectiveKind::MarginalLikelihood;
        Sections {
            schema: self.schema.clone(),
            star: self.star(),
            instrument: Instrument { resolving_power: Some(self.resolving_power) },
            planet: Planet::of([
                (Parameter::K, self.orbit.0),
                (Parameter::PorbOverProt, self.orbit.1),
                (Parameter::Phi, self.orbit.2),
            ]),
            observations: ObservationsSection {
                path: Some(self.observations.clone()),
                velocity_range_kms: Some(self.velocity_range_kms.into()),
                sigma_scale: Some(self.sigma_scale),
                continuum_level: self.continuum_level,
                velocity_jitter_kms: Some(self.velocity_jitter).filter(|jitter| integrated || !jitter.is_default()),
                ..ObservationsSection::default()
            },
            imaging: self.imaging.clone(),
            parameters: PerParameter::from_iter([
                (Parameter::K, bounded(PriorKind::Uniform, (0.0, self.k_max_kms))),
                (Parameter::PorbOverProt, bounded(PriorKind::LogUniform, self.porb_over_prot_range)),
                (
                    Parameter::Phi,
                    PriorSection { prior: PriorKind::Periodic, min: None, max: None, mean: None, sd: None },
                ),
                (Parameter::Vsys, bounded(PriorKind::Uniform, self.vsys_range_kms)),
            ]),
        }
    }

    fn star(&self) -> Star {
        Star {
            // what is not finite is written as null
            rotation_period_d: self.rotation_period_d.unwrap_or(f64::NAN),
            epoch_d: self.epoch_d,
            inclination_deg: self.inclination_deg,
            vsini_kms: self.vsini_kms,
            vsys_kms: self.vsys_kms,
            omega_eq_rad_d: None,
            domega_rad_d: self.domega_rad_d,
            mass_msun: None,
            limb_darkening: LimbDarkeningSection { law: LimbLaw::Linear, coefficients: vec![self.limb_darkening] },
            photosphere_k: Some(self.photosphere_k),
            spot_k: Some(self.spot_k),
            wavelength_nm: self.wavelength_nm,
            contrast: None,
            line: Line {
                shape: self.line_gamma_kms.map_or(LineShape::Gaussian, |_| LineShape::Voigt),
                sigma_kms: self.line_sigma_kms,
                gamma_kms: self.line_gamma_kms,
                equivalent_width_kms: self.equivalent_width,
            },
        }
    }
}

fn bounded(prior: PriorKind, (min, max): (f64, f64)) -> PriorSection {
    PriorSection { prior, min: Some(min), max: Some(max), mean: None, sd: None }
}

/// Indented JSON with every object and list that fits on one line put on one line, but for the outermost.
pub(super) fn compact(pretty: &str) -> String {
    let lines: Vec<&str> = pretty.lines().collect();
    let indent = |line: &str| line.len() - line.trim_start().len();
    let (mut text, mut k) = (String::new(), 0);
    while k < lines.len() {
        let opens = k > 0 && lines[k].ends_with(['{', '[']);
        let closes = |j: &usize| opens && indent(lines[*j]) == indent(lines[k]);
        let whole = (k + 1..lines.len()).find(closes).map(|end| (end, joined(&lines[k..=end])));
        match whole.filter(|(_, line)| line.chars().count() <= WIDTH) {
            Some((end, line)) => {
                text += &line;
                k = end + 1;
            }
            None => {
                text += lines[k];
                k += 1;
            }
        }
        text.push('\n');
    }
    text
}

/// An object or a list on one line: braces with a space inside, brackets without.
fn joined(lines: &[&str]) -> String {
    let mut line = lines[0].to_string();
    for next in &lines[1..] {
        let next = next.trim_start();
        let tight = line.ends_with('[') || next.starts_with(']');
        line += if tight { "" } else { " " };
        line += next;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::compact;

    #[test]
    fn what_fits_stands_on_one_line() {
        let long = "x".repeat(100);
        let value =
            serde_json::json!({ "a": { "b": [1, 2], "c": "{" }, "d": [], "e": { "f": long, "g": { "h": null } } });
        let text = compact(&serde_json::to_string_pretty(&value).unwrap());
        let expected = format!(
            "{{\n  \"a\": {{ \"b\": [1, 2], \"c\": \"{{\" }},\n  \"d\": [],\n  \"e\": {{\n    \"f\": \"{long}\",\n    \
             \"g\": {{ \"h\": null }}\n  }}\n}}\n"
        );
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
