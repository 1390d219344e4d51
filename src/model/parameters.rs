//! The parameters that may be sampled: their names, units, and values at one point of parameter space.

use super::elements::Elements;
use crate::star::{Motion, Rotation, StarState, Surface};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

/// One of the parameters that may be free. The order is that of every table and chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Parameter {
    /// Semi-amplitude of the planet's orbit (km/s).
    K,
    /// Orbital period over rotation period.
    PorbOverProt,
    /// Orbital period (d), in place of that ratio.
    Period,
    /// Orbital phase (cycles).
    Phi,
    /// Time of an inferior conjunction (d), in place of the phase.
    Conjunction,
    /// Square root of the eccentricity times the cosine of the argument of periastron.
    SqrtECosOmega,
    /// The same with the sine.
    SqrtESinOmega,
    /// Semi-amplitude of a second planet's orbit (km/s).
    K2,
    /// Its orbital period over rotation period.
    PorbOverProt2,
    /// Its orbital period (d), in place of that ratio.
    Period2,
    /// Its orbital phase (cycles).
    Phi2,
    /// Time of one of its inferior conjunctions (d), in place of the phase.
    Conjunction2,
    /// Of its orbit, the square root of the eccentricity times the cosine of the argument of periastron.
    SqrtECosOmega2,
    /// The same with the sine.
    SqrtESinOmega2,
    /// Angular velocity of the equator (rad/d).
    OmegaEq,
    /// Equator-to-pole shear (rad/d).
    DOmega,
    /// Inclination (degrees).
    Inclination,
    /// Projected equatorial velocity (km/s).
    Vsini,
    /// Systemic velocity (km/s).
    Vsys,
    /// First coefficient of the limb darkening.
    LimbDarkening,
    /// Standard deviation of the local line (km/s), before the spectrograph.
    LineSigma,
    /// Equivalent width of the local line (km/s).
    EquivalentWidth,
    /// Brightness of a spot over that of the photosphere.
    Contrast,
    /// Standard deviation of the spots' filling factor before the data, where maps are integrated over.
    SpotAmplitude,
    /// Slope of the spots' spectrum there.
    SpotSlope,
    /// Lifetime of the spots there (d).
    SpotLifetime,
}

impl Parameter {
    /// All of them, in order.
    pub const ALL: [Parameter; 26] = [
        Parameter::K,
        Parameter::PorbOverProt,
        Parameter::Period,
        Parameter::Phi,
        Parameter::Conjunction,
        Parameter::SqrtECosOmega,
        Parameter::SqrtESinOmega,
        Parameter::K2,
        Parameter::PorbOverProt2,
        Parameter::Period2,
        Parameter::Phi2,
        Parameter::Conjunction2,
        Parameter::SqrtECosOmega2,
        Parameter::SqrtESinOmega2,
        Parameter::OmegaEq,
        Parameter::DOmega,
        Parameter::Inclination,
        Parameter::Vsini,
        Parameter::Vsys,
        Parameter::LimbDarkening,
        Parameter::LineSigma,
        Parameter::EquivalentWidth,
        Parameter::Contrast,
        Parameter::SpotAmplitude,
        Parameter::SpotSlope,
        Parameter::SpotLifetime,
    ];

    /// Those of the field of spots that is integrated over.
    pub const FIELD: [Parameter; 3] = [Parameter::SpotAmplitude, Parameter::SpotSlope, Parameter::SpotLifetime];

