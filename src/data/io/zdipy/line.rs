//! ZDIpy's model of the local line, `model-voigt-line.dat`: wavelength (nm), central depth, Gaussian width (km/s,
//! sqrt(2) standard deviations), Lorentzian half width (over the Gaussian one), Lande factor, limb darkening (linear),
//! and perhaps gravity darkening. It describes one line; later ones are not used, as in ZDIpy.

use super::read_text;
use super::rows::Rows;
use crate::data::io::FileError;
use std::f64::consts::{PI, SQRT_2};
use std::path::{Path, PathBuf};

/// Name of the file, beside `inzdi.dat`.
pub const LINE_FILE: &str = "model-voigt-line.dat";

/// The content of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalLineFile {
    /// The file.
    pub path: PathBuf,
    /// The line with these values.
    pub line: usize,
    /// Wavelength (nm).
    pub wavelength_nm: f64,
    /// Depth of the Gaussian line without the Lorentzian wings: `I = 1 - depth H(a, u)`, H the Voigt function.
    pub depth: f64,
    /// sqrt(2) standard deviations of the Gaussian (km/s).
    pub gauss_kms: f64,
    /// Half width at half depth of the Lorentzian, over `gauss_kms`.
    pub lorentz: f64,
    /// Effective Lande factor.
    pub lande: f64,
    /// Coefficient of linear limb darkening.
    pub limb_darkening: f64,
    /// Exponent of gravity darkening; 0 if not given.
    pub gravity_darkening: f64,
}

impl LocalLineFile {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// As [`super::Input::read`].
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let row = Rows::new(path, &text).next("the model of the line")?;
        let limb_darkening = row.number(5, "limb darkening")?;
        if !(0.0..=1.0).contains(&limb_darkening) {
            return Err(row.fault(format!("the limb darkening is {limb_darkening}, it must be from 0 to 1")));
        }
        let lorentz = row.number(3, "Lorentzian width")?;
        if lorentz < 0.0 {
            return Err(row.fault(format!("the Lorentzian width is {lorentz}, it must be 0 or more")));
        }
        Ok(LocalLineFile {
            path: path.into(),
            line: row.line,
            wavelength_nm: row.positive(0, "wavelength")?,
            depth: row.positive(1, "line depth")?,
            gauss_kms: row.positive(2, "Gaussian width")?,
            lorentz,
            lande: row.number(4, "Lande factor")?,
            limb_darkening,
            gravity_darkening: if row.columns() > 6 { row.number(6, "gravity darkening")? } else { 0.0 },
        })
    }

    /// Standard deviation (km/s) of the Gaussian.
    pub fn sigma_kms(&self) -> f64 {
        self.gauss_kms / SQRT_2
    }

    /// Half width at half depth (km/s) of the Lorentzian; `None` where the line is a Gaussian.
    pub fn gamma_kms(&self) -> Option<f64> {
        Some(self.lorentz * self.gauss_kms).filter(|gamma| *gamma > 0.0)
    }

    /// Equivalent width (km/s): the Voigt function has the area sqrt(pi) in units of the Gaussian width.
    pub fn equivalent_width_kms(&self) -> f64 {
        self.depth * PI.sqrt() * self.gauss_kms
    }
}

#[cfg(test)]
mod tests {
    use super::LocalLineFile;

    fn file(gauss_kms: f64, lorentz: f64) -> LocalLineFile {
        LocalLineFile {
            path: Default::default(),
            line: 1,
            wavelength_nm: 650.0,
            depth: 0.63,
            gauss_kms,
            lorentz,
            lande: 1.2,
            limb_darkening: 0.66,
            gravity_darkening: 0.0,
        }
    }

    /// Voigt profile of area 1 by summing Lorentzians over a Gaussian.
    fn voigt(file: &LocalLineFile, v: f64) -> f64 {
        let gamma = file.lorentz * file.gauss_kms;
        let nodes = (-400..=400).map(|k| 0.01 * f64::from(k));
        let at = |u: f64| (-u * u).exp() * gamma / ((v - u * file.gauss_kms).powi(2) + gamma * gamma);
        nodes.map(at).sum::<f64>() * 0.01 / std::f64::consts::PI.powf(1.5)
    }

    #[test]
    fn the_area_is_that_of_the_voigt_function() {
        let file = file(2.0, 0.5);
        // H(a, 0) = exp(a^2) erfc(a) = 0.61569 at a = 0.5 (Abramowitz & Stegun, table 7.7)
        let area = file.depth * 0.615_690 / voigt(&file, 0.0);
        assert!((area / file.equivalent_width_kms() - 1.0).abs() < 1e-4, "{area}");
    }
}
