//! Which values and which priors each of the parameters may have.

use super::error::Fault;
use super::raw_parts::{PriorKind, PriorSection};
use crate::model::{Parameter, Prior};
use crate::surface::evolving_map;

/// Where a value of the parameter stands in the config.
pub(super) fn key(parameter: Parameter) -> String {
    match parameter {
        _ if parameter.is_orbital() => format!("planet.{}", parameter.name()),
        Parameter::LimbDarkening => "star.limb_darkening.coefficients".into(),
        Parameter::LineSigma => "star.line.sigma_kms".into(),
        Parameter::EquivalentWidth => "star.line.equivalent_width_kms".into(),
        _ if parameter.is_of_field() => format!("imaging.{}", parameter.name()),
        _ => format!("star.{}", parameter.name()),
    }
}

/// Bounds of numbers that no star needs to exceed: beyond them they are slips of the pen, digits of a phase are lost,
/// or the computation has no end.
pub(super) mod most {
    /// Rotation velocity (km/s); velocity axes grow absurdly long beyond it.
    pub const VSINI_KMS: f64 = 2000.0;
    /// Any other velocity (km/s), up or down: that of light.
    pub const VELOCITY_KMS: f64 = 3e5;
    /// Times and periods (d), rotation cycles, and periods over each other: some millions of years.
    pub const TIME: f64 = 1e9;
    /// Angular velocity (rad/d), up or down: a rotation in less than a second.
    pub const OMEGA_RAD_D: f64 = 1e6;
}

/// Whether a number keeps within `most`, up or down.
pub(super) fn check_size(key: &str, value: f64, most: f64) -> Result<(), Fault> {
    match value.abs() <= most {
        true => Ok(()),
        false => Err(Fault::new(key, format!("{value} is beyond sense: at most {most:e}, up or down"))),
    }
}

/// Whether a value makes sense at all, whatever the prior.
pub(super) fn check_value(parameter: Parameter, value: f64, key: &str) -> Result<(), Fault> {
    let (fine, allowed) = match parameter {
        Parameter::K | Parameter::K2 => (value >= 0.0, "0 or more"),
        Parameter::PorbOverProt | Parameter::PorbOverProt2 => (value > 0.0, "above 0"),
        Parameter::Period | Parameter::Period2 | Parameter::OmegaEq => (value > 0.0, "above 0"),
        _ if parameter.is_shape() => (value.abs() < 1.0, "above -1 and below 1"),
        Parameter::SqrtECosOmega | Parameter::SqrtESinOmega => unreachable!("shapes"),
        Parameter::SqrtECosOmega2 | Parameter::SqrtESinOmega2 => unreachable!("shapes"),
        Parameter::Conjunction | Parameter::Conjunction2 => (true, "finite"),
        Parameter::LineSigma | Parameter::EquivalentWidth => (value > 0.0, "above 0"),
        Parameter::LimbDarkening => ((0.0..=1.0).contains(&value), "from 0 to 1"),
        Parameter::Contrast => ((0.0..1.0).contains(&value), "0 or more and below 1"),
        Parameter::Vsini => (value > 0.0 && value <= most::VSINI_KMS, "above 0 and up to 2000"),
        Parameter::Inclination => (value > 0.0 && value <= 90.0, "above 0 and up to 90"),
        Parameter::Phi | Parameter::Phi2 | Parameter::DOmega | Parameter::Vsys => (true, "finite"),
        Parameter::SpotAmplitude | Parameter::SpotSlope | Parameter::SpotLifetime => {
            let (low, high) = evolving_map::bounds(parameter);
            return match (low..=high).contains(&value) {
                true => Ok(()),
                false => Err(Fault::new(key, format!("{value} must be from {low} to {high}"))),
            };
        }
    };
    if !(fine && value.is_finite()) {
        return Err(Fault::new(key, format!("{value} must be {allowed}")));
    }
    match parameter {
        Parameter::K | Parameter::K2 | Parameter::Vsys => check_size(key, value, most::VELOCITY_KMS),
        Parameter::LineSigma | Parameter::EquivalentWidth => check_size(key, value, most::VELOCITY_KMS),
        Parameter::PorbOverProt | Parameter::PorbOverProt2 => check_size(key, value, most::TIME),
        _ if parameter.is_ephemeris() => check_size(key, value, most::TIME),
        Parameter::OmegaEq | Parameter::DOmega => check_size(key, value, most::OMEGA_RAD_D),
        _ => Ok(()),
    }
}

