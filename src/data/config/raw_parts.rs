//! More of the config as users write it: priors, plan, grid axes, and the types they are made of.

use crate::data::simulate::Schedule;
use crate::model::Parameter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One optional entry for each parameter that may be free.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "PerParameter_{T}")]
pub(super) struct PerParameter<T> {
    /// Semi-amplitude of the planet's orbit (km/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k_kms: Option<T>,
    /// Orbital period over the rotation period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub porb_over_prot: Option<T>,
    /// Orbital period (d), in place of `porb_over_prot`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_d: Option<T>,
    /// Orbital phase (cycles): the part of an orbit from `star.epoch_d` to the next maximum of the star's radial
    /// velocity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phi: Option<T>,
    /// Time of one inferior conjunction (planet in front; d, on the time scale of the observations), in place of `phi`.
    /// A normal prior is an ephemeris: at the time of the data it must tell the phase to a tenth of an orbit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_conjunction_d: Option<T>,
    /// Square root of the eccentricity e times the cosine of the argument of periastron omega of the star's orbit; free
    /// with `sqrt_e_sin_omega`, both with a unit-disc prior.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e_cos_omega: Option<T>,
    /// The same with the sine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e_sin_omega: Option<T>,
    /// Semi-amplitude of the orbit of a second planet (km/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub k2_kms: Option<T>,
    /// Orbital period of the second planet over the rotation period.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub porb2_over_prot: Option<T>,
    /// Orbital period of the second planet (d), in place of `porb2_over_prot`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period2_d: Option<T>,
    /// Orbital phase of the second planet (cycles), as `phi`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phi2: Option<T>,
    /// Time of one inferior conjunction of the second planet (d), as `t_conjunction_d`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_conjunction2_d: Option<T>,
    /// Of the second planet's orbit, as `sqrt_e_cos_omega`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e2_cos_omega2: Option<T>,
    /// Of the second planet's orbit, as `sqrt_e_sin_omega`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sqrt_e2_sin_omega2: Option<T>,
    /// Angular velocity of the equator (rad/d).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub omega_eq_rad_d: Option<T>,
    /// Angular velocity of the equator minus that of the pole (rad/d).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub domega_rad_d: Option<T>,
    /// Inclination (degrees).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inclination_deg: Option<T>,
    /// Projected equatorial rotation velocity (km/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vsini_kms: Option<T>,
    /// Systemic radial velocity (km/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vsys_kms: Option<T>,
    /// First coefficient of the limb darkening, 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limb_darkening: Option<T>,
    /// Standard deviation of the local line (km/s), before the spectrograph.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line_sigma_kms: Option<T>,
    /// Equivalent width of the local line (km/s): a scale of the depth of all profiles, told apart from a nuisance of
    /// each profile's own by the priors alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equivalent_width_kms: Option<T>,
    /// Brightness of a spot over that of the photosphere, 0 to 1. Data only say that spots are not brighter than some
    /// value: the darker they are, the fewer a map needs, so that a flat prior ends at 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contrast: Option<T>,
    /// Standard deviation of the spots' filling factor before the data, with objective "marginal-likelihood".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spot_amplitude: Option<T>,
    /// How fast the spots' power falls with the degree of the harmonics, with objective "marginal-likelihood".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spot_slope: Option<T>,
    /// How long spots live (d), with objective "marginal-likelihood".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spot_lifetime_d: Option<T>,
}

impl<T> Default for PerParameter<T> {
    fn default() -> Self {
        PerParameter {
            k_kms: None,
            porb_over_prot: None,
            phi: None,
            period_d: None,
            t_conjunction_d: None,
            sqrt_e_cos_omega: None,
            sqrt_e_sin_omega: None,
            k2_kms: None,
            porb2_over_prot: None,
            period2_d: None,
            phi2: None,
            t_conjunction2_d: None,
            sqrt_e2_cos_omega2: None,
            sqrt_e2_sin_omega2: None,
            omega_eq_rad_d: None,
            domega_rad_d: None,
            inclination_deg: None,
            vsini_kms: None,
            vsys_kms: None,
            limb_darkening: None,
            line_sigma_kms: None,
            equivalent_width_kms: None,
            contrast: None,
            spot_amplitude: None,
            spot_slope: None,
            spot_lifetime_d: None,
        }
    }
}

