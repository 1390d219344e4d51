//! The orbits: which planets there are, ephemerides in place of period and phase, eccentricity, and whether two planets
//! can last.

use super::checks::positive;
use super::domain::{check_value, key};
use super::error::Fault;
use super::raw::{Config, DEFAULT_PORB_OVER_PROT};
use crate::model::{Clock, Elements, FreeParameter, Parameter, ParameterValues, Prior};
use crate::star::{StarSettings, stability};

/// Fills the orbits into `values`, where K, period and phase of the planet are as in the config: eccentricities, the
/// second planet, and what ephemerides stand for.
pub(super) fn resolve_orbits(raw: &mut Config, values: &mut ParameterValues, star: &StarSettings) -> Result<(), Fault> {
    let clock = Clock { rotation_period_d: star.rotation_period_d, epoch_d: star.epoch_d };
    let [first, second] = &Elements::PLANETS;
    // phase and conjunction, or ratio and period, exclude each other
    let usual = (raw.planet.porb_over_prot != DEFAULT_PORB_OVER_PROT, raw.planet.phi != 0.0);
    let both = [
        (usual.0, first.ratio, first.period),
        (usual.1, first.phi, first.conjunction),
        (raw.planet.porb2_over_prot.is_some(), second.ratio, second.period),
        (raw.planet.phi2.is_some(), second.phi, second.conjunction),
    ];
    for (given, internal, named) in both {
        let either = |section: &str| {
            let problem = format!("give either {} or {}, not both", named.name(), internal.name());
            Fault::new(format!("{section}.{}", named.name()), problem)
        };
        if given && raw.planet.given(named).is_some() {
            return Err(either("planet"));
        }
        if raw.parameters.slot(internal).is_some() && raw.parameters.slot(named).is_some() {
            return Err(either("parameters"));
        }
    }
    for of in &Elements::PLANETS {
        let is_free = of.all().map(|p| raw.parameters.slot(p).is_some() || has_axis(raw, p));
        let is_there =
            of == first || of.all().iter().any(|p| raw.planet.given(*p).is_some()) || is_free.contains(&true);
        if is_there {
            resolve_orbit(raw, of, values, clock)?;
        }
    }
    Ok(())
}

fn has_axis(raw: &mut Config, p: Parameter) -> bool {
    raw.grid.as_mut().is_some_and(|grid| grid.axes.slot(p).is_some())
}

/// Where eccentricities that are free begin, in units of the square root of the largest.
const START_SHAPE: [f64; 2] = [0.2, 0.1];

fn resolve_orbit(
    raw: &mut Config,
    of: &'static Elements,
    values: &mut ParameterValues,
    clock: Clock,
) -> Result<(), Fault> {
    let [first, _] = &Elements::PLANETS;
    let given = |p: Parameter, raw: &Config| -> Result<Option<f64>, Fault> {
        let value = raw.planet.given(p);
        value.map_or(Ok(()), |value| check_value(p, value, &key(p)))?;
        Ok(value)
    };
    // where the config says nothing a search begins in the middle of the prior
    let mut start = |p: Parameter| -> Result<Option<f64>, Fault> {
        let middle = raw.parameters.slot(p).as_ref().and_then(|section| {
            section.mean.or_else(|| section.min.zip(section.max).map(|(min, max)| 0.5 * (min + max)))
        });
        Ok(given(p, raw)?.or(middle))
    };
    let (period, conjunction) = (start(of.period)?, start(of.conjunction)?);
    if of != first {
        values[of.k] = given(of.k, raw)?.unwrap_or(0.0);
        let named = raw.parameters.slot(of.ratio).is_some() || has_axis(raw, of.ratio);
        values[of.ratio] = match given(of.ratio, raw)? {
            Some(ratio) => ratio,
            None if period.is_some() => f64::NAN,
            None => {
                let what = if named { "the start of its period" } else { "its period" };
                let problem = format!("missing: a second planet needs {what}, here or as {}", of.period.name());
                return Err(Fault::new(key(of.ratio), problem));
            }
        };
        values[of.phi] = given(of.phi, raw)?.unwrap_or(0.0);
    }
    let free = of.shape.map(|p| raw.parameters.slot(p).is_some());
    let shape = [given(of.shape[0], raw)?, given(of.shape[1], raw)?];
    let any = shape.iter().any(Option::is_some) || free.contains(&true) || of.shape.iter().any(|p| has_axis(raw, *p));
    if any {
        // where it is looked for a search does not begin at the circle, which is a saddle
        let largest = raw.parameters.slot(of.shape[0]).as_ref().and_then(|section| section.max).unwrap_or(1.0);
        let begin = if free == [true, true] && shape == [None, None] {
            START_SHAPE.map(|x| x * largest.abs().min(1.0).sqrt())
        } else {
            [0.0; 2]
        };
        let given = shape.into_iter().zip(begin).map(|(value, begin)| value.unwrap_or(begin));
        of.shape.into_iter().zip(given).for_each(|(p, value)| values[p] = value);
        let e = of.shape(values).eccentricity();
        if e >= 1.0 {
            return Err(Fault::new(key(of.shape[0]), format!("makes an eccentricity of {e}, it must be below 1")));
        }
    }
    if let [true, false] | [false, true] = free {
        let (here, other) = if free[0] { (of.shape[0], of.shape[1]) } else { (of.shape[1], of.shape[0]) };
        let problem = format!("is free without {}: free both, or none", other.name());
        return Err(Fault::new(format!("parameters.{}", here.name()), problem));
    }
    if let Some(period_d) = period {
        positive(&key(of.period), period_d)?;
        of.set_period(values, period_d, clock);
        check_value(of.ratio, values[of.ratio], &key(of.period))?;
    }
    if let Some(time_d) = conjunction {
        of.set_conjunction(values, time_d, clock);
        let is_free = |p: Parameter, raw: &mut Config| raw.parameters.slot(p).is_some() || has_axis(raw, p);
        let moves = [of.period, of.ratio, of.shape[0], of.shape[1]].into_iter().find(|p| is_free(*p, raw));
        if let Some(moving) = moves.filter(|_| !is_free(of.conjunction, raw)) {
            let problem = format!(
                "is fixed while {} is free: give parameters.{} a normal prior with its error",
                moving.name(),
                of.conjunction.name()
            );
            return Err(Fault::new(key(of.conjunction), problem));
        }
    }
    Ok(())
}