/// Widest bounds of a prior.
fn domain(parameter: Parameter, phi_free: bool) -> (f64, f64) {
    match parameter {
        Parameter::K | Parameter::K2 if !phi_free => (f64::NEG_INFINITY, f64::INFINITY),
        Parameter::K | Parameter::PorbOverProt | Parameter::Period => (0.0, f64::INFINITY),
        Parameter::K2 | Parameter::PorbOverProt2 | Parameter::Period2 => (0.0, f64::INFINITY),
        Parameter::OmegaEq | Parameter::Vsini => (0.0, f64::INFINITY),
        Parameter::SqrtECosOmega | Parameter::SqrtESinOmega => (-1.0, 1.0),
        Parameter::SqrtECosOmega2 | Parameter::SqrtESinOmega2 => (-1.0, 1.0),
        Parameter::Conjunction | Parameter::Conjunction2 => (f64::NEG_INFINITY, f64::INFINITY),
        Parameter::LineSigma | Parameter::EquivalentWidth => (0.0, f64::INFINITY),
        Parameter::Phi | Parameter::Phi2 | Parameter::LimbDarkening | Parameter::Contrast => (0.0, 1.0),
        Parameter::Inclination => (0.0, 90.0),
        Parameter::DOmega | Parameter::Vsys => (f64::NEG_INFINITY, f64::INFINITY),
        Parameter::SpotAmplitude | Parameter::SpotSlope | Parameter::SpotLifetime => evolving_map::bounds(parameter),
    }
}

/// The prior that a section under `parameters` stands for.
pub(super) fn resolve_prior(parameter: Parameter, section: &PriorSection, phi_free: bool) -> Result<Prior, Fault> {
    let reader = Reader { parameter, section, phi_free };
    let kind = section.prior;
    reader.check_kind()?;
    match kind {
        PriorKind::Periodic => {
            reader.refuse(&["min", "max", "mean", "sd"])?;
            Ok(Prior::Periodic)
        }
        PriorKind::Uniform => {
            reader.refuse(&["mean", "sd"])?;
            let (min, max) = reader.bounds(reader.needed("min")?, reader.needed("max")?)?;
            Ok(Prior::Uniform { min, max })
        }
        PriorKind::LogUniform => {
            reader.refuse(&["mean", "sd"])?;
            let (min, max) = reader.bounds(reader.needed("min")?, reader.needed("max")?)?;
            match min > 0.0 {
                true => Ok(Prior::LogUniform { min, max }),
                false => Err(reader.fault("min", format!("{min} must be above 0 for a log-uniform prior"))),
            }
        }
        PriorKind::Isotropic => {
            reader.refuse(&["mean", "sd"])?;
            let (min, max) = reader.bounds(section.min.unwrap_or(0.0), section.max.unwrap_or(90.0))?;
            Ok(Prior::Isotropic { min, max })
        }
        PriorKind::Normal => reader.normal(),
        PriorKind::UnitDisc => {
            reader.refuse(&["min", "mean", "sd"])?;
            let max_eccentricity = section.max.unwrap_or(1.0);
            match max_eccentricity > 0.0 && max_eccentricity <= 1.0 {
                true => Ok(Prior::Disc { max_eccentricity }),
                false => Err(reader.fault("max", format!("{max_eccentricity} must be above 0 and up to 1"))),
            }
        }
    }
}

struct Reader<'a> {
    parameter: Parameter,
    section: &'a PriorSection,
    phi_free: bool,
}

