//! The orbits: which planets there are, ephemerides in place of period and phase, eccentricity, and stability of two
//! planets.

use super::checks::positive;
use super::parameters::check_value;
use crate::data::config::error::Fault;
use crate::data::config::written::Config;
use crate::model::{Clock, Elements, FreeParameter, Parameter, ParameterValues, Prior};
use crate::star::{StarSettings, stability};

/// Fills the orbits into `values`, where K, period and phase of the planet are as in the config: eccentricities, the
/// second planet, and the periods and phases given by ephemerides.
pub(super) fn resolve_orbits(written: &Config, values: &mut ParameterValues, star: &StarSettings) -> Result<(), Fault> {
    let clock = Clock { rotation_period_d: star.rotation_period_d, epoch_d: star.epoch_d };
    let [first, second] = &Elements::PLANETS;
    // phase and conjunction, or ratio and period, exclude each other
    let both = [first, second].into_iter().flat_map(|of| [(of.ratio, of.period), (of.phi, of.conjunction)]);
    for (internal, named) in both {
        let either = |section: &str| {
            let problem = format!("give either {} or {}, not both", named.name(), internal.name());
            Fault::new(format!("{section}.{}", named.name()), problem)
        };
        if written.planet.tells(internal) && written.planet.get(named).is_some() {
            return Err(either("planet"));
        }
        if written.parameters.has(internal) && written.parameters.has(named) {
            return Err(either("parameters"));
        }
    }
    for of in &Elements::PLANETS {
        let is_named = |p: Parameter| written.planet.get(p).is_some() || written.is_free(p);
        if of == first || of.all().into_iter().any(is_named) {
            resolve_orbit(written, of, values, clock)?;
        }
    }
    Ok(())
}

/// Start of free eccentricities, in units of the square root of the largest.
const START_SHAPE: [f64; 2] = [0.2, 0.1];

fn resolve_orbit(written: &Config, of: &Elements, values: &mut ParameterValues, clock: Clock) -> Result<(), Fault> {
    let [first, _] = &Elements::PLANETS;
    let given = |p: Parameter| -> Result<Option<f64>, Fault> {
        let value = written.planet.get(p);
        value.map_or(Ok(()), |value| check_value(p, value, p.spec().config_key))?;
        Ok(value)
    };
    // without a value in the config a search begins in the middle of the prior
    let start = |p: Parameter| -> Result<Option<f64>, Fault> {
        let middle = written.parameters.get(p).and_then(|section| {
            section.mean.or_else(|| section.min.zip(section.max).map(|(min, max)| 0.5 * (min + max)))
        });
        Ok(given(p)?.or(middle))
    };
    let (period, conjunction) = (start(of.period)?, start(of.conjunction)?);
    if of != first {
        values.set(of.k, given(of.k)?.unwrap_or(of.k.usual()));
        match given(of.ratio)? {
            Some(ratio) => values.set(of.ratio, ratio),
            None if period.is_some() => {}
            None => {
                let what = if written.is_free(of.ratio) { "the start of its period" } else { "its period" };
                let problem = format!("missing: a second planet needs {what}, here or as {}", of.period.name());
                return Err(Fault::new(of.ratio.spec().config_key, problem));
            }
        }
        values.set(of.phi, given(of.phi)?.unwrap_or(of.phi.usual()));
    }
    let free = of.shape.map(|p| written.parameters.has(p));
    let shape = [given(of.shape[0])?, given(of.shape[1])?];
    let any = shape.iter().any(Option::is_some) || of.shape.iter().any(|p| written.is_free(*p));
    if any {
        // where it is free a search does not begin at a circular orbit, a saddle point
        let largest = written.parameters.get(of.shape[0]).and_then(|section| section.max).unwrap_or(1.0);
        let begin = if free == [true, true] && shape == [None, None] {
            START_SHAPE.map(|x| x * largest.abs().min(1.0).sqrt())
        } else {
            [0.0; 2]
        };
        let given = shape.into_iter().zip(begin).map(|(value, begin)| value.unwrap_or(begin));
        of.shape.into_iter().zip(given).for_each(|(p, value)| values.set(p, value));
        let e = of.shape(values).eccentricity();
        if e >= 1.0 {
            return Err(Fault::new(
                of.shape[0].spec().config_key,
                format!("makes an eccentricity of {e}, it must be below 1"),
            ));
        }
    }
    if let [true, false] | [false, true] = free {
        let (here, other) = if free[0] { (of.shape[0], of.shape[1]) } else { (of.shape[1], of.shape[0]) };
        let problem = format!("is free without {}: free both, or none", other.name());
        return Err(Fault::new(format!("parameters.{}", here.name()), problem));
    }
    if let Some(period_d) = period {
        positive(of.period.spec().config_key, period_d)?;
        of.set_period(values, period_d, clock);
        check_value(of.ratio, values[of.ratio], of.period.spec().config_key)?;
    }
    if let Some(time_d) = conjunction {
        of.set_conjunction(values, time_d, clock);
        let moves = [of.period, of.ratio, of.shape[0], of.shape[1]].into_iter().find(|p| written.is_free(*p));
        if let Some(moving) = moves.filter(|_| !written.is_free(of.conjunction)) {
            let problem = format!(
                "is fixed while {} is free: give parameters.{} a normal prior with its error",
                moving.name(),
                of.conjunction.name()
            );
            return Err(Fault::new(of.conjunction.spec().config_key, problem));
        }
    }
    Ok(())
}

/// Where a free parameter starts.
pub(super) fn start_of(parameter: Parameter, prior: &Prior, values: &ParameterValues, clock: Clock) -> f64 {
    let start = Elements::value(parameter, prior, values, clock).expect("a value where a parameter is free");
    if !parameter.is_ephemeris() {
        return start;
    }
    // a value that rounding has moved over a bound
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

/// Whether the orbits are consistent: eccentricities of one planet share a bound, a conjunction belongs to the period
/// of its planet, and two planets are stable at the start.
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
                return Err(Fault::new(of.shape[0].spec().config_key, problem));
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
        return Err(Fault::new(
            Parameter::PorbOverProt2.spec().config_key,
            format!("{unstable}, at the values of the config"),
        ));
    }
    Ok(())
}

/// The shortest period that a prior allows, except for negligible tails.
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
