//! `star` and `instrument` as users write them. Doc comments here are the descriptions of the JSON Schema.

use super::number_or::{EquivalentWidth, OfStar};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The star. Where a parameter is free, its value here is the start.
// in a draft the period need not be known: it is an `Option` there
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "Star")]
pub struct Star<Period = f64> {
    /// Name of the star: the heading of its report, at most 80 characters. Results do not depend on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Rotation period (d), above 0; rotation cycles and `porb_over_prot` refer to it.
    pub rotation_period_d: Period,
    /// Time of rotation cycle 0 (d), on the time scale of the observations.
    #[serde(default)]
    pub epoch_d: f64,
    /// Inclination of the rotation axis to the line of sight (degrees), above 0 and up to 90.
    pub inclination_deg: f64,
    /// Projected equatorial rotation velocity (km/s), above 0 and up to 2000.
    pub vsini_kms: f64,
    /// Systemic radial velocity (km/s) that remains after the subtraction of each profile's VRAD.
    #[serde(default)]
    pub vsys_kms: f64,
    /// Angular velocity of the equator (rad/d), above 0; 2 pi / `rotation_period_d` if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub omega_eq_rad_d: Option<f64>,
    /// Differential rotation: angular velocity of the equator minus that of the pole (rad/d).
    #[serde(default)]
    pub domega_rad_d: f64,
    /// Mass of the star (solar masses), 0.01 to 200, for the minimum mass M sin i of the planet. It may be added to an
    /// existing run. Two planets must be stable for this mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_msun: Option<f64>,
    /// Limb darkening; linear with coefficient 0.65 if not given.
    #[serde(default)]
    pub limb_darkening: LimbDarkeningSection,
    /// Temperature of the photosphere (K). Give both temperatures, or `contrast`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photosphere_k: Option<f64>,
    /// Temperature of the spots (K), below that of the photosphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spot_k: Option<f64>,
    /// Wavelength (nm) at which the temperatures give the brightness of a spot.
    #[serde(default = "usual_wavelength_nm")]
    pub wavelength_nm: f64,
    /// Brightness of a spot over that of the photosphere, in [0, 1); instead of the two temperatures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast: Option<f64>,
    /// The line of one surface element.
    pub line: Line,
    /// Stellar parameters fitted to the profiles before maps and searches, with objective "marginal-likelihood",
    /// starting from their values here: any of "line_sigma_kms", "equivalent_width_kms", "vsini_kms" and
    /// "limb_darkening".
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fitted: Vec<String>,
    /// Velocity drift (outer companion or spectrograph), marginalised over with objective "marginal-likelihood". If not
    /// given, "linear" where the profiles show a slope of 3 standard errors without a planet, and otherwise "none".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_drift: Option<VelocityDrift>,
    /// Active regions: their line and limb contrast. Fitted if not given, with objective "marginal-likelihood";
    /// otherwise a spot is a dimmed photosphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub regions: Option<RegionsSection>,
}

/// Velocity drift.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VelocityDrift {
    /// No drift.
    None,
    /// In proportion to time.
    Linear,
    /// With a curvature.
    Quadratic,
}

/// Active regions, spots with the plages around them: their line and limb contrast. With `area`, `area_limb` and
/// `dimming_limb` at 0 a spot is a dimmed photosphere.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RegionsSection {
    /// Width of their line, before the spectrograph, over that of the photosphere's, 0.5 to 2.
    pub line_width: OfStar,
    /// Equivalent width of their line over that of the photosphere's, 0.3 to 3.
    pub equivalent_width: OfStar,
    /// Velocity of their line over that of the photosphere (km/s), positive to the red, -3 to 3.
    pub shift_kms: OfStar,
    /// Surface with their line per unit spot filling factor, 0 to 20.
    pub area: OfStar,
    /// Increase of that surface towards the limb: limb minus disc centre, -20 to 20.
    pub area_limb: OfStar,
    /// Limb dimming: one minus their brightness, limb minus disc centre, -3 to 3.
    pub dimming_limb: OfStar,
}

/// Wavelength (nm) if none is given: that which LSD profiles of the visible are often normalised to.
pub const USUAL_WAVELENGTH_NM: f64 = 550.0;

/// Linear limb darkening, if none is given.
pub const USUAL_LIMB_DARKENING: f64 = 0.65;

fn usual_wavelength_nm() -> f64 {
    USUAL_WAVELENGTH_NM
}

/// The line of one surface element, before the spectrograph broadens it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Shape of the line.
    #[serde(default)]
    pub shape: LineShape,
    /// Standard deviation (km/s) of the Gaussian, above 0.
    pub sigma_kms: f64,
    /// Of a Voigt profile: half width at half depth (km/s) of the Lorentzian, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamma_kms: Option<f64>,
    /// Equivalent width (km/s), wings and all, above 0, or "auto": the mean area of the observed profiles, for
    /// observations from files.
    pub equivalent_width_kms: EquivalentWidth,
}

/// Shape of the local line.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LineShape {
    /// A Gaussian.
    #[default]
    Gaussian,
    /// A Gaussian convolved with a Lorentzian, whose wings reach through the whole velocity range.
    Voigt,
}

/// Limb darkening. The intensity must stay positive on the whole disc.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LimbDarkeningSection {
    /// Law, in the cosine `mu` of the angle to the line of sight.
    pub law: LimbLaw,
    /// One coefficient for the linear law, two for the quadratic one.
    pub coefficients: Vec<f64>,
}

impl Default for LimbDarkeningSection {
    fn default() -> Self {
        LimbDarkeningSection { law: LimbLaw::Linear, coefficients: vec![USUAL_LIMB_DARKENING] }
    }
}

/// Limb-darkening law.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LimbLaw {
    /// `1 - u (1 - mu)`, u from 0 to 1.
    Linear,
    /// `1 - a (1 - mu) - b (1 - mu)^2`.
    Quadratic,
}

/// The spectrograph.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Instrument {
    /// Name of the spectrograph, in any case, such as "ESPaDOnS", "SPIRou" or "HARPS": it gives `resolving_power` and
    /// `stability_ms` where these are not given. Any other name takes both. It does not change `star.wavelength_nm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Resolving power, above 0: the instrumental profile is a Gaussian of full width c/R at half maximum. If not
    /// given, that of the named spectrograph; without a name, no instrumental broadening.
    #[serde(default)]
    pub resolving_power: Option<f64>,
    /// RV stability (m/s), from 0 to 1e5: scale of the half-Cauchy priors of RV jitter and night-to-night RV offsets,
    /// and half of the largest standard deviation of such offsets that searches, chains and limits fit. If not given,
    /// that of the named spectrograph; without a name, searches take 30.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability_ms: Option<f64>,
}