impl Reader<'_> {
    fn fault(&self, field: &str, problem: impl Into<String>) -> Fault {
        Fault::new(format!("parameters.{}.{field}", self.parameter.name()), problem)
    }

    fn field(&self, name: &str) -> Option<f64> {
        match name {
            "min" => self.section.min,
            "max" => self.section.max,
            "mean" => self.section.mean,
            _ => self.section.sd,
        }
    }

    fn kind_name(&self) -> &'static str {
        match self.section.prior {
            PriorKind::Uniform => "uniform",
            PriorKind::LogUniform => "log-uniform",
            PriorKind::Normal => "normal",
            PriorKind::Isotropic => "isotropic",
            PriorKind::Periodic => "periodic",
            PriorKind::UnitDisc => "unit-disc",
        }
    }

    fn check_kind(&self) -> Result<(), Fault> {
        let only = match (self.section.prior, self.parameter) {
            (PriorKind::Isotropic, p) if p != Parameter::Inclination => {
                "an isotropic prior is for inclination_deg only"
            }
            (PriorKind::Periodic, p) if !p.is_phase() => "a periodic prior is for phi only",
            (PriorKind::Normal | PriorKind::LogUniform, p) if p.is_phase() => "phi takes a periodic or a uniform prior",
            (PriorKind::UnitDisc, p) if !p.is_shape() => {
                "a unit-disc prior is for sqrt_e_cos_omega and sqrt_e_sin_omega only"
            }
            (kind, p) if p.is_shape() && kind != PriorKind::UnitDisc => {
                "sqrt_e_cos_omega and sqrt_e_sin_omega take a unit-disc prior"
            }
            (PriorKind::LogUniform, Parameter::Conjunction | Parameter::Conjunction2) => {
                "the time of a conjunction takes a normal or a uniform prior"
            }
            _ => return Ok(()),
        };
        Err(self.fault("prior", only))
    }

    fn needed(&self, name: &str) -> Result<f64, Fault> {
        self.field(name).ok_or_else(|| self.fault(name, format!("missing, a {} prior needs it", self.kind_name())))
    }

    fn refuse(&self, names: &[&str]) -> Result<(), Fault> {
        match names.iter().find(|name| self.field(name).is_some()) {
            Some(name) => Err(self.fault(name, format!("not for this prior ({})", self.kind_name()))),
            None => Ok(()),
        }
    }

    /// Bounds in the right order, a finite distance apart if they are finite, and within the domain.
    fn bounds(&self, min: f64, max: f64) -> Result<(f64, f64), Fault> {
        let (lowest, highest) = domain(self.parameter, self.phi_free);
        if min < lowest {
            let why =
                if self.parameter.is_amplitude() { " while phi is free: -K at phi is K at phi + 0.5" } else { "" };
            return Err(self.fault("min", format!("{min} must not be below {lowest}{why}")));
        }
        if max > highest {
            return Err(self.fault("max", format!("{max} must not be above {highest}")));
        }
        if min >= max {
            return Err(self.fault("min", format!("{min} must be below max, which is {max}")));
        }
        if min.is_finite() && max.is_finite() && !(max - min).is_finite() {
            return Err(self.fault("max", format!("{max} is too far from min, {min}")));
        }
        Ok((min, max))
    }

    fn normal(&self) -> Result<Prior, Fault> {
        const FARTHEST: f64 = 30.0;
        let (mean, sd) = (self.needed("mean")?, self.needed("sd")?);
        if sd <= 0.0 {
            return Err(self.fault("sd", format!("{sd} must be above 0")));
        }
        let (lowest, highest) = domain(self.parameter, self.phi_free);
        let (min, max) = self.bounds(self.section.min.unwrap_or(lowest), self.section.max.unwrap_or(highest))?;
        let distance = (mean - mean.clamp(min, max)).abs() / sd;
        let (low, high) = ((min - mean) / sd, (max - mean) / sd);
        // Not `distance > FARTHEST`: an overflow to NaN is as useless as a bound too far away.
        if !(distance <= FARTHEST && low < high) {
            let problem = format!("{mean} is more than {FARTHEST} sd outside the bounds [{min}, {max}]");
            return Err(self.fault("mean", problem));
        }
        Ok(Prior::Normal { mean, sd, min, max })
    }
}
