//! The parameters that may be sampled, and their table: one row each, with all its properties.
//!
//! Config, checks, schema, tables, plots, exports, sampling coordinates and numerical derivatives read it. A parameter
//! is added as a variant of [`Parameter`], a row in the same place of [`PARAMETERS`], and its field in
//! [`super::values`].

use super::prior::PriorKind::{self, Isotropic, LogUniform, Normal, Periodic, Uniform, UnitDisc};
use super::values::{Element, FieldValues, StarValues};
use crate::star::Surface;
use serde::{Deserialize, Serialize};
use std::ops::Bound;

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
    /// Width of the line of active regions, before the spectrograph, over that of the photosphere's.
    RegionLineWidth,
    /// Its equivalent width over that of the photosphere's.
    RegionEquivalentWidth,
    /// Its velocity (km/s) over that of the photosphere.
    RegionShift,
    /// Area with this line per unit of the spots' filling factor.
    RegionArea,
    /// Its increase at the limb.
    RegionAreaLimb,
    /// Additional darkening of spots and their surroundings at the limb.
    RegionDimmingLimb,
    /// Prior standard deviation of the spot filling factor, under a marginal likelihood.
    SpotAmplitude,
    /// Power-law index of the spots' spectrum there.
    SpotSlope,
    /// Lifetime of the spots there (d).
    SpotLifetime,
}

/// A parameter.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// Which.
    pub parameter: Parameter,
    /// Its name in config, chain, tables and plots, which ends with the unit.
    pub key: &'static str,
    /// Unit of its values; `1` for a ratio.
    pub unit: &'static str,
    /// Its symbol, in LaTeX without dollars.
    pub latex: &'static str,
    /// The same in figures: cursive between asterisks, an index in `_{}`.
    pub symbol: &'static str,
    /// Its description among the free parameters.
    pub about: &'static str,
    /// Its description in one line below tables, where its name is not enough.
    pub definition: Option<&'static str>,
    /// Path of its value in the config.
    pub config_key: &'static str,
    /// Description of the value there, in a section that is made from this table.
    pub about_value: &'static str,
    /// Its domain.
    pub values: Interval,
    /// Size beyond which a value is a typing error, see [`most`].
    pub most: f64,
    /// Widest bounds of a prior.
    pub widest: (f64, f64),
    /// Kinds of priors that it may have.
    pub priors: &'static [PriorKind],
    /// Kind of the prior, over the widest bounds, where the config leaves it to the profiles.
    pub usual_prior: Option<PriorKind>,
    /// Its value where none is given.
    pub usual: Option<f64>,
    /// The coordinate that samplers move in.
    pub scale: Scale,
    /// Step in that coordinate over which profiles change by about a percent of their features: the scale of searches
    /// and first trust regions.
    pub step: Step,
    /// Step of the derivatives of profiles with respect to it.
    pub difference: Step,
    /// Its owner, and its element there.
    pub role: Role,
}

/// An interval with closed or open ends.
pub type Interval = (Bound<f64>, Bound<f64>);

/// The coordinate that samplers move in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// The value itself.
    Linear,
    /// Its logarithm.
    Logarithmic,
}

/// The size of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// This size.
    Fixed(f64),
    /// This fraction of the value.
    Relative(f64),
    /// This multiple of the angular velocity that turns a map by a hundredth of a radian in half the time of its
    /// observation.
    Turn(f64),
    /// That of a period over the rotation period: this fraction of an orbit in half the time base.
    Ratio(f64),
    /// The same of a period in days.
    Period(f64),
    /// This fraction of an orbit, in days.
    Time(f64),
}

/// The owner of a parameter, with access to its value there.
#[derive(Clone, Copy, Debug)]
pub enum Role {
    /// The orbit of planet 0 or 1.
    Orbit(usize, Element),
    /// Rotation, geometry and velocity of the star, which are always given.
    Star(fn(&StarValues) -> &f64, fn(&mut StarValues, f64)),
    /// The surface: replaces one of the star's settings, where given.
    Surface(fn(&Surface) -> Option<&f64>, fn(&mut Surface, f64)),
    /// The field of spots that is marginalised over.
    Field(fn(&FieldValues) -> Option<&f64>, fn(&mut FieldValues, f64)),
}

/// Angular velocity (rad/d) that turns a map by a hundredth of a radian in that time.
pub fn turning(time_d: f64) -> f64 {
    0.01 / time_d
}

