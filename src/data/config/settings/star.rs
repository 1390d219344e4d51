//! The star: rotation, limb darkening, spot contrast and local line.

use super::checks::{automatic, check_size, most, positive, within};
use crate::data::config::error::Fault;
use crate::data::config::instruments::Spectrograph;
use crate::data::config::written::{Instrument, LimbDarkeningSection, LimbLaw, Line, LineShape, RegionsSection, Star};
use crate::model::Parameter;
use crate::numerics::units::{instrumental_sigma_kms, planck_contrast};
use crate::star::{LimbDarkening, LocalLine, Regions, StarSettings};
use std::f64::consts::TAU;

/// Lightest and heaviest star (solar masses).
const MASSES_MSUN: std::ops::RangeInclusive<f64> = 0.01..=200.0;

/// Least and largest RV stability of a spectrograph (m/s).
const STABILITIES_MS: [f64; 2] = [0.0, 1e5];

/// Least stability as the scale of a prior (m/s).
const LEAST_MS: f64 = 0.1;

/// Metres in a kilometre.
const M_PER_KM: f64 = 1e3;

/// Longest name of a star or a spectrograph (characters).
const LONGEST_NAME: usize = 80;

/// The name at `key`, of a star or a spectrograph.
fn check_name(key: &str, name: &str) -> Result<(), Fault> {
    let length = name.chars().count();
    let problem = match () {
        () if name.trim().is_empty() => "must not be empty".to_owned(),
        () if name.chars().any(char::is_control) => "must be one line without control characters".to_owned(),
        () if length > LONGEST_NAME => format!("has {length} characters, at most {LONGEST_NAME} are allowed"),
        () => return Ok(()),
    };
    Err(Fault::new(key, problem))
}

/// Fills in what the name of the spectrograph gives, and returns its RV stability (km/s) where known.
pub(super) fn resolve_instrument(instrument: &mut Instrument) -> Result<Option<f64>, Fault> {
    const NAME: &str = "instrument.name";
    if let Some(name) = &instrument.name {
        check_name(NAME, name)?;
        match Spectrograph::named(name) {
            Some(known) => {
                instrument.resolving_power.get_or_insert(known.resolving_power);
                instrument.stability_ms.get_or_insert(known.stability_ms);
            }
            None if instrument.resolving_power.is_some() && instrument.stability_ms.is_some() => {}
            None => {
                let other = "any other needs instrument.resolving_power and instrument.stability_ms";
                return Err(Fault::new(NAME, format!("{}; {other}", Spectrograph::unknown(name))));
            }
        }
    }
    let Some(stability_ms) = instrument.stability_ms else { return Ok(None) };
    within("instrument.stability_ms", stability_ms, STABILITIES_MS)?;
    Ok(Some(stability_ms.max(LEAST_MS) / M_PER_KM))
}

/// Checks and resolves the star; fills the default of its `omega_eq_rad_d`.
pub(super) fn resolve_star(star: &mut Star, instrument: &Instrument) -> Result<StarSettings, Fault> {
    star.name.as_deref().map_or(Ok(()), |name| check_name("star.name", name))?;
    positive("star.rotation_period_d", star.rotation_period_d)?;
    check_size("star.rotation_period_d", star.rotation_period_d, most::TIME)?;
    check_size("star.epoch_d", star.epoch_d, most::TIME)?;
    let omega = TAU / star.rotation_period_d;
    if !(omega.is_finite() && omega > 0.0) {
        let problem = format!("{} leaves the range of double precision", star.rotation_period_d);
        return Err(Fault::new("star.rotation_period_d", problem));
    }
    star.omega_eq_rad_d.get_or_insert(omega);
    if let Some(mass) = star.mass_msun.filter(|mass| !MASSES_MSUN.contains(mass)) {
        let (least, most) = (MASSES_MSUN.start(), MASSES_MSUN.end());
        let problem = format!("{mass} must be from {least} to {most} solar masses");
        return Err(Fault::new("star.mass_msun", problem));
    }
    Ok(StarSettings {
        rotation_period_d: star.rotation_period_d,
        epoch_d: star.epoch_d,
        limb_darkening: limb_darkening(&star.limb_darkening)?,
        contrast: contrast(star)?,
        line: local_line(&star.line, instrument)?,
        regions: regions(&star.regions.unwrap_or_default())?,
    })
}

