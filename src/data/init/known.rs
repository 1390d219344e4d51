//! Properties of a star known independently of its profiles.

use crate::data::config::EquivalentWidth;
use crate::numerics::units::gaussian_as_wide_as_voigt;
use crate::star::BrightnessModel;
use crate::surface::ObjectiveKind;

/// A value with its source: an option, or a line of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Given<T> {
    /// The value.
    pub value: T,
    /// Its source, for the table.
    pub by: String,
}

/// Properties of the star known independently of its profiles; all may be absent. Names and units are those of the
/// config.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs)]
pub struct Known {
    pub name: Option<Given<String>>,
    pub rotation_period_d: Option<Given<f64>>,
    pub epoch_d: Option<Given<f64>>,
    pub inclination_deg: Option<Given<f64>>,
    pub vsini_kms: Option<Given<f64>>,
    pub vsys_kms: Option<Given<f64>>,
    pub domega_rad_d: Option<Given<f64>>,
    /// Coefficient of the linear law.
    pub limb_darkening: Option<Given<f64>>,
    pub photosphere_k: Option<Given<f64>>,
    pub spot_k: Option<Given<f64>>,
    pub wavelength_nm: Option<Given<f64>>,
    /// Standard deviation of the local line, of its Gaussian.
    pub line_sigma_kms: Option<Given<f64>>,
    /// Half width at half depth of its Lorentzian, which makes it a Voigt profile.
    pub line_gamma_kms: Option<Given<f64>>,
    pub equivalent_width: Option<Given<EquivalentWidth>>,
    /// Name of the spectrograph, one of [`SPECTROGRAPHS`](crate::data::config::SPECTROGRAPHS).
    pub instrument_name: Option<Given<&'static str>>,
    pub resolving_power: Option<Given<f64>>,
    pub velocity_range_kms: Option<Given<(f64, f64)>>,
    /// Whether nothing beyond that range is used, as an option requests; the range in another program's file applies to
    /// its map only.
    pub only_within_range: bool,
    pub sigma_scale: Option<Given<f64>>,
    pub objective: Option<Given<ObjectiveKind>>,
    pub brightness: Option<Given<BrightnessModel>>,
    pub pixels: Option<Given<usize>>,
    pub chi2_target: Option<Given<f64>>,
}

impl Known {
    /// First and last velocity (km/s) that are used, where they are given.
    pub(super) fn range_kms(&self) -> Option<(f64, f64)> {
        self.velocity_range_kms.as_ref().map(|given| given.value)
    }

    /// The objective of reconstructions; by default the one that suits most stars.
    pub fn objective(&self) -> ObjectiveKind {
        self.objective.as_ref().map_or(ObjectiveKind::MarginalLikelihood, |given| given.value)
    }

    /// Standard deviation (km/s) of the Gaussian as wide as the local line, whose Gaussian has that of `sigma_kms`.
    pub(super) fn line_width_kms(&self, sigma_kms: f64) -> f64 {
        self.line_gamma_kms.as_ref().map_or(sigma_kms, |gamma| gaussian_as_wide_as_voigt(sigma_kms, gamma.value))
    }
}
