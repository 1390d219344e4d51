//! From another program's input files to a proposal: ZDIpy's star, line and list of profiles in this program's terms,
//! and a list of settings without a counterpart.
//!
//! Angles, signs, epoch, units and the Voigt profile of the local line are the same in both (`io::zdipy`). A target
//! chi2 far from 1 indicates wrong uncertainties: they are measured here, including the noise correlation of
//! neighbouring bins.

use crate::data::config::EquivalentWidth;
use crate::data::init::{Given, Known};
use crate::data::io::zdipy::{BrightnessEntropy, Field, Input, LocalLineFile, Target};
use crate::numerics::text::{Align, columns};
use crate::star::BrightnessModel;
use crate::surface::ObjectiveKind;
use std::fmt::Write as _;
use std::path::Path;

/// A target chi2 within this range is kept.
const FAIR_TARGET: std::ops::RangeInclusive<f64> = 0.9..=1.1;

/// The result of importing an input file.
#[derive(Clone, Debug, PartialEq)]
pub struct Import {
    /// Known properties of the star.
    pub known: Known,
    /// The list of profiles, as text.
    pub list: String,
    /// Settings that are not imported: where, what, and why.
    pub left_out: Vec<[String; 3]>,
}

/// Why the import fails.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{place}: profile {file}: the list of profiles cannot hold a path with a blank or a # in it: write the config \
    elsewhere"
)]
pub struct ImportError {
    place: String,
    file: String,
}

impl Import {
    /// Imports ZDIpy's `inzdi.dat` and, if there is one, its model of the local line. `folder` is that of the input as
    /// seen from the list of profiles.
    ///
    /// # Errors
    /// A path that the list cannot hold.
    pub fn zdipy(input: &Input, line: Option<&LocalLineFile>, folder: &Path) -> Result<Self, ImportError> {
        let mut left_out = Vec::new();
        leave_out(input, &mut left_out);
        if let Some(line) = line {
            leave_out_of_line(line, input.measured_strength.value, &mut left_out);
        }
        Ok(Import { known: known(input, line), list: list(input, folder)?, left_out })
    }

    /// Settings that are not imported, aligned; empty if there are none.
    pub fn table(&self) -> String {
        if self.left_out.is_empty() {
            return String::new();
        }
        let rows: Vec<Vec<String>> = self.left_out.iter().map(|row| row.to_vec()).collect();
        let table = columns(&rows, &[Align::Left; 3]);
        table.lines().fold("not imported\n".to_owned(), |text, line| text + "  " + line + "\n")
    }
}

fn place(path: &Path, line: usize) -> String {
    format!("{}:{line}", path.file_name().unwrap_or_default().to_string_lossy())
}

fn known(input: &Input, line: Option<&LocalLineFile>) -> Known {
    let here = |line: usize| place(&input.path, line);
    let given = |field: Field<f64>| Some(Given { value: field.value, by: here(field.line) });
    let (start, end) = input.velocity_range_kms.value;
    let mut known = Known {
        rotation_period_d: given(input.period_d),
        epoch_d: given(input.epoch_d),
        inclination_deg: given(input.inclination_deg),
        vsini_kms: given(input.vsini_kms),
        vsys_kms: Some(Given { value: 0.0, by: "the velocities of the list are the star's".into() }),
        domega_rad_d: given(input.domega_rad_d),
        resolving_power: given(input.resolving_power),
        velocity_range_kms: Some(Given { value: (start, end), by: here(input.velocity_range_kms.line) }),
        pixels: Some(Given {
            value: pixels(input.rings.value),
            by: format!("{}, {} rings", here(input.rings.line), input.rings.value),
        }),
        brightness: Some(Given {
            value: match input.entropy.value {
                BrightnessEntropy::Image => BrightnessModel::BrightAndDark,
                BrightnessEntropy::FillingFactor => BrightnessModel::Spots,
            },
            by: here(input.entropy.line),
        }),
        objective: Some(Given { value: ObjectiveKind::Spottedness, by: "static map, as in ZDIpy".to_owned() }),
        chi2_target: chi2_target(input),
        ..Known::default()
    };
    if let Some(line) = line {
        let here = place(&line.path, line.line);
        let given = |value| Some(Given { value, by: here.clone() });
        known.wavelength_nm = given(line.wavelength_nm);
        known.limb_darkening = given(line.limb_darkening);
        known.line_sigma_kms = given(digits(line.sigma_kms(), 1e-4));
        known.line_gamma_kms = line.gamma_kms().and_then(|gamma| given(digits(gamma, 1e-4).max(1e-4)));
        let width = match input.measured_strength.value {
            true => EquivalentWidth::AUTO,
            false => EquivalentWidth::Number(digits(line.equivalent_width_kms(), 1e-4)),
        };
        known.equivalent_width = Some(Given { value: width, by: here });
    }
    known
}