impl<T> PerParameter<T> {
    /// The entry of one parameter.
    pub fn slot(&mut self, parameter: Parameter) -> &mut Option<T> {
        match parameter {
            Parameter::K => &mut self.k_kms,
            Parameter::PorbOverProt => &mut self.porb_over_prot,
            Parameter::Phi => &mut self.phi,
            Parameter::Period => &mut self.period_d,
            Parameter::Conjunction => &mut self.t_conjunction_d,
            Parameter::SqrtECosOmega => &mut self.sqrt_e_cos_omega,
            Parameter::SqrtESinOmega => &mut self.sqrt_e_sin_omega,
            Parameter::K2 => &mut self.k2_kms,
            Parameter::PorbOverProt2 => &mut self.porb2_over_prot,
            Parameter::Period2 => &mut self.period2_d,
            Parameter::Phi2 => &mut self.phi2,
            Parameter::Conjunction2 => &mut self.t_conjunction2_d,
            Parameter::SqrtECosOmega2 => &mut self.sqrt_e2_cos_omega2,
            Parameter::SqrtESinOmega2 => &mut self.sqrt_e2_sin_omega2,
            Parameter::OmegaEq => &mut self.omega_eq_rad_d,
            Parameter::DOmega => &mut self.domega_rad_d,
            Parameter::Inclination => &mut self.inclination_deg,
            Parameter::Vsini => &mut self.vsini_kms,
            Parameter::Vsys => &mut self.vsys_kms,
            Parameter::LimbDarkening => &mut self.limb_darkening,
            Parameter::LineSigma => &mut self.line_sigma_kms,
            Parameter::EquivalentWidth => &mut self.equivalent_width_kms,
            Parameter::Contrast => &mut self.contrast,
            Parameter::SpotAmplitude => &mut self.spot_amplitude,
            Parameter::SpotSlope => &mut self.spot_slope,
            Parameter::SpotLifetime => &mut self.spot_lifetime_d,
        }
    }
}

impl<T: Clone> PerParameter<T> {
    /// The entries that are there, in the order of [`Parameter::ALL`].
    pub fn entries(&self) -> Vec<(Parameter, T)> {
        let mut all = self.clone();
        Parameter::ALL.into_iter().filter_map(|p| Some((p, all.slot(p).take()?))).collect()
    }
}

/// A prior. Which of the other keys belong to it depends on its kind.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PriorSection {
    /// Kind of the prior.
    pub prior: PriorKind,
    /// Lower bound; needed for uniform and log-uniform (there above 0), optional for normal and isotropic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Upper bound, above the lower one; needed for uniform and log-uniform, optional for normal and isotropic. Of a
    /// unit-disc prior, optional: the largest eccentricity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// Mean of a normal prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// Standard deviation of a normal prior, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
}

impl PriorSection {
    /// The section that stands for a uniform or log-uniform prior.
    pub fn even(prior: PriorKind, (min, max): (f64, f64)) -> Self {
        PriorSection { prior, min: Some(min), max: Some(max), mean: None, sd: None }
    }
}

/// Kinds of priors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum PriorKind {
    /// Constant between `min` and `max`.
    Uniform,
    /// Proportional to 1/x between `min` and `max`.
    LogUniform,
    /// A Gaussian of `mean` and `sd`, cut off at `min` and `max` if given.
    Normal,
    /// For `inclination_deg`: proportional to sin i, between `min` (0 if not given) and `max` (90).
    Isotropic,
    /// For `phi`: constant on the circle from 0 to 1.
    Periodic,
    /// For `sqrt_e_cos_omega` and `sqrt_e_sin_omega` together: constant on the disc in which the eccentricity is below
    /// `max` (1 if not given), that is, any eccentricity up to there and any argument of periastron alike.
    UnitDisc,
}

/// Profiles that are planned beside those of `observations`, for the command `plan` alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanSection {
    /// When they are taken.
    #[serde(default)]
    pub schedule: Schedule,
    /// Time of the first night (d), on the time scale of the observations; the day after the last profile, if not
    /// given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_d: Option<f64>,
    /// Signal-to-noise ratio of each bin, above 0; that of the observed profiles, if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub snr: Option<f64>,
}

/// The landscape that `dimcmc grid` computes: ln L of the reconstructions, without priors. All parameters without an
/// axis are fixed at their values under `star` and `planet`, those with a prior too.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Grid {
    /// One to three axes `[min, max, n]`: n nodes (2 or more) from min to max, both included, 1,000,000 nodes in all at
    /// most. An axis of `phi` may wrap around 0 or 1 (nodes are written in [0, 1)); where it spans a whole period, as
    /// [0, 1, n], max is the same place as min and is left out.
    pub axes: PerParameter<(f64, f64, usize)>,
}
