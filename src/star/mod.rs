//! The star and its observables (`docs/method.md` section 1; Petit et al. 2015, section 2).
//!
//! In: a map of the surface, one number per pixel, the values of star and orbit ([`StarState`]), and times. Out: line
//! depth and continuum of every profile, by one linear [`Response`], and its transpose. Angles are radians here,
//! velocities km/s, times days.
//!
//! 1. [`grid`] has the pixels, [`spots`] the values of a simulated map, [`brightness`] their brightness.
//! 2. For each observation: [`rotation`] turns the pixels, `view` finds the visible ones, [`limb_darkening`] darkens
//!    them, `moments` gives each its weight and velocity. [`orbit`] shifts the whole profile; [`exposure`] has the
//!    times of a long one.
//! 3. `placement` puts pixels into cells of a velocity grid (`sorting`, `filling`, `block`), `deposit` sums their
//!    brightness there (`kernel`).
//! 4. `convolution` converts that to bins (`correlate`) with the local line (`line_profile`, `voigt`).
//! 5. [`response`] goes through these steps, and back, for one data set, `stacked` for several. `nearby` is faster for
//!    a star that differs little.
//!
//! Also: [`Band`] has the flux of the star, [`observation`] profiles with their moments, [`injection`] adds an orbit to
//! them, [`planet`] has the quoted quantities of an orbit ([`kepler`] its anomalies), [`stability`] that of two
//! planets.

mod block;
pub mod brightness;
mod convolution;
mod correlate;
mod deposit;
pub mod exposure;
mod filling;
pub mod grid;
pub mod injection;
pub mod kepler;
mod kernel;
pub mod limb_darkening;
mod line_profile;
mod moments;
mod nearby;
pub mod observation;
pub mod orbit;
mod photometry;
mod placement;
pub mod planet;
pub mod regions;
pub mod response;
pub mod rotation;
mod seen;
pub mod size;
mod sorting;
pub mod spots;
pub mod stability;
mod stacked;
mod view;
mod voigt;

pub use brightness::{Brightness, BrightnessModel};
pub use exposure::{Exposure, Smearing};
pub use grid::{Quadrature, SurfaceGrid};
pub use limb_darkening::LimbDarkening;
pub use nearby::Nearby;
pub use orbit::{Eccentric, Motion, Orbit, Shape};
pub use photometry::Band;
pub use regions::Regions;
pub use rotation::Rotation;
pub use seen::{OwnMap, Sampling, Seen};
pub use size::Size;
pub use spots::{Disc, Facula, Life, Spot};
pub use stacked::Response;

/// The star. [`Surface`] may replace some of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct StarSettings {
    /// Period (d) that rotation cycles and `Porb/Prot` refer to.
    pub rotation_period_d: f64,
    /// Time of rotation cycle 0 (d).
    pub epoch_d: f64,
    /// Limb-darkening law with its coefficients.
    pub limb_darkening: LimbDarkening,
    /// Brightness of a fully spotted pixel over that of the photosphere, in [0, 1).
    pub contrast: f64,
    /// The local line, instrumental broadening included.
    pub line: LocalLine,
    /// Differences in active regions.
    pub regions: Regions,
}

/// A local line: a Voigt profile, which without a Lorentzian is a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalLine {
    /// Standard deviation (km/s) of the Gaussian, intrinsic and instrumental widths added in quadrature.
    pub sigma_kms: f64,
    /// The instrumental part of it (km/s).
    pub instrumental_sigma_kms: f64,
    /// Half width at half depth (km/s) of the Lorentzian, 0 for none.
    pub gamma_kms: f64,
    /// Equivalent width (km/s), wings and all; `None` until it is measured on the profiles.
    pub equivalent_width_kms: Option<f64>,
}

impl LocalLine {
    /// A purely intrinsic Gaussian.
    pub fn gaussian(sigma_kms: f64, equivalent_width_kms: f64) -> Self {
        let equivalent_width_kms = Some(equivalent_width_kms);
        LocalLine { sigma_kms, instrumental_sigma_kms: 0.0, gamma_kms: 0.0, equivalent_width_kms }
    }