/// Where a free parameter starts.
pub(super) fn start_of(parameter: Parameter, prior: &Prior, values: &ParameterValues, clock: Clock) -> f64 {
    let start = match Elements::of(parameter) {
        Some(of) if of.period == parameter => of.period_d(values, clock),
        Some(of) if of.conjunction == parameter => of.conjunction_d(values, clock, prior.centre()),
        _ => return values[parameter],
    };
    // what rounding has moved over a bound
    let (min, max) = prior.bounds();
    let rounding = 1e-12 * start.abs();
    if start < min && start > min - rounding {
        min
    } else if start > max && start < max + rounding {
        max
    } else {
        start
    }
}

/// Whether the orbits make sense together: eccentricities of one planet share a bound, a conjunction is one of its own
/// period, and two planets last beside each other at the start.
pub(super) fn check_orbits(
    free: &[FreeParameter],
    values: &ParameterValues,
    clock: Clock,
    mass_msun: Option<f64>,
) -> Result<(), Fault> {
    let prior = |p: Parameter| free.iter().find(|f| f.parameter == p).map(|f| f.prior);
    for of in &Elements::PLANETS {
        let [cos, sin] = of.shape.map(prior);
        if cos != sin {
            let problem = format!("must be that of {}", of.shape[0].name());
            return Err(Fault::new(format!("parameters.{}.max", of.shape[1].name()), problem));
        }
        if let Some(Prior::Disc { max_eccentricity }) = cos {
            let e = of.shape(values).eccentricity();
            if e > max_eccentricity {
                let problem = format!("makes an eccentricity of {e}, above that of its prior, {max_eccentricity}");
                return Err(Fault::new(key(of.shape[0]), problem));
            }
        }
        if let Some(Prior::Uniform { min, max }) = prior(of.conjunction) {
            let shortest = match (prior(of.period), prior(of.ratio)) {
                (Some(prior), _) => shortest(&prior),
                (None, Some(prior)) => clock.rotation_period_d * shortest(&prior),
                (None, None) => of.period_d(values, clock),
            };
            if max - min > shortest {
                let name = of.conjunction.name();
                let problem = format!(
                    "{min} to {max} holds more than one conjunction of an orbit of {shortest:.4} d, which its prior \
                     allows: take a smaller range, or {} with a periodic prior",
                    of.phi.name()
                );
                return Err(Fault::new(format!("parameters.{name}.max"), problem));
            }
        }
    }
    let motion = values.motion();
    if let Some(second) = motion.second
        && let Err(unstable) = stability::check(&motion.first, &second, clock.rotation_period_d, mass_msun)
    {
        return Err(Fault::new(key(Parameter::PorbOverProt2), format!("{unstable}, at the values of the config")));
    }
    Ok(())
}

/// The shortest period that a prior allows, to all that matters.
fn shortest(prior: &Prior) -> f64 {
    match *prior {
        Prior::Normal { mean, sd, min, .. } => min.max(mean - 4.0 * sd),
        _ => prior.bounds().0,
    }
}

/// A free parameter of an orbit of which K is fixed at 0.
pub(super) fn without_planet(
    free: &[FreeParameter],
    values: &ParameterValues,
) -> Option<(Parameter, &'static Elements)> {
    let no_planet = |of: &Elements| values[of.k] == 0.0 && free.iter().all(|f| f.parameter != of.k);
    free.iter().find_map(|f| Some((f.parameter, Elements::of(f.parameter).filter(|of| no_planet(of))?)))
}