/// Bounds that no star exceeds: beyond them values are typing errors, digits of a phase are lost, or computations
/// become endless.
pub mod most {
    /// Rotation velocity (km/s); velocity axes become too long beyond it.
    pub const VSINI_KMS: f64 = 2000.0;
    /// Any other velocity (km/s), up or down: that of light.
    pub const VELOCITY_KMS: f64 = 3e5;
    /// Times and periods (d), rotation cycles, and periods over each other: some millions of years.
    pub const TIME: f64 = 1e9;
    /// Angular velocity (rad/d), up or down: a rotation in less than a second.
    pub const OMEGA_RAD_D: f64 = 1e6;
}

const INFINITE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
const POSITIVE: (f64, f64) = (0.0, f64::INFINITY);
const ABOVE_0: Interval = (Bound::Excluded(0.0), Bound::Unbounded);
const ANY: Interval = (Bound::Unbounded, Bound::Unbounded);

const fn from_to((low, high): (f64, f64)) -> Interval {
    (Bound::Included(low), Bound::Included(high))
}

/// Defaults of a row: a positive parameter of the star.
const PLAIN: Spec = Spec {
    parameter: Parameter::K,
    key: "",
    unit: "1",
    latex: "",
    symbol: "",
    about: "",
    definition: None,
    config_key: "",
    about_value: "",
    values: ABOVE_0,
    most: f64::INFINITY,
    widest: POSITIVE,
    priors: &[Uniform, LogUniform, Normal],
    usual_prior: None,
    usual: None,
    scale: Scale::Linear,
    step: Step::Fixed(0.02),
    difference: Step::Relative(1e-3),
    role: Role::Orbit(0, Element::Amplitude),
};

const AMPLITUDE: Spec = Spec {
    unit: "km/s",
    values: (Bound::Included(0.0), Bound::Unbounded),
    most: most::VELOCITY_KMS,
    usual: Some(0.0),
    ..PLAIN
};

const RATIO: Spec = Spec { most: most::TIME, step: Step::Ratio(0.02), ..PLAIN };

const PERIOD: Spec = Spec { unit: "d", most: most::TIME, step: Step::Period(0.02), ..PLAIN };

const PHASE: Spec = Spec {
    unit: "cycles",
    definition: Some("time from star.epoch_d to the next RV maximum, in orbital cycles"),
    values: ANY,
    widest: (0.0, 1.0),
    priors: &[Periodic, Uniform],
    usual: Some(0.0),
    ..PLAIN
};

const CONJUNCTION: Spec = Spec {
    unit: "d",
    definition: Some("time (d) of the inferior conjunction (planet in front) that its prior is on"),
    values: ANY,
    most: most::TIME,
    widest: INFINITE,
    priors: &[Uniform, Normal],
    step: Step::Time(0.02),
    ..PLAIN
};

const SHAPE: Spec = Spec {
    definition: Some("of eccentricity e and argument of periastron omega of the star's orbit"),
    values: (Bound::Excluded(-1.0), Bound::Excluded(1.0)),
    widest: (-1.0, 1.0),
    priors: &[UnitDisc],
    step: Step::Fixed(0.05),
    ..PLAIN
};

/// A parameter of active regions within these bounds, with this value for spots that are merely dimmed photosphere.
const fn region(bounds: (f64, f64), plain: f64) -> Spec {
    Spec {
        values: from_to(bounds),
        widest: bounds,
        usual: Some(plain),
        step: Step::Fixed(0.05),
        difference: Step::Fixed(0.02),
        ..PLAIN
    }
}

/// A parameter of the field within these bounds.
const fn field(bounds: (f64, f64), usual: f64, usual_prior: PriorKind) -> Spec {
    Spec {
        values: from_to(bounds),
        widest: bounds,
        usual: Some(usual),
        usual_prior: Some(usual_prior),
        step: Step::Fixed(0.05),
        ..PLAIN
    }
}

