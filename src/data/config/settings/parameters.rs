//! Which values and which priors each of the parameters may have.

use super::checks::check_size;
use crate::data::config::error::Fault;
use crate::data::config::written::PriorSection;
use crate::model::parameters::{Interval, Spec};
use crate::model::{Parameter, Prior, PriorKind};
use std::ops::{Bound, RangeBounds};

/// Whether a value is valid, whatever the prior.
pub(super) fn check_value(parameter: Parameter, value: f64, key: &str) -> Result<(), Fault> {
    let Spec { values, most, .. } = parameter.spec();
    match values.contains(&value) && value.is_finite() {
        true => check_size(key, value, *most),
        false => Err(Fault::new(key, format!("{value} must be {}", words(values)))),
    }
}

fn words(interval: &Interval) -> String {
    let low = match interval.0 {
        Bound::Included(low) => Some(format!("{low} or more")),
        Bound::Excluded(low) => Some(format!("above {low}")),
        Bound::Unbounded => None,
    };
    let high = match interval.1 {
        Bound::Included(high) => Some(format!("up to {high}")),
        Bound::Excluded(high) => Some(format!("below {high}")),
        Bound::Unbounded => None,
    };
    match (interval, low, high) {
        ((Bound::Included(low), Bound::Included(high)), ..) => format!("from {low} to {high}"),
        (_, Some(low), Some(high)) => format!("{low} and {high}"),
        (_, low, high) => low.or(high).unwrap_or("finite".into()),
    }
}

/// Widest bounds of a prior.
fn domain(parameter: Parameter, phi_free: bool) -> (f64, f64) {
    match parameter.is_amplitude() && !phi_free {
        true => (f64::NEG_INFINITY, f64::INFINITY),
        false => parameter.widest(),
    }
}

/// The prior given by a section under `parameters`.
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

    fn check_kind(&self) -> Result<(), Fault> {
        let (kind, takes) = (self.section.prior, self.parameter.spec().priors);
        if takes.contains(&kind) {
            return Ok(());
        }
        let only = match kind {
            PriorKind::Isotropic => "an isotropic prior is for inclination_deg only",
            PriorKind::Periodic => "a periodic prior is for phi only",
            PriorKind::UnitDisc => "a unit-disc prior is for sqrt_e_cos_omega and sqrt_e_sin_omega only",
            _ if takes.contains(&PriorKind::Periodic) => "phi takes a periodic or a uniform prior",
            _ if takes.contains(&PriorKind::UnitDisc) => "sqrt_e_cos_omega and sqrt_e_sin_omega take a unit-disc prior",
            _ => {
                let names: Vec<&str> = takes.iter().map(|kind| kind.name()).collect();
                let name = self.parameter.name();
                return Err(self.fault("prior", format!("{name} takes one of these priors: {}", names.join(", "))));
            }
        };
        Err(self.fault("prior", only))
    }

    fn needed(&self, name: &str) -> Result<f64, Fault> {
        self.field(name)
            .ok_or_else(|| self.fault(name, format!("missing, a {} prior needs it", self.section.prior.name())))
    }

    fn refuse(&self, names: &[&str]) -> Result<(), Fault> {
        match names.iter().find(|name| self.field(name).is_some()) {
            Some(name) => Err(self.fault(name, format!("not for this prior ({})", self.section.prior.name()))),
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
