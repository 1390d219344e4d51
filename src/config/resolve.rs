//! From the config as written to [`Settings`]: checks, defaults that depend on other keys, units.
//!
//! Left out: the star (`resolve_star`), observations (`resolve_observations`), and what each prior may be (`domain`).

use super::domain::{check_value, key, resolve_prior};
use super::error::Fault;
use super::identity::fingerprint;
use super::raw::Config;
use super::raw_parts::Grid;
use super::resolve_observations::resolve_observations;
use super::resolve_star::resolve_star;
use super::{GridAxis, ImagingSettings, SamplerSettings, Settings};
use crate::objective::{FreeParameter, Parameter, ParameterValues, Prior};
use std::path::Path;

/// Fewest and most pixels of an image or a simulated star.
pub(super) const PIXELS: std::ops::RangeInclusive<usize> = 100..=2_000_000;

pub(super) fn resolve(mut raw: Config, path: &Path) -> Result<Settings, Fault> {
    let star = resolve_star(&mut raw.star, &raw.instrument)?;
    let mut values = values(&raw)?;
    let source = resolve_observations(&mut raw, &star, &values, path)?;
    check_imaging(&raw.imaging)?;
    let free = resolve_free(&mut raw, &mut values)?;
    check_sampler(&raw.sampler, free.len())?;
    let grid = raw.grid.as_ref().map(resolve_grid).transpose()?;
    let resolved = serde_json::to_value(&raw).map_err(|e| Fault::new("config", e.to_string()))?;
    Ok(Settings {
        path: path.into(),
        star,
        equivalent_width: raw.star.line.equivalent_width_kms,
        values,
        source,
        imaging: raw.imaging,
        free,
        sampler: raw.sampler,
        grid,
        sha256: fingerprint(&resolved),
        resolved,
    })
}

/// The eight parameters as the config gives them.
fn values(raw: &Config) -> Result<ParameterValues, Fault> {
    let (star, planet) = (&raw.star, &raw.planet);
    let mut values = ParameterValues([0.0; 8]);
    for parameter in Parameter::ALL {
        values[parameter] = match parameter {
            Parameter::K => planet.k_kms,
            Parameter::PorbOverProt => planet.porb_over_prot,
            Parameter::Phi => planet.phi,
            // Filled in by `resolve_star`.
            Parameter::OmegaEq => star.omega_eq_rad_d.unwrap_or(f64::NAN),
            Parameter::DOmega => star.domega_rad_d,
            Parameter::Inclination => star.inclination_deg,
            Parameter::Vsini => star.vsini_kms,
            Parameter::Vsys => star.vsys_kms,
        };
        check_value(parameter, values[parameter], &key(parameter))?;
    }
    Ok(values)
}

/// Priors of the free parameters, with their defaults filled into `raw`, and their starts checked (and wrapped) in `values`.
fn resolve_free(raw: &mut Config, values: &mut ParameterValues) -> Result<Vec<FreeParameter>, Fault> {
    let phi_free = raw.parameters.phi.is_some();
    let mut free = Vec::new();
    for (parameter, mut section) in raw.parameters.entries() {
        let prior = resolve_prior(parameter, &section, phi_free)?;
        let start = prior.wrap(values[parameter]);
        if !prior.log_density(start).is_finite() {
            let (min, max) = prior.bounds();
            let problem = format!("{start} is outside its prior, [{min}, {max}] by parameters.{}", parameter.name());
            return Err(Fault::new(key(parameter), problem));
        }
        values[parameter] = start;
        if prior != Prior::Periodic {
            let (min, max) = prior.bounds();
            section.min = min.is_finite().then_some(min);
            section.max = max.is_finite().then_some(max);
        }
        *raw.parameters.slot(parameter) = Some(section);
        free.push(FreeParameter { parameter, prior });
    }
    let no_planet = values[Parameter::K] == 0.0 && raw.parameters.k_kms.is_none();
    match free.iter().find(|f| no_planet && matches!(f.parameter, Parameter::Phi | Parameter::PorbOverProt)) {
        Some(f) => {
            let name = f.parameter.name();
            let problem =
                format!("{name} has no effect while planet.k_kms is fixed at 0: free k_kms too, or fix {name}");
            Err(Fault::new(format!("parameters.{name}"), problem))
        }
        None => Ok(free),
    }
}

fn check_imaging(imaging: &ImagingSettings) -> Result<(), Fault> {
    check_pixels("imaging.pixels", imaging.pixels)?;
    if !(imaging.default_spot > 0.0 && imaging.default_spot < 0.5) {
        let problem = format!("{} must be above 0 and below 0.5", imaging.default_spot);
        return Err(Fault::new("imaging.default_spot", problem));
    }
    positive("imaging.chi2_target", imaging.chi2_target)
}

pub(super) fn check_pixels(key: &str, pixels: usize) -> Result<(), Fault> {
    if PIXELS.contains(&pixels) {
        return Ok(());
    }
    Err(Fault::new(key, format!("{pixels} must be from {} to {}", PIXELS.start(), PIXELS.end())))
}

pub(super) fn positive(key: &str, value: f64) -> Result<(), Fault> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(Fault::new(key, format!("{value} must be above 0"))) }
}

fn check_sampler(sampler: &SamplerSettings, free: usize) -> Result<(), Fault> {
    // Commands that do not sample need no free parameter. The message starts with the key.
    let message = |e: String| {
        e.split_once(": ").map(|(key, problem)| Fault::new(key, problem)).unwrap_or(Fault::new("sampler", e))
    };
    sampler.validate(free.max(1)).map_err(|e| message(e.to_string()))
}

fn resolve_grid(grid: &Grid) -> Result<Vec<GridAxis>, Fault> {
    const MOST_NODES: usize = 10_000_000;
    let axes = grid.axes.entries();
    if !(1..=3).contains(&axes.len()) {
        return Err(Fault::new("grid.axes", format!("{} axes must be 1 to 3", axes.len())));
    }
    let total = axes.iter().fold(1usize, |product, (_, (_, _, n))| product.saturating_mul(*n));
    if total > MOST_NODES {
        return Err(Fault::new("grid.axes", format!("{total} nodes exceed {MOST_NODES}")));
    }
    axes.into_iter().map(|(parameter, axis)| resolve_axis(parameter, axis)).collect()
}

fn resolve_axis(parameter: Parameter, (min, max, nodes): (f64, f64, usize)) -> Result<GridAxis, Fault> {
    let key = format!("grid.axes.{}", parameter.name());
    check_value(parameter, min, &key)?;
    check_value(parameter, max, &key)?;
    let problem = match nodes {
        0 => "0 nodes must be at least 1".to_string(),
        _ if min > max => format!("min {min} must not be above max {max}"),
        n if n > 1 && min == max => format!("min = max = {min} makes {n} nodes one: give n = 1"),
        _ if !(max - min).is_finite() => format!("max {max} is too far from min {min}"),
        _ => return Ok(GridAxis { parameter, min, max, nodes }),
    };
    Err(Fault::new(key, problem))
}