/// All parameters, in the order of [`Parameter`], of every table and chain.
pub const PARAMETERS: [Spec; 32] = [
    Spec {
        parameter: Parameter::K,
        key: "k_kms",
        latex: "K",
        symbol: "*K*",
        about: "Semi-amplitude of the planet's orbit (km/s).",
        config_key: "planet.k_kms",
        about_value: "Semi-amplitude of the star's radial velocity (km/s), 0 or more.",
        role: Role::Orbit(0, Element::Amplitude),
        ..AMPLITUDE
    },
    Spec {
        parameter: Parameter::PorbOverProt,
        key: "porb_over_prot",
        latex: r"P_\mathrm{orb}/P_\mathrm{rot}",
        symbol: "*P*_{orb}/*P*_{rot}",
        about: "Orbital period over the rotation period.",
        config_key: "planet.porb_over_prot",
        about_value: "Orbital period over the rotation period, above 0.",
        usual: Some(2.0),
        role: Role::Orbit(0, Element::Ratio),
        ..RATIO
    },
    Spec {
        parameter: Parameter::Period,
        key: "period_d",
        latex: r"P_\mathrm{orb}",
        symbol: "*P*_{orb}",
        about: "Orbital period (d), in place of `porb_over_prot`.",
        config_key: "planet.period_d",
        about_value: "Orbital period (d), above 0, in place of `porb_over_prot`.",
        role: Role::Orbit(0, Element::Period),
        ..PERIOD
    },
    Spec {
        parameter: Parameter::Phi,
        key: "phi",
        latex: r"\phi",
        symbol: "*φ*",
        about: "Orbital phase (cycles): the part of an orbit from `star.epoch_d` to the next maximum of the star's \
                radial\nvelocity.",
        config_key: "planet.phi",
        about_value: "Orbital phase (cycles, 0 to 1): the part of an orbit from `star.epoch_d` (rotation cycle 0) to \
                      the next maximum\nof the star's radial velocity. `phi` = 0 is a maximum at `star.epoch_d`.",
        role: Role::Orbit(0, Element::Phase),
        ..PHASE
    },
    Spec {
        parameter: Parameter::Conjunction,
        key: "t_conjunction_d",
        latex: r"T_\mathrm{conj}",
        symbol: "*T*_{conj}",
        about: "Time of one inferior conjunction (planet in front; d, on the time scale of the observations), in \
                place of `phi`.\nA normal prior is an ephemeris: at the time of the data its phase must be known to \
                a tenth of an orbit.",
        config_key: "planet.t_conjunction_d",
        about_value: "Time of an inferior conjunction (planet in front; d, on the time scale of the observations), in \
                      place of `phi`.",
        role: Role::Orbit(0, Element::Conjunction),
        ..CONJUNCTION
    },
    Spec {
        parameter: Parameter::SqrtECosOmega,
        key: "sqrt_e_cos_omega",
        latex: r"\sqrt{e} \cos \omega",
        symbol: "√*e* cos *ω*",
        about: "Square root of the eccentricity e times the cosine of the argument of periastron omega of the star's \
                orbit; free\nwith `sqrt_e_sin_omega`, both with a unit-disc prior.",
        config_key: "planet.sqrt_e_cos_omega",
        about_value: "Square root of the eccentricity e times the cosine of the argument of periastron omega of the \
                      star's orbit; a\ncircle if not given.",
        role: Role::Orbit(0, Element::ShapeCos),
        ..SHAPE
    },
    Spec {
        parameter: Parameter::SqrtESinOmega,
        key: "sqrt_e_sin_omega",
        latex: r"\sqrt{e} \sin \omega",
        symbol: "√*e* sin *ω*",
        about: "The same with the sine.",
        config_key: "planet.sqrt_e_sin_omega",
        about_value: "The same with the sine.",
        role: Role::Orbit(0, Element::ShapeSin),
        ..SHAPE
    },
    Spec {
        parameter: Parameter::K2,
        key: "k2_kms",
        latex: "K_2",
        symbol: "*K*_{2}",
        about: "Semi-amplitude of the orbit of a second planet (km/s).",
        config_key: "planet.k2_kms",
        about_value: "Semi-amplitude of the star's radial velocity by a second planet (km/s), 0 or more; without any \
                      key of its there\nis none.",
        role: Role::Orbit(1, Element::Amplitude),
        ..AMPLITUDE
    },
    Spec {
        parameter: Parameter::PorbOverProt2,
        key: "porb2_over_prot",
        latex: r"P_{\mathrm{orb},2}/P_\mathrm{rot}",
        symbol: "*P*_{orb,2}/*P*_{rot}",
        about: "Orbital period of the second planet over the rotation period.",
        config_key: "planet.porb2_over_prot",
        about_value: "Orbital period of the second planet over the rotation period, above 0.",
        role: Role::Orbit(1, Element::Ratio),
        ..RATIO
    },
    Spec {
        parameter: Parameter::Period2,
        key: "period2_d",
        latex: r"P_{\mathrm{orb},2}",
        symbol: "*P*_{orb,2}",
        about: "Orbital period of the second planet (d), in place of `porb2_over_prot`.",
        config_key: "planet.period2_d",
        about_value: "Orbital period of the second planet (d), in place of `porb2_over_prot`.",
        role: Role::Orbit(1, Element::Period),
        ..PERIOD
    },
    Spec {
        parameter: Parameter::Phi2,
        key: "phi2",
        latex: r"\phi_2",
        symbol: "*φ*_{2}",
        about: "Orbital phase of the second planet (cycles), as `phi`.",
        config_key: "planet.phi2",
        about_value: "Orbital phase of the second planet (cycles), as `phi`; 0 if not given.",
        role: Role::Orbit(1, Element::Phase),
        ..PHASE
    },
    Spec {
        parameter: Parameter::Conjunction2,
        key: "t_conjunction2_d",
        latex: r"T_{\mathrm{conj},2}",
        symbol: "*T*_{conj,2}",
        about: "Time of one inferior conjunction of the second planet (d), as `t_conjunction_d`.",
        config_key: "planet.t_conjunction2_d",
        about_value: "Time of an inferior conjunction of the second planet (d), in place of `phi2`.",
        role: Role::Orbit(1, Element::Conjunction),
        ..CONJUNCTION
    },
    Spec {
        parameter: Parameter::SqrtECosOmega2,
        key: "sqrt_e2_cos_omega2",
        latex: r"\sqrt{e_2} \cos \omega_2",
        symbol: "√*e*_{2} cos *ω*_{2}",
        about: "Of the second planet's orbit, as `sqrt_e_cos_omega`.",
        config_key: "planet.sqrt_e2_cos_omega2",
        about_value: "Of the second planet's orbit, as `sqrt_e_cos_omega`.",
        role: Role::Orbit(1, Element::ShapeCos),
        ..SHAPE
    },
    Spec {
        parameter: Parameter::SqrtESinOmega2,
        key: "sqrt_e2_sin_omega2",
        latex: r"\sqrt{e_2} \sin \omega_2",
        symbol: "√*e*_{2} sin *ω*_{2}",
        about: "Of the second planet's orbit, as `sqrt_e_sin_omega`.",
        config_key: "planet.sqrt_e2_sin_omega2",
        about_value: "Of the second planet's orbit, as `sqrt_e_sin_omega`.",
        role: Role::Orbit(1, Element::ShapeSin),
        ..SHAPE
    },
    Spec {
        parameter: Parameter::OmegaEq,
        key: "omega_eq_rad_d",
        unit: "rad/d",
        latex: r"\Omega_\mathrm{eq}",
        symbol: "*Ω*_{eq}",
        about: "Angular velocity of the equator (rad/d).",
        config_key: "star.omega_eq_rad_d",
        most: most::OMEGA_RAD_D,
        step: Step::Turn(1.0),
        difference: Step::Turn(1.0),
        role: Role::Star(|star| &star.omega_eq_rad_d, |star, x| star.omega_eq_rad_d = x),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::DOmega,
        key: "domega_rad_d",
        unit: "rad/d",
        latex: r"\mathrm{d}\Omega",
        symbol: "d*Ω*",
        about: "Angular velocity of the equator minus that of the pole (rad/d).",
        config_key: "star.domega_rad_d",
        values: ANY,
        most: most::OMEGA_RAD_D,
        widest: INFINITE,
        step: Step::Turn(3.0),
        difference: Step::Turn(3.0),
        role: Role::Star(|star| &star.domega_rad_d, |star, x| star.domega_rad_d = x),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::Inclination,
        key: "inclination_deg",
        unit: "deg",
        latex: "i",
        symbol: "*i*",
        about: "Inclination (degrees).",
        config_key: "star.inclination_deg",
        values: (Bound::Excluded(0.0), Bound::Included(90.0)),
        widest: (0.0, 90.0),
        priors: &[Uniform, LogUniform, Normal, Isotropic],
        step: Step::Fixed(0.5),
        difference: Step::Fixed(0.5),
        role: Role::Star(|star| &star.inclination_deg, |star, x| star.inclination_deg = x),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::Vsini,
        key: "vsini_kms",
        unit: "km/s",
        latex: r"v \sin i",
        symbol: "*v* sin *i*",
        about: "Projected equatorial rotation velocity (km/s).",
        config_key: "star.vsini_kms",
        values: (Bound::Excluded(0.0), Bound::Included(most::VSINI_KMS)),
        step: Step::Relative(5e-4),
        role: Role::Star(|star| &star.vsini_kms, |star, x| star.vsini_kms = x),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::Vsys,
        key: "vsys_kms",
        unit: "km/s",
        latex: r"v_\mathrm{sys}",
        symbol: "*v*_{sys}",
        about: "Systemic radial velocity (km/s).",
        config_key: "star.vsys_kms",
        values: ANY,
        most: most::VELOCITY_KMS,
        widest: INFINITE,
        role: Role::Star(|star| &star.vsys_kms, |star, x| star.vsys_kms = x),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::LimbDarkening,
        key: "limb_darkening",
        latex: "u",
        symbol: "*u*",
        about: "First coefficient of the limb darkening, 0 to 1.",
        config_key: "star.limb_darkening.coefficients",
        values: from_to((0.0, 1.0)),
        widest: (0.0, 1.0),
        step: Step::Fixed(0.01),
        // the model is smooth in those of the surface, except for 1e-7 where a narrower line needs another velocity
        // grid
        difference: Step::Fixed(0.02),
        role: Role::Surface(|surface| surface.limb_darkening.as_ref(), |surface, x| surface.limb_darkening = Some(x)),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::LineSigma,
        key: "line_sigma_kms",
        unit: "km/s",
        latex: r"\sigma_\mathrm{line}",
        symbol: "*σ*_{line}",
        about: "Standard deviation of the local line (km/s), before the spectrograph.",
        config_key: "star.line.sigma_kms",
        most: most::VELOCITY_KMS,
        step: Step::Relative(0.01),
        difference: Step::Relative(0.02),
        role: Role::Surface(|surface| surface.line_sigma_kms.as_ref(), |surface, x| surface.line_sigma_kms = Some(x)),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::EquivalentWidth,
        key: "equivalent_width_kms",
        unit: "km/s",
        latex: r"W_\mathrm{line}",
        symbol: "*W*_{line}",
        about: "Equivalent width of the local line (km/s): a scale of the depth of all profiles, distinguished from \
        a nuisance per\nprofile by the priors alone.",
        config_key: "star.line.equivalent_width_kms",
        most: most::VELOCITY_KMS,
        step: Step::Relative(2e-3),
        difference: Step::Relative(0.02),
        role: Role::Surface(
            |surface| surface.equivalent_width_kms.as_ref(),
            |surface, x| surface.equivalent_width_kms = Some(x),
        ),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::Contrast,
        key: "contrast",
        latex: "c",
        symbol: "*c*",
        about: "Brightness of a spot over that of the photosphere, 0 to 1. The data give an upper limit only: \
        darker spots\ncover less area, so that a flat prior ends at 0.",
        config_key: "star.contrast",
        values: (Bound::Included(0.0), Bound::Excluded(1.0)),
        widest: (0.0, 1.0),
        difference: Step::Fixed(0.02),
        role: Role::Surface(|surface| surface.contrast.as_ref(), |surface, x| surface.contrast = Some(x)),
        ..PLAIN
    },
    Spec {
        parameter: Parameter::RegionLineWidth,
        key: "region_line_width",
        latex: r"w_\mathrm{r}",
        symbol: "*w*_{r}",
        about: "Width of the line of active regions, before the spectrograph, over that of the photosphere's.",
        config_key: "star.regions.line_width",
        role: Role::Surface(
            |surface| surface.region_line_width.as_ref(),
            |surface, x| surface.region_line_width = Some(x),
        ),
        ..region((0.5, 2.0), 1.0)
    },
    Spec {
        parameter: Parameter::RegionEquivalentWidth,
        key: "region_equivalent_width",
        latex: r"W_\mathrm{r}/W",
        symbol: "*W*_{r}/*W*",
        about: "Equivalent width of the line of active regions over that of the photosphere's.",
        config_key: "star.regions.equivalent_width",
        role: Role::Surface(
            |surface| surface.region_equivalent_width.as_ref(),
            |surface, x| surface.region_equivalent_width = Some(x),
        ),
        ..region((0.3, 3.0), 1.0)
    },
    Spec {
        parameter: Parameter::RegionShift,
        key: "region_shift_kms",
        unit: "km/s",
        latex: r"v_\mathrm{r}",
        symbol: "*v*_{r}",
        about: "Velocity of the line of active regions over that of the photosphere (km/s), positive to the red.",
        config_key: "star.regions.shift_kms",
        priors: &[Uniform, Normal],
        role: Role::Surface(
            |surface| surface.region_shift_kms.as_ref(),
            |surface, x| surface.region_shift_kms = Some(x),
        ),
        ..region((-3.0, 3.0), 0.0)
    },
    Spec {
        parameter: Parameter::RegionArea,
        key: "region_area",
        latex: r"F",
        symbol: "*F*",
        about: "Surface with the line of active regions per unit spot filling factor.",
        config_key: "star.regions.area",
        priors: &[Uniform, Normal],
        role: Role::Surface(|surface| surface.region_area.as_ref(), |surface, x| surface.region_area = Some(x)),
        ..region((0.0, 20.0), 0.0)
    },
    Spec {
        parameter: Parameter::RegionAreaLimb,
        key: "region_area_limb",
        latex: r"F_1",
        symbol: "*F*_{1}",
        about: "Increase of that surface towards the limb: limb minus disc centre.",
        config_key: "star.regions.area_limb",
        priors: &[Uniform, Normal],
        role: Role::Surface(
            |surface| surface.region_area_limb.as_ref(),
            |surface, x| surface.region_area_limb = Some(x),
        ),
        ..region((-20.0, 20.0), 0.0)
    },
    Spec {
        parameter: Parameter::RegionDimmingLimb,
        key: "region_dimming_limb",
        latex: r"q_1",
        symbol: "*q*_{1}",
        about: "Limb dimming of active regions: one minus their brightness, limb minus disc centre.",
        config_key: "star.regions.dimming_limb",
        priors: &[Uniform, Normal],
        role: Role::Surface(
            |surface| surface.region_dimming_limb.as_ref(),
            |surface, x| surface.region_dimming_limb = Some(x),
        ),
        ..region((-3.0, 3.0), 0.0)
    },
    Spec {
        parameter: Parameter::SpotAmplitude,
        key: "spot_amplitude",
        latex: r"\sigma_\mathrm{spot}",
        symbol: "*σ*_{spot}",
        about: "Prior standard deviation of the spot filling factor, with objective \
                \"marginal-likelihood\".",
        config_key: "imaging.spot_amplitude",
        scale: Scale::Logarithmic,
        role: Role::Field(|field| Some(&field.amplitude), |field, x| field.amplitude = x),
        ..field((0.01, 1.5), 0.2, LogUniform)
    },
    Spec {
        parameter: Parameter::SpotSlope,
        key: "spot_slope",
        latex: r"\alpha_\mathrm{spot}",
        symbol: "*α*_{spot}",
        about: "Power-law index of the angular power spectrum of the spots in l(l+1): the variance of a \
                harmonic falls as l^(-2 index). With objective \"marginal-likelihood\".",
        config_key: "imaging.spot_slope",
        role: Role::Field(|field| Some(&field.slope), |field, x| field.slope = x),
        ..field((0.0, 3.0), 1.5, Uniform)
    },
    Spec {
        parameter: Parameter::SpotLifetime,
        key: "spot_lifetime_d",
        unit: "d",
        latex: r"\tau_\mathrm{spot}",
        symbol: "*τ*_{spot}",
        about: "Spot lifetime (d), with objective \"marginal-likelihood\".",
        config_key: "imaging.spot_lifetime_d",
        scale: Scale::Logarithmic,
        step: Step::Fixed(0.1),
        role: Role::Field(|field| field.lifetime_d.as_ref(), |field, x| field.lifetime_d = Some(x)),
        ..field((0.3, 3000.0), 36.0, LogUniform)
    },
];

