//! Light curves as sections of a config.

use super::ledger::{Ledger, Source};
use crate::data::config::{OutlierTreatment, PhotometrySection, SEGMENT_GAP_D};
use std::path::PathBuf;

/// Spacecraft by parts of file names, and the wavelength (nm) of their band.
const BANDS: [(&str, f64); 3] = [("tess", 790.0), ("kepler", 640.0), ("k2", 640.0)];

/// A light curve.
#[derive(Clone, Debug, PartialEq)]
pub struct LightCurve {
    /// Its name.
    pub name: String,
    /// The table as the config names it, relative to the config's folder.
    pub path_in_config: PathBuf,
    /// Wavelength (nm) of its band, where it is given.
    pub wavelength_nm: Option<f64>,
}

impl LightCurve {
    /// The section of a config.
    pub(super) fn section(&self) -> PhotometrySection {
        PhotometrySection {
            name: Some(self.name.clone()),
            path: Some(self.path_in_config.clone()),
            contrast: None,
            wavelength_nm: self.band(),
            limb_darkening: None,
            segment_gap_d: SEGMENT_GAP_D,
            sigma_scale: 1.0,
            exclude: Vec::new(),
            outliers: OutlierTreatment::default(),
            simulate: None,
        }
    }

    /// Wavelength of its band: given, or that of the spacecraft in its name.
    fn band(&self) -> Option<f64> {
        let name = self.name.to_lowercase();
        let by_name = || BANDS.into_iter().find(|(of, _)| name.contains(of)).map(|(_, wavelength_nm)| wavelength_nm);
        self.wavelength_nm.or_else(by_name)
    }

    /// The light curve with the reason for its band.
    pub(super) fn note(&self, ledger: &mut Ledger) {
        const KEY: &str = "photometry.wavelength_nm";
        const OPTION: &str = "--photometry-wavelength";
        let name = &self.name;
        match (self.wavelength_nm, self.band()) {
            (Some(given), _) => ledger.note(KEY, given, "nm", Source::Given, format!("{name}; {OPTION}")),
            (None, Some(band)) => {
                ledger.note(KEY, band, "nm", Source::Assumed, format!("by the name of the file {name}; {OPTION}"));
            }
            (None, None) => {
                let remark = format!("{name}; {OPTION}, about 790 for TESS, 640 for Kepler");
                ledger.note(KEY, "as the star's", "", Source::Assumed, remark);
            }
        }
    }
}
