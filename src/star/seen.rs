//! Data sets as seen by the star model: times and velocities, and overrides of the star for each.

use super::exposure::{Exposure, Smearing};
use super::{LimbDarkening, LocalLine, Regions, StarSettings, StarState, Surface};
use crate::star::observation::Observations;

/// Times and velocities of a data set.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Width of a velocity bin (km/s).
    pub step_kms: f64,
    /// For each profile: time (d), velocity of its first bin (km/s), number of bins.
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

/// A data set: times and velocities, and its overrides of the star.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Local line, instrumental broadening included; that of the star's settings if `None`.
    pub line: Option<LocalLine>,
    /// Brightness of a fully spotted pixel over that of the photosphere; that of the star's settings if `None`.
    pub contrast: Option<f64>,
    /// Limb darkening; that of the star's settings if `None`.
    pub limb_darkening: Option<LimbDarkening>,
    /// Differences in active regions; those of the star's settings if `None`.
    pub regions: Option<Regions>,
    /// Times and velocity bins.
    pub sampling: Sampling,
    /// The map of each profile, where the star has several; empty where it has one.
    pub own_maps: Vec<OwnMap>,
    /// The exposure of each profile; empty where all are instants.
    pub exposures: Vec<Exposure>,
}

/// One of several maps of a star, for one profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnMap {
    /// Its number, from 0.
    pub number: usize,
    /// The time (d) of its origin of longitudes, in place of the star's epoch.
    pub epoch_d: f64,
}

/// The narrower of the star's lines.
pub(super) fn narrowest(star: &StarSettings) -> LocalLine {
    let of_regions = star.regions.line(star.line);
    match star.regions.are_plain() || star.line.sigma_kms <= of_regions.sigma_kms {
        true => star.line,
        false => of_regions,
    }
}

impl From<Sampling> for Seen {
    fn from(sampling: Sampling) -> Self {
        Seen {
            line: None,
            contrast: None,
            limb_darkening: None,
            regions: None,
            sampling,
            own_maps: Vec::new(),
            exposures: Vec::new(),
        }
    }
}

impl Seen {
    /// Exposures of these lengths (d), 0 if unknown, for this set at a state; empty where all are instants. The number
    /// of samples in them no longer changes with the state.
    pub fn exposures(&self, star: &StarSettings, state: &StarState, lengths_d: &[f64]) -> Vec<Exposure> {
        let smearing = Smearing {
            vsini_kms: state.vsini_kms,
            omega_eq_rad_d: state.rotation.omega_eq_rad_d,
            bin_kms: self.sampling.step_kms,
            line_sigma_kms: narrowest(&self.star(star, &state.surface)).sigma_kms,
        };
        let exposures: Vec<Exposure> = lengths_d.iter().map(|length_d| smearing.exposure(*length_d)).collect();
        if exposures.iter().all(|exposure| exposure.looks == 1) { Vec::new() } else { exposures }
    }

    /// The star with such a surface and the overrides of this set. A line of the set changes in proportion to that of
    /// the star.
    pub fn star(&self, star: &StarSettings, surface: &Surface) -> StarSettings {
        let mut seen = star.with(surface);
        if let Some(own) = self.line {
            seen.line = own.in_proportion(&star.line, &seen.line);
        }
        seen.contrast = self.contrast.unwrap_or(seen.contrast);
        seen.limb_darkening = self.limb_darkening.unwrap_or(seen.limb_darkening);
        seen.regions = self.regions.unwrap_or(seen.regions);
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_its_own_limb_and_regions_and_a_line_in_proportion() {
        let line = LocalLine { instrumental_sigma_kms: 3.0, ..LocalLine::gaussian(5.0, 6.0) };
        let star = StarSettings {
            rotation_period_d: 3.0,
            epoch_d: 0.0,
            limb_darkening: LimbDarkening::Linear(0.7),
            contrast: 0.3,
            line,
            regions: Regions::PLAIN,
        };
        let regions = Regions { area: 2.0, line_width: 1.2, ..Regions::PLAIN };
        let own = LocalLine { sigma_kms: 2.0, instrumental_sigma_kms: 0.0, equivalent_width_kms: Some(3.0), ..line };
        let sampling = Sampling { step_kms: 2.0, profiles: Vec::new() };
        let limb_darkening = Some(LimbDarkening::Linear(0.4));
        let set = Seen { line: Some(own), limb_darkening, regions: Some(regions), ..sampling.clone().into() };
        // the fit finds the line half as wide, and a third stronger
        let surface = Surface {
            line_sigma_kms: Some(2.0),
            equivalent_width_kms: Some(8.0),
            limb_darkening: Some(0.9),
            region_area: Some(5.0),
            ..Surface::default()
        };
        let seen = set.star(&star, &surface);
        assert_eq!((seen.limb_darkening, seen.regions, seen.contrast), (LimbDarkening::Linear(0.4), regions, 0.3));
        assert!((seen.line.sigma_kms - 1.0).abs() < 1e-12, "{:?}", seen.line);
        assert_eq!(seen.line.equivalent_width_kms, Some(4.0));
        assert_eq!(set.star(&star, &Surface::default()).line, own);
        assert_eq!(Seen::from(sampling).star(&star, &surface), star.with(&surface));
    }
}