/// The number of pixels of ZDIpy with this many rings: `4 / pi` times their square, about.
fn pixels(rings: usize) -> usize {
    const FEWEST: usize = 100;
    ((4.0 / std::f64::consts::PI * (rings * rings) as f64).round() as usize).max(FEWEST)
}

/// A target chi2 near 1 for the brightness map; another one indicates wrong uncertainties, which are measured here.
fn chi2_target(input: &Input) -> Option<Given<f64>> {
    match input.target.value {
        Target::Chi2(target) if input.brightness.value && FAIR_TARGET.contains(&target) => {
            Some(Given { value: target, by: place(&input.path, input.target.line) })
        }
        _ => None,
    }
}

/// Factor on the uncertainties implied by the file's target and scaling of chi2; 1 without them.
fn own_scale(input: &Input) -> f64 {
    let scale = 1.0 / input.chi2_scale.sqrt();
    match input.target.value {
        Target::Chi2(target) if input.brightness.value && !FAIR_TARGET.contains(&target) => scale * target.sqrt(),
        _ => scale,
    }
}

fn digits(value: f64, step: f64) -> f64 {
    let per_unit = (1.0 / step).round();
    (value * per_unit).round() / per_unit
}

fn list(input: &Input, folder: &Path) -> Result<String, ImportError> {
    let mut list = String::from("# file  time_d  vrad_kms\n");
    for profile in &input.profiles {
        let file = folder.join(&profile.file).display().to_string();
        if file.contains(|c: char| c.is_whitespace() || c == '#') {
            return Err(ImportError { place: format!("{}:{}", input.path.display(), profile.line), file });
        }
        // Writing to a String cannot fail.
        let _ = writeln!(list, "{file}  {}  {}", profile.time_d, profile.vrad_kms);
    }
    Ok(list)
}

fn leave_out(input: &Input, rows: &mut Vec<[String; 3]>) {
    let mut row = |line: usize, what: String, why: &str| rows.push([place(&input.path, line), what, why.to_owned()]);
    if let Some(Field { value: (mass, radius), line }) =
        input.mass_radius.filter(|f| f.value.0 > 0.0 && f.value.1 > 0.0)
    {
        row(line, format!("mass {mass}, radius {radius}"), "the star is a sphere here");
    }
    match input.target.value {
        Target::Entropy(entropy) => {
            row(input.target.line, format!("target entropy {entropy}"), "maps have a target chi2 here");
        }
        Target::Chi2(target) if !input.brightness.value => {
            row(
                input.target.line,
                format!("target chi^2 {target}"),
                "is for the magnetic field, the brightness is not fitted",
            );
        }
        Target::Chi2(_) => {}
    }
    let scale = digits(own_scale(input), 1e-4);
    if scale != 1.0 {
        let target = match input.target.value {
            Target::Chi2(target) if input.brightness.value => format!("chi^2 of {target} with errors as quoted"),
            _ => format!("scaling {} of chi^2", input.chi2_scale),
        };
        row(
            input.target.line,
            target,
            &format!("errors are measured on the profiles; \"sigma_scale\": {scale} would repeat the file's"),
        );
    }
    if input.magnetic.value {
        row(input.magnetic.line, "magnetic field".into(), "Stokes V is not modelled here");
    }
    if input.magnetic.value && input.magnetic_start.value {
        row(input.magnetic_start.line, "start from a magnetic map".into(), "Stokes V is not modelled here");
    }
    if input.brightness.value && input.entropy_scale != 1.0 {
        let what = format!("entropy scaling {}", input.entropy_scale);
        row(input.brightness.line, what, "the fit ends at a target chi2 here");
    }
    let (what, why) = match input.entropy.value {
        BrightnessEntropy::Image => ("default brightness", "here it is 1: profiles do not constrain the scale"),
        BrightnessEntropy::FillingFactor => {
            let why = "here the default is a filling factor of spots, imaging.default_spot";
            ("default and limiting brightness", why)
        }
    };
    row(input.entropy.line, what.into(), why);
    if input.brightness.value && input.brightness_start.value {
        row(input.brightness_start.line, "start from a brightness map".into(), "maps do not depend on the start here");
    }
}

fn leave_out_of_line(line: &LocalLineFile, measured_strength: bool, rows: &mut Vec<[String; 3]>) {
    let mut row = |what: String, why: &str| rows.push([place(&line.path, line.line), what, why.to_owned()]);
    if measured_strength {
        row(format!("line depth {}", line.depth), "the strength is measured on the profiles, as in ZDIpy");
    }
    row(format!("Lande factor {}", line.lande), "Stokes V is not modelled here");
    if line.gravity_darkening != 0.0 {
        row(format!("gravity darkening {}", line.gravity_darkening), "the star is a sphere here");
    }
}