    /// The name used in config, chain, tables and plots.
    pub fn name(self) -> &'static str {
        match self {
            Parameter::K => "k_kms",
            Parameter::PorbOverProt => "porb_over_prot",
            Parameter::Period => "period_d",
            Parameter::Phi => "phi",
            Parameter::Conjunction => "t_conjunction_d",
            Parameter::SqrtECosOmega => "sqrt_e_cos_omega",
            Parameter::SqrtESinOmega => "sqrt_e_sin_omega",
            Parameter::K2 => "k2_kms",
            Parameter::PorbOverProt2 => "porb2_over_prot",
            Parameter::Period2 => "period2_d",
            Parameter::Phi2 => "phi2",
            Parameter::Conjunction2 => "t_conjunction2_d",
            Parameter::SqrtECosOmega2 => "sqrt_e2_cos_omega2",
            Parameter::SqrtESinOmega2 => "sqrt_e2_sin_omega2",
            Parameter::OmegaEq => "omega_eq_rad_d",
            Parameter::DOmega => "domega_rad_d",
            Parameter::Inclination => "inclination_deg",
            Parameter::Vsini => "vsini_kms",
            Parameter::Vsys => "vsys_kms",
            Parameter::LimbDarkening => "limb_darkening",
            Parameter::LineSigma => "line_sigma_kms",
            Parameter::EquivalentWidth => "equivalent_width_kms",
            Parameter::Contrast => "contrast",
            Parameter::SpotAmplitude => "spot_amplitude",
            Parameter::SpotSlope => "spot_slope",
            Parameter::SpotLifetime => "spot_lifetime_d",
        }
    }

    /// Unit of its values; `1` for a ratio.
    pub fn unit(self) -> &'static str {
        match self {
            Parameter::K | Parameter::K2 | Parameter::Vsini | Parameter::Vsys => "km/s",
            Parameter::LineSigma | Parameter::EquivalentWidth => "km/s",
            Parameter::PorbOverProt | Parameter::LimbDarkening | Parameter::Contrast => "1",
            Parameter::SpotAmplitude | Parameter::SpotSlope => "1",
            Parameter::PorbOverProt2 | Parameter::SqrtECosOmega | Parameter::SqrtESinOmega => "1",
            Parameter::SqrtECosOmega2 | Parameter::SqrtESinOmega2 => "1",
            Parameter::SpotLifetime => "d",
            Parameter::Period | Parameter::Conjunction | Parameter::Period2 | Parameter::Conjunction2 => "d",
            Parameter::Phi | Parameter::Phi2 => "cycles",
            Parameter::OmegaEq | Parameter::DOmega => "rad/d",
            Parameter::Inclination => "deg",
        }
    }

    /// Its symbol, in LaTeX without dollars.
    pub fn latex(self) -> &'static str {
        match self {
            Parameter::K => "K",
            Parameter::PorbOverProt => r"P_\mathrm{orb}/P_\mathrm{rot}",
            Parameter::Period => r"P_\mathrm{orb}",
            Parameter::Phi => r"\phi",
            Parameter::Conjunction => r"T_\mathrm{conj}",
            Parameter::SqrtECosOmega => r"\sqrt{e} \cos \omega",
            Parameter::SqrtESinOmega => r"\sqrt{e} \sin \omega",
            Parameter::K2 => "K_2",
            Parameter::PorbOverProt2 => r"P_{\mathrm{orb},2}/P_\mathrm{rot}",
            Parameter::Period2 => r"P_{\mathrm{orb},2}",
            Parameter::Phi2 => r"\phi_2",
            Parameter::Conjunction2 => r"T_{\mathrm{conj},2}",
            Parameter::SqrtECosOmega2 => r"\sqrt{e_2} \cos \omega_2",
            Parameter::SqrtESinOmega2 => r"\sqrt{e_2} \sin \omega_2",
            Parameter::OmegaEq => r"\Omega_\mathrm{eq}",
            Parameter::DOmega => r"\mathrm{d}\Omega",
            Parameter::Inclination => "i",
            Parameter::Vsini => r"v \sin i",
            Parameter::Vsys => r"v_\mathrm{sys}",
            Parameter::LimbDarkening => "u",
            Parameter::LineSigma => r"\sigma_\mathrm{line}",
            Parameter::EquivalentWidth => r"W_\mathrm{line}",
            Parameter::Contrast => "c",
            Parameter::SpotAmplitude => r"\sigma_\mathrm{spot}",
            Parameter::SpotSlope => r"\alpha_\mathrm{spot}",
            Parameter::SpotLifetime => r"\tau_\mathrm{spot}",
        }
    }

    /// Whether it belongs to a planet's orbit.
    pub fn is_orbital(self) -> bool {
        Elements::of(self).is_some()
    }

    /// Whether it is a phase of an orbit, which has period 1.
    pub fn is_phase(self) -> bool {
        matches!(self, Parameter::Phi | Parameter::Phi2)
    }

    /// Whether it is one of the two that say how eccentric an orbit is, and where its periastron.
    pub fn is_shape(self) -> bool {
        Elements::of(self).is_some_and(|of| of.shape.contains(&self))
    }

    /// Whether it is a semi-amplitude.
    pub fn is_amplitude(self) -> bool {
        matches!(self, Parameter::K | Parameter::K2)
    }

    /// Whether it stands in place of another parameter, in other units: it is free in its name alone, and
    /// [`ParameterValues`] hold the other.
    pub fn is_ephemeris(self) -> bool {
        use Parameter::{Conjunction, Conjunction2, Period, Period2};
        matches!(self, Period | Conjunction | Period2 | Conjunction2)
    }

    /// Whether it stands in place of one of the star's settings.
    pub fn is_surface(self) -> bool {
        self >= Parameter::LimbDarkening && !self.is_of_field()
    }

    /// Whether it says what is assumed of the spots where all maps are integrated over.
    pub fn is_of_field(self) -> bool {
        Parameter::FIELD.contains(&self)
    }

    /// Whether values of all parameters may do without it.
    pub fn is_optional(self) -> bool {
        let is_usual = matches!(self, Parameter::K | Parameter::PorbOverProt | Parameter::Phi);
        self.is_surface() || self.is_of_field() || (self.is_orbital() && !is_usual)
    }

    /// Whether samplers move in its logarithm.
    fn is_logarithmic(self) -> bool {
        matches!(self, Parameter::SpotAmplitude | Parameter::SpotLifetime)
    }

    /// The coordinate of its own that samplers move in, of a value; orbits have others
    /// ([`super::ParameterSpace::to_sampling`]).
    pub fn to_sampling(self, value: f64) -> f64 {
        if self.is_logarithmic() { value.ln() } else { value }
    }

    /// The value at that coordinate.
    pub fn to_physical(self, coordinate: f64) -> f64 {
        if self.is_logarithmic() { coordinate.exp() } else { coordinate }
    }

    /// ln of the derivative of the value with respect to that coordinate.
    pub fn log_jacobian(self, value: f64) -> f64 {
        if self.is_logarithmic() { value.ln() } else { 0.0 }
    }

    /// Whether it only shifts whole profiles, so that what a pixel looks like does not depend on it.
    pub fn only_shifts(self) -> bool {
        self.is_orbital() || self == Parameter::Vsys
    }

    /// The parameter of that name.
    pub fn from_name(name: &str) -> Option<Parameter> {
        Parameter::ALL.into_iter().find(|p| p.name() == name)
    }
}

