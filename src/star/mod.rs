//! The star and what it shows: surface grid, rotation, visibility, limb darkening, local line, orbit, spots and faculae, and the
//! response that turns a brightness map into line profiles (method section 1; Petit et al. 2015, section 2).
//!
//! Left out: priors, chi2, chains, files. Angles are radians here, velocities km/s, times days.

pub mod brightness;
mod convolution;
mod correlate;
mod deposit;
pub mod grid;
mod kernel;
pub mod limb_darkening;
mod line_profile;
pub mod orbit;
pub mod response;
pub mod rotation;
pub mod spots;
mod view;

pub use brightness::{Brightness, BrightnessModel};
pub use grid::{Quadrature, SurfaceGrid};
pub use limb_darkening::LimbDarkening;
pub use orbit::Orbit;
pub use response::{Response, Sampling};
pub use rotation::Rotation;
pub use spots::{Disc, Facula, Spot};

/// Everything about the star that is not one of the eight parameters that may be sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct StarSettings {
    /// Period (d) that rotation cycles and `Porb/Prot` refer to.
    pub rotation_period_d: f64,
    /// Time of rotation cycle 0 (d).
    pub epoch_d: f64,
    /// Limb-darkening law with its coefficients.
    pub limb_darkening: LimbDarkening,
    /// Brightness of a wholly spotted pixel over that of the photosphere, in [0, 1).
    pub contrast: f64,
    /// The local line, instrumental broadening included.
    pub line: LocalLine,
}

/// A Gaussian local line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalLine {
    /// Standard deviation (km/s), intrinsic and instrumental widths added in quadrature.
    pub sigma_kms: f64,
    /// Equivalent width (km/s).
    pub equivalent_width_kms: f64,
}

impl StarSettings {
    /// Rotation cycle `E = (t - epoch) / rotation_period` of a time (d).
    pub fn cycle(&self, time_d: f64) -> f64 {
        (time_d - self.epoch_d) / self.rotation_period_d
    }
}

/// The physical state of star and planet at one point of parameter space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StarState {
    /// Rotation law.
    pub rotation: Rotation,
    /// Inclination of the rotation axis to the line of sight (rad).
    pub inclination: f64,
    /// Projected equatorial velocity (km/s).
    pub vsini_kms: f64,
    /// Systemic velocity (km/s).
    pub vsys_kms: f64,
    /// Orbit of the planet.
    pub orbit: Orbit,
}
