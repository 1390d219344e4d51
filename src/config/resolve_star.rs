//! The star: rotation, limb darkening, spot contrast and local line.

use super::EquivalentWidth;
use super::error::Fault;
use super::raw::{Instrument, LimbDarkeningSection, LimbLaw, Line, LineShape, Star};
use super::resolve::positive;
use crate::star::{LimbDarkening, LocalLine, StarSettings};
use crate::units::{instrumental_sigma_kms, planck_contrast};
use std::f64::consts::TAU;

/// Checks and resolves the star; fills the default of its `omega_eq_rad_d`. An equivalent width "auto" becomes NaN.
pub(super) fn resolve_star(star: &mut Star, instrument: &Instrument) -> Result<StarSettings, Fault> {
    positive("star.rotation_period_d", star.rotation_period_d)?;
    let omega = TAU / star.rotation_period_d;
    if !(omega.is_finite() && omega > 0.0) {
        let problem = format!("{} leaves the range of double precision", star.rotation_period_d);
        return Err(Fault::new("star.rotation_period_d", problem));
    }
    star.omega_eq_rad_d.get_or_insert(omega);
    Ok(StarSettings {
        rotation_period_d: star.rotation_period_d,
        epoch_d: star.epoch_d,
        limb_darkening: limb_darkening(&star.limb_darkening)?,
        contrast: contrast(star)?,
        line: local_line(&star.line, instrument)?,
    })
}

fn limb_darkening(section: &LimbDarkeningSection) -> Result<LimbDarkening, Fault> {
    let fault = |problem: String| Err(Fault::new("star.limb_darkening.coefficients", problem));
    match (section.law, &section.coefficients[..]) {
        (LimbLaw::Linear, &[u]) if (0.0..=1.0).contains(&u) => Ok(LimbDarkening::Linear(u)),
        (LimbLaw::Linear, &[u]) => fault(format!("{u} must be from 0 to 1")),
        (LimbLaw::Linear, other) => fault(format!("the linear law has 1 coefficient, not {}", other.len())),
        (LimbLaw::Quadratic, &[a, b]) => match positive_on_the_disc(a, b) {
            true => Ok(LimbDarkening::Quadratic(a, b)),
            false => fault(format!("[{a}, {b}] make the intensity negative somewhere on the disc")),
        },
        (LimbLaw::Quadratic, other) => fault(format!("the quadratic law has 2 coefficients, not {}", other.len())),
    }
}

/// Whether `1 - a x - b x^2` is positive for `x = 1 - mu` from 0 to the limb (where it may be 0).
fn positive_on_the_disc(a: f64, b: f64) -> bool {
    let limb = 1.0 - a - b;
    let turning = -a / (2.0 * b);
    let has_minimum_inside = b < 0.0 && turning > 0.0 && turning < 1.0;
    // The rounding of 1 - a - b where they should add up to 1.
    limb >= -1e-12 && (!has_minimum_inside || 1.0 + a * a / (4.0 * b) > 0.0)
}

fn contrast(star: &Star) -> Result<f64, Fault> {
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
        false => Err(Fault::new("star.spot_k", format!("{spot} gives a contrast of {contrast}, not in [0, 1)"))),
    }
}

fn local_line(line: &Line, instrument: &Instrument) -> Result<LocalLine, Fault> {
    // Other shapes will need settings of their own.
    let LineShape::Gaussian = line.shape;
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
    let equivalent_width_kms = match line.equivalent_width_kms {
        EquivalentWidth::Fixed(width) => {
            positive("star.line.equivalent_width_kms", width)?;
            width
        }
        EquivalentWidth::Auto => f64::NAN,
    };
    Ok(LocalLine { sigma_kms, equivalent_width_kms })
}

#[cfg(test)]
mod tests {
    use super::positive_on_the_disc;

    #[test]
    fn limb_darkening_is_positive_where_it_should_be() {
        for (a, b, fine) in [
            (0.4, 0.3, true),
            (0.7, 0.3, true),
            (0.8, 0.3, false),
            (1.5, -0.5, true),
            (2.5, -1.5, false),
            (-0.2, 0.0, true),
            (0.0, 0.0, true),
            (3.0, -2.9, true),
            (3.5, -2.9, false),
        ] {
            assert_eq!(positive_on_the_disc(a, b), fine, "{a} {b}");
            let least = (0..1000).map(|k| k as f64 / 1000.0).map(|x| 1.0 - a * x - b * x * x).fold(f64::MAX, f64::min);
            assert_eq!(least > 0.0, fine, "{a} {b}: {least}");
        }
    }
}