/// Values of all parameters in the units of their names, free or not; index by [`Parameter`]. Those of the surface are
/// NaN where they are not given: they are those of the star's settings then. Those of the field are NaN where no maps
/// are integrated over, the lifetime where spots live for ever. Those of a second planet are NaN where there is none,
/// and those of eccentricity where the orbit is a circle. Periods in days and conjunctions are always NaN: what they
/// stand for is there.
#[derive(Clone, Copy, Debug)]
pub struct ParameterValues(pub [f64; Parameter::ALL.len()]);

impl std::ops::Index<Parameter> for ParameterValues {
    type Output = f64;
    fn index(&self, p: Parameter) -> &f64 {
        &self.0[p as usize]
    }
}

impl std::ops::IndexMut<Parameter> for ParameterValues {
    fn index_mut(&mut self, p: Parameter) -> &mut f64 {
        &mut self.0[p as usize]
    }
}

/// NaN, not given, is the same as NaN.
impl PartialEq for ParameterValues {
    fn eq(&self, other: &Self) -> bool {
        Parameter::ALL.into_iter().all(|p| self.agrees(other, p))
    }
}

impl ParameterValues {
    /// Of the eight parameters of a circular orbit, rotation and systemic velocity; the surface is that of the star's
    /// settings.
    pub fn of_eight(eight: [f64; 8]) -> Self {
        use Parameter::{DOmega, Inclination, K, OmegaEq, Phi, PorbOverProt, Vsini, Vsys};
        let mut values = ParameterValues([f64::NAN; Parameter::ALL.len()]);
        let names = [K, PorbOverProt, Phi, OmegaEq, DOmega, Inclination, Vsini, Vsys];
        names.into_iter().zip(eight).for_each(|(p, value)| values[p] = value);
        values
    }

    /// The value, if it is given.
    pub fn given(&self, p: Parameter) -> Option<f64> {
        (!p.is_optional() || !self[p].is_nan()).then_some(self[p])
    }

    /// Whether both have the same value of a parameter, or both none.
    pub fn agrees(&self, other: &Self, p: Parameter) -> bool {
        self.given(p) == other.given(p)
    }

    /// The orbits.
    pub fn motion(&self) -> Motion {
        let [first, second] = &Elements::PLANETS;
        Motion { first: first.orbit(self), second: self.given(second.k).map(|_| second.orbit(self)) }
    }

    /// The physical state of star and planet they stand for.
    pub fn state(&self) -> StarState {
        StarState {
            rotation: Rotation { omega_eq_rad_d: self[Parameter::OmegaEq], domega_rad_d: self[Parameter::DOmega] },
            inclination: self[Parameter::Inclination].to_radians(),
            vsini_kms: self[Parameter::Vsini],
            vsys_kms: self[Parameter::Vsys],
            motion: self.motion(),
            surface: Surface {
                limb_darkening: self.given(Parameter::LimbDarkening),
                line_sigma_kms: self.given(Parameter::LineSigma),
                equivalent_width_kms: self.given(Parameter::EquivalentWidth),
                contrast: self.given(Parameter::Contrast),
            },
        }
    }
}

/// An object of name and value of those that are given, in the order of [`Parameter::ALL`].
impl Serialize for ParameterValues {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(Parameter::ALL.iter().filter_map(|&p| Some((p.name(), self.given(p)?))))
    }
}

impl<'de> Deserialize<'de> for ParameterValues {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut values = ParameterValues([f64::NAN; Parameter::ALL.len()]);
        for (name, value) in BTreeMap::<String, f64>::deserialize(deserializer)? {
            let parameter = Parameter::from_name(&name);
            values[parameter.ok_or_else(|| D::Error::custom(format!("unknown parameter {name}")))?] = value;
        }
        Ok(values)
    }
}