/// The numbers of active regions as written, in the order of [`Parameter::REGIONS`].
fn numbers(section: &RegionsSection) -> [Option<f64>; Parameter::REGIONS.len()] {
    let RegionsSection { line_width, equivalent_width, shift_kms, area, area_limb, dimming_limb } = section;
    [line_width, equivalent_width, shift_kms, area, area_limb, dimming_limb].map(|number| number.number())
}

/// Active regions with the given keys.
fn regions(section: &RegionsSection) -> Result<Regions, Fault> {
    let numbers = numbers(section);
    for (parameter, number) in Parameter::REGIONS.into_iter().zip(numbers) {
        let (spec, (least, most)) = (parameter.spec(), parameter.widest());
        if let Some(number) = number.filter(|number| !(least..=most).contains(number)) {
            return Err(Fault::new(spec.config_key, format!("{number} must be from {least} to {most}")));
        }
    }
    let plain = Parameter::REGIONS.map(Parameter::usual);
    let [line_width, equivalent_width, shift_kms, area, area_limb, dimming_limb] =
        std::array::from_fn(|i| numbers[i].unwrap_or(plain[i]));
    Ok(Regions { line_width, equivalent_width, shift_kms, area, area_limb, dimming_limb })
}

/// Which numbers of active regions are fitted: those that are not given. Without regions beyond spots their line has no
/// effect.
fn fitted_regions(section: &RegionsSection) -> Vec<Parameter> {
    let numbers = numbers(section);
    let none = numbers[3..].iter().all(|number| *number == Some(0.0));
    let fitted = Parameter::REGIONS.into_iter().zip(numbers).filter(|(_, number)| number.is_none());
    if none { Vec::new() } else { fitted.map(|(parameter, _)| parameter).collect() }
}

/// Parameters other than those of active regions that may be fitted (`star.fitted`).
pub const FITTED: [Parameter; 4] =
    [Parameter::LineSigma, Parameter::EquivalentWidth, Parameter::Vsini, Parameter::LimbDarkening];

/// Which numbers of the star are fitted to the profiles.
pub(super) fn fitted_star(star: &Star) -> Result<Vec<Parameter>, Fault> {
    let mut all = Vec::new();
    for name in &star.fitted {
        let Some(parameter) = FITTED.into_iter().find(|parameter| parameter.name() == name) else {
            let known = FITTED.map(|parameter| format!("{:?}", parameter.name())).join(", ");
            return Err(Fault::new("star.fitted", format!("{name:?} is none of {known}")));
        };
        if all.contains(&parameter) {
            return Err(Fault::new("star.fitted", format!("{name:?} is there twice")));
        }
        all.push(parameter);
    }
    Ok(all.into_iter().chain(fitted_regions(&star.regions.unwrap_or_default())).collect())
}

pub(super) fn limb_darkening(section: &LimbDarkeningSection) -> Result<LimbDarkening, Fault> {
    let fault = |problem: String| Err(Fault::new("star.limb_darkening.coefficients", problem));
    match (section.law, &section.coefficients[..]) {
        (LimbLaw::Linear, &[u]) if (0.0..=1.0).contains(&u) => Ok(LimbDarkening::Linear(u)),
        (LimbLaw::Linear, &[u]) => fault(format!("{u} must be from 0 to 1")),
        (LimbLaw::Linear, other) => fault(format!("the linear law has 1 coefficient, not {}", other.len())),
        (LimbLaw::Quadratic, &[a, b]) => match LimbDarkening::Quadratic(a, b).is_positive() {
            true => Ok(LimbDarkening::Quadratic(a, b)),
            false => fault(format!("[{a}, {b}] make the intensity negative somewhere on the disc")),
        },
        (LimbLaw::Quadratic, other) => fault(format!("the quadratic law has 2 coefficients, not {}", other.len())),
    }
}