    /// Standard deviation (km/s) of the intrinsic Gaussian.
    pub fn own_sigma_kms(&self) -> f64 {
        (self.sigma_kms.powi(2) - self.instrumental_sigma_kms.powi(2)).max(0.0).sqrt()
    }

    /// This line changed in the same proportions as a line for another data set.
    #[must_use]
    pub fn in_proportion(self, before: &LocalLine, after: &LocalLine) -> Self {
        let mut line = self;
        if before.sigma_kms != after.sigma_kms && before.own_sigma_kms() > 0.0 {
            let own = self.own_sigma_kms() * after.own_sigma_kms() / before.own_sigma_kms();
            line.sigma_kms = own.hypot(self.instrumental_sigma_kms);
        }
        let widths = [self, *before, *after].map(|line| line.equivalent_width_kms);
        if let [Some(own), Some(before), Some(after)] = widths
            && before != after
        {
            line.equivalent_width_kms = Some(own * after / before);
        }
        line
    }

    /// The equivalent width (km/s) of a line for synthetic profiles.
    ///
    /// # Panics
    /// If it is still to be measured.
    pub fn strength_kms(&self) -> f64 {
        self.equivalent_width_kms.expect("the equivalent width is measured before profiles are made with the line")
    }
}

/// Parameters of the star's surface that replace those of [`StarSettings`], where given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// First coefficient of the limb darkening.
    pub limb_darkening: Option<f64>,
    /// Standard deviation (km/s) of the local line, before the spectrograph.
    pub line_sigma_kms: Option<f64>,
    /// Equivalent width (km/s) of the local line.
    pub equivalent_width_kms: Option<f64>,
    /// Brightness of a fully spotted pixel over that of the photosphere.
    pub contrast: Option<f64>,
    /// Differences in active regions: width of the line, ...
    pub region_line_width: Option<f64>,
    /// ... its equivalent width, ...
    pub region_equivalent_width: Option<f64>,
    /// ... its velocity (km/s), ...
    pub region_shift_kms: Option<f64>,
    /// ... the area with it, ...
    pub region_area: Option<f64>,
    /// ... the increase of that area at the limb; ...
    pub region_area_limb: Option<f64>,
    /// ... and their additional darkening there.
    pub region_dimming_limb: Option<f64>,
}

impl StarSettings {
    /// The star with such a surface.
    pub fn with(&self, surface: &Surface) -> Self {
        let mut star = self.clone();
        if let Some(coefficient) = surface.limb_darkening {
            star.limb_darkening = star.limb_darkening.with_first(coefficient);
        }
        if let Some(sigma_kms) = surface.line_sigma_kms {
            star.line.sigma_kms = sigma_kms.hypot(star.line.instrumental_sigma_kms);
        }
        star.line.equivalent_width_kms = surface.equivalent_width_kms.or(star.line.equivalent_width_kms);
        star.contrast = surface.contrast.unwrap_or(star.contrast);
        star.regions = surface.regions(star.regions);
        star
    }

    /// Whether such a star is possible.
    pub fn is_possible(&self) -> bool {
        (0.0..1.0).contains(&self.contrast)
            && self.line.sigma_kms > 0.0
            && self.line.equivalent_width_kms.is_some_and(|width| width > 0.0)
            && self.limb_darkening.is_positive()
    }

    /// Rotation cycle `E = (t - epoch) / rotation_period` of a time (d).
    pub fn cycle(&self, time_d: f64) -> f64 {
        (time_d - self.epoch_d) / self.rotation_period_d
    }
}

impl Surface {
    /// Active regions, where those of the star's settings are these.
    fn regions(&self, settings: Regions) -> Regions {
        Regions {
            line_width: self.region_line_width.unwrap_or(settings.line_width),
            equivalent_width: self.region_equivalent_width.unwrap_or(settings.equivalent_width),
            shift_kms: self.region_shift_kms.unwrap_or(settings.shift_kms),
            area: self.region_area.unwrap_or(settings.area),
            area_limb: self.region_area_limb.unwrap_or(settings.area_limb),
            dimming_limb: self.region_dimming_limb.unwrap_or(settings.dimming_limb),
        }
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
    /// Orbit of the planet, or orbits of both.
    pub motion: Motion,
    /// Parameters that replace the star's settings.
    pub surface: Surface,
}
