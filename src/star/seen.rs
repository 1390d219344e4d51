//! What data sets see of the star: when and at which velocities, and what looks different through each.

use super::{LocalLine, StarSettings};
use crate::star::observation::Observations;
use std::borrow::Cow;

/// When and at which velocities a data set observes the star.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Width of a velocity bin (km/s).
    pub step_kms: f64,
    /// Of each profile: time (d), velocity of its first bin (km/s), number of bins.
    pub profiles: Vec<(f64, f64, usize)>,
}

impl Sampling {
    /// The sampling of a set of observations.
    pub fn of(observations: &Observations) -> Self {
        let profile = |p: &crate::star::observation::Profile| (p.time_d, p.first_velocity_kms, p.intensity.len());
        Sampling { step_kms: observations.step_kms(), profiles: observations.profiles.iter().map(profile).collect() }
    }

    /// Number of bins of all profiles together.
    pub fn bins(&self) -> usize {
        self.profiles.iter().map(|p| p.2).sum()
    }
}

/// What a data set sees: when and at which velocities, and what of the star looks different through it.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Local line, instrumental broadening included; that of the star's settings if `None`.
    pub line: Option<LocalLine>,
    /// Brightness of a wholly spotted pixel over that of the photosphere; that of the star's settings if `None`.
    pub contrast: Option<f64>,
    /// Times and velocity bins.
    pub sampling: Sampling,
    /// The map that each profile sees, where the star has several; empty where it has one.
    pub own_maps: Vec<OwnMap>,
}

/// One of several maps of a star, as one profile sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnMap {
    /// Its number, from 0.
    pub number: usize,
    /// The time (d) from which rotation turns it, in place of the star's.
    pub epoch_d: f64,
}

impl From<Sampling> for Seen {
    fn from(sampling: Sampling) -> Self {
        Seen { line: None, contrast: None, sampling, own_maps: Vec::new() }
    }
}

impl Seen {
    /// The star as this set sees it.
    pub fn star<'a>(&self, star: &'a StarSettings) -> Cow<'a, StarSettings> {
        if self.line.is_none() && self.contrast.is_none() {
            return Cow::Borrowed(star);
        }
        let (line, contrast) = (self.line.unwrap_or(star.line), self.contrast.unwrap_or(star.contrast));
        Cow::Owned(StarSettings { line, contrast, ..star.clone() })
    }
}