pub(super) fn contrast(star: &Star) -> Result<f64, Fault> {
    let (photosphere, spot) = match (star.contrast, star.photosphere_k, star.spot_k) {
        (Some(contrast), None, None) => {
            return match (0.0..1.0).contains(&contrast) {
                true => Ok(contrast),
                false => Err(Fault::new("star.contrast", format!("{contrast} must be 0 or more and below 1"))),
            };
        }
        (Some(_), _, _) => {
            return Err(Fault::new("star.contrast", "give either contrast or photosphere_k and spot_k, not both"));
        }
        (None, Some(photosphere), Some(spot)) => (photosphere, spot),
        (None, None, Some(_)) => return Err(Fault::new("star.photosphere_k", "missing, spot_k needs it")),
        (None, Some(_), None) => return Err(Fault::new("star.spot_k", "missing, photosphere_k needs it")),
        (None, None, None) => {
            return Err(Fault::new("star.photosphere_k", "missing: give photosphere_k and spot_k, or contrast"));
        }
    };
    positive("star.photosphere_k", photosphere)?;
    positive("star.spot_k", spot)?;
    positive("star.wavelength_nm", star.wavelength_nm)?;
    if spot >= photosphere {
        return Err(Fault::new("star.spot_k", format!("{spot} must be below photosphere_k, which is {photosphere}")));
    }
    let contrast = planck_contrast(spot, photosphere, star.wavelength_nm);
    match (0.0..1.0).contains(&contrast) {
        true => Ok(contrast),
        false => {
            let nm = star.wavelength_nm;
            let problem = format!("{nm} nm gives spots of {spot} K no contrast that is a number: it is in nanometres");
            Err(Fault::new("star.wavelength_nm", problem))
        }
    }
}

/// Widest Lorentzian (km/s).
const WIDEST_GAMMA_KMS: f64 = 100.0;

fn local_line(line: &Line, instrument: &Instrument) -> Result<LocalLine, Fault> {
    let gamma_kms = match (line.shape, line.gamma_kms) {
        (LineShape::Gaussian, None) => 0.0,
        (LineShape::Gaussian, Some(_)) => return Err(Fault::new("star.line.gamma_kms", "not for a gaussian line")),
        (LineShape::Voigt, None) => return Err(Fault::new("star.line.gamma_kms", "missing, a voigt line needs it")),
        (LineShape::Voigt, Some(gamma)) => {
            positive("star.line.gamma_kms", gamma)?;
            if gamma > WIDEST_GAMMA_KMS {
                let problem = format!("{gamma} must be at most {WIDEST_GAMMA_KMS}: a wider line is no line");
                return Err(Fault::new("star.line.gamma_kms", problem));
            }
            gamma
        }
    };
    positive("star.line.sigma_kms", line.sigma_kms)?;
    let instrumental = match instrument.resolving_power {
        Some(power) => {
            positive("instrument.resolving_power", power)?;
            instrumental_sigma_kms(power)
        }
        None => 0.0,
    };
    let sigma_kms = line.sigma_kms.hypot(instrumental);
    if !sigma_kms.is_finite() {
        return Err(Fault::new("instrument.resolving_power", "the line becomes infinitely broad"));
    }
    automatic("star.line.equivalent_width_kms", line.equivalent_width_kms)?;
    let equivalent_width_kms = line.equivalent_width_kms.number();
    Ok(LocalLine { sigma_kms, instrumental_sigma_kms: instrumental, gamma_kms, equivalent_width_kms })
}