impl Parameter {
    /// All of them, in order.
    pub const ALL: [Parameter; PARAMETERS.len()] = {
        let mut all = [Parameter::K; PARAMETERS.len()];
        let mut i = 0;
        while i < all.len() {
            all[i] = PARAMETERS[i].parameter;
            i += 1;
        }
        all
    };

    /// Those of the field of spots that is marginalised over.
    pub const FIELD: [Parameter; 3] = [Parameter::SpotAmplitude, Parameter::SpotSlope, Parameter::SpotLifetime];

    /// Those of active regions.
    pub const REGIONS: [Parameter; 6] = [
        Parameter::RegionLineWidth,
        Parameter::RegionEquivalentWidth,
        Parameter::RegionShift,
        Parameter::RegionArea,
        Parameter::RegionAreaLimb,
        Parameter::RegionDimmingLimb,
    ];

    /// Its row of the table.
    pub const fn spec(self) -> &'static Spec {
        &PARAMETERS[self as usize]
    }

    /// The name used in config, chain, tables and plots.
    pub fn name(self) -> &'static str {
        self.spec().key
    }

    /// Unit of its values; `1` for a ratio.
    pub fn unit(self) -> &'static str {
        self.spec().unit
    }

    /// Its symbol, in LaTeX without dollars.
    pub fn latex(self) -> &'static str {
        self.spec().latex
    }

    /// Widest bounds of its prior.
    pub const fn widest(self) -> (f64, f64) {
        self.spec().widest
    }

    /// Its value where none is given.
    ///
    /// # Panics
    /// If the table has none.
    pub const fn usual(self) -> f64 {
        self.spec().usual.expect("a usual value")
    }

    /// Its element of an orbit.
    fn element(self) -> Option<Element> {
        match self.spec().role {
            Role::Orbit(_, element) => Some(element),
            _ => None,
        }
    }

    /// Whether it belongs to a planet's orbit.
    pub fn is_orbital(self) -> bool {
        self.element().is_some()
    }

    /// Whether it is a phase of an orbit, which has period 1.
    pub fn is_phase(self) -> bool {
        self.element() == Some(Element::Phase)
    }

    /// Whether it is one of the two of eccentricity and periastron.
    pub fn is_shape(self) -> bool {
        matches!(self.element(), Some(Element::ShapeCos | Element::ShapeSin))
    }

    /// Whether it is a semi-amplitude.
    pub fn is_amplitude(self) -> bool {
        self.element() == Some(Element::Amplitude)
    }

    /// Whether it replaces another parameter, in other units: only its name is free, and [`super::ParameterValues`]
    /// store the other.
    pub fn is_ephemeris(self) -> bool {
        matches!(self.element(), Some(Element::Period | Element::Conjunction))
    }

    /// Whether it replaces one of the star's settings.
    pub fn is_surface(self) -> bool {
        matches!(self.spec().role, Role::Surface(..))
    }

    /// Whether it is a hyperparameter of the spots under a marginal likelihood.
    pub fn is_of_field(self) -> bool {
        matches!(self.spec().role, Role::Field(..))
    }

    /// Whether values of all parameters may lack it.
    pub fn is_optional(self) -> bool {
        match self.spec().role {
            Role::Orbit(planet, Element::Amplitude | Element::Ratio | Element::Phase) => planet > 0,
            Role::Star(..) => false,
            Role::Orbit(..) | Role::Surface(..) | Role::Field(..) => true,
        }
    }

    /// Whether samplers move in its logarithm.
    fn is_logarithmic(self) -> bool {
        self.spec().scale == Scale::Logarithmic
    }

    /// The sampling coordinate of a single value; orbits have others ([`super::ParameterSpace::to_sampling`]).
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

    /// Whether it only shifts whole profiles, so that the line of a pixel does not depend on it.
    pub fn only_shifts(self) -> bool {
        self.is_orbital() || self == Parameter::Vsys
    }

    /// Whether it is one of the parameters of the star that change profiles by more than a shift.
    pub fn is_stellar(self) -> bool {
        !self.only_shifts() && !self.is_of_field()
    }

    /// The parameter of that name.
    pub fn from_name(name: &str) -> Option<Parameter> {
        Parameter::ALL.into_iter().find(|p| p.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_parameter_has_its_row_and_a_name_of_its_own() {
        for (place, row) in PARAMETERS.iter().enumerate() {
            assert_eq!(row.parameter as usize, place, "{}", row.key);
            assert_eq!(Parameter::from_name(row.key), Some(row.parameter));
            assert!(!row.latex.is_empty() && row.about.ends_with('.') && row.config_key.contains('.'), "{}", row.key);
        }
        let symbols: BTreeSet<&str> = PARAMETERS.iter().map(|row| row.latex).collect();
        assert_eq!(symbols.len(), PARAMETERS.len());
        let field: Vec<Parameter> = Parameter::ALL.into_iter().filter(|p| p.is_of_field()).collect();
        assert_eq!(field, Parameter::FIELD);
    }
}
