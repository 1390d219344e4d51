//! From the config as written to [`Settings`]: checks, defaults that depend on other keys, units.

use super::checks::{automatic, check_nuisances, check_pixels, check_windows};
use super::domain::{check_value, resolve_prior};
use super::error::Fault;
use super::identity::fingerprint;
use super::number_or::OfField;
use super::raw::Config;
use super::raw_parts::PriorSection;
use super::resolve_grid::resolve_grid;
use super::resolve_orbits::{check_orbits, resolve_orbits, start_of, without_planet};
use super::resolve_photometry::resolve_photometry;
use super::resolve_sets::resolve_sets;
use super::resolve_simulation::check_plan;
use super::resolve_star::resolve_star;
use super::{Hyperparameter, ImagingSettings, Settings, VelocityJitter};
use crate::model::{Clock, Elements, FreeParameter, Parameter, ParameterValues, Prior};
use crate::star::{BrightnessModel, StarSettings};
use crate::surface::ObjectiveKind;
use std::path::Path;

/// Largest degree of a break: harmonics go to 36.
const MOST_BREAK_DEGREE: f64 = 30.0;

/// Walkers of each ensemble where all maps are integrated over, if their number is not given.
const FEW_WALKERS: usize = 16;

/// What is said of spots where one map is found.
const OF_INTEGRATED_MAPS: &str = "it has no meaning but with imaging.objective \"marginal-likelihood\"";

pub(super) fn resolve(mut raw: Config, path: &Path) -> Result<Settings, Fault> {
    let star = resolve_star(&mut raw.star, &raw.instrument)?;
    let mut values = values(&raw, &star)?;
    raw.plan.as_ref().map_or(Ok(()), check_plan)?;
    let sets = resolve_sets(&mut raw, &star, &values, path)?;
    let light_curves = resolve_photometry(&raw, path)?;
    let velocity_jitter = resolve_jitter(&mut raw);
    check_imaging(&raw.imaging, velocity_jitter)?;
    resolve_field(&mut raw, &mut values)?;
    let clock = Clock { rotation_period_d: star.rotation_period_d, epoch_d: star.epoch_d };
    let free = resolve_free(&mut raw, &mut values, clock)?;
    check_orbits(&free, &values, clock, raw.star.mass_msun)?;
    resolve_sampler(&mut raw, free.len())?;
    if raw.imaging.brightness == BrightnessModel::BrightAndDark && values.get(Parameter::Contrast).is_some() {
        return Err(Fault::new(
            "parameters.contrast",
            "has no effect on a bright-and-dark map, which holds the brightness itself",
        ));
    }
    let grid = raw.grid.as_ref().map(|grid| resolve_grid(grid, &free, &values)).transpose()?;
    let resolved = serde_json::to_value(&raw).map_err(|e| Fault::new("config", e.to_string()))?;
    Ok(Settings {
        path: path.into(),
        star,
        mass_msun: raw.star.mass_msun,
        values,
        sets,
        light_curves,
        plan: raw.plan,
        velocity_jitter,
        imaging: raw.imaging,
        free,
        sampler: raw.sampler,
        grid,
        sha256: fingerprint(&resolved),
        resolved,
    })
}

/// The velocity jitter, its default filled in. A field takes zero points that nobody told it of for spots that change
/// or for planets.
fn resolve_jitter(raw: &mut Config) -> VelocityJitter {
    let integrated = raw.imaging.objective.evolves();
    let usual = if integrated { VelocityJitter::FITTED } else { VelocityJitter::default() };
    let sections = &mut raw.observations.sections;
    let jitter = sections[0].velocity_jitter_kms.unwrap_or(usual);
    // that of all data sets
    for section in sections {
        section.velocity_jitter_kms = Some(jitter).filter(|jitter| integrated || !jitter.is_default());
    }
    jitter
}

/// The parameters as the config gives them; those of the surface where they are free or on an axis.
fn values(raw: &Config, resolved: &StarSettings) -> Result<ParameterValues, Fault> {
    let mut values = ParameterValues::of_eight([0.0; 8]);
    let needed = |p: &Parameter| !p.is_optional() || (p.is_surface() && raw.is_free(*p));
    for parameter in Parameter::ALL.into_iter().filter(needed) {
        let key = parameter.spec().config_key;
        let value = match parameter {
            Parameter::LimbDarkening => resolved.limb_darkening.coefficients().0,
            Parameter::Contrast => resolved.contrast,
            _ if parameter.is_orbital() => raw.planet.get(parameter).expect("the planet has what is usual"),
            _ => match raw.number_at(key) {
                Some(value) => value,
                None => return Err(Fault::new(key, "auto is no start of a free parameter, give a number")),
            },
        };
        check_value(parameter, value, key)?;
        values.set(parameter, value);
    }
    resolve_orbits(raw, &mut values, resolved)?;
    Ok(values)
}

/// Priors of the free parameters, with their defaults filled into `raw`, and their starts checked (and wrapped) in
/// `values`.
fn resolve_free(raw: &mut Config, values: &mut ParameterValues, clock: Clock) -> Result<Vec<FreeParameter>, Fault> {
    let entries = raw.parameters.clone();
    let mut free = Vec::new();
    for (parameter, section) in entries.entries() {
        let mut section = section.clone();
        let phi_free = Elements::of(parameter).is_some_and(|of| entries.has(of.phi));
        let prior = resolve_prior(parameter, &section, phi_free)?;
        let start = prior.wrap(start_of(parameter, &prior, values, clock));
        if !prior.log_density(start).is_finite() {
            let (min, max) = prior.bounds();
            let problem = format!("{start} is outside its prior, [{min}, {max}] by parameters.{}", parameter.name());
            return Err(Fault::new(parameter.spec().config_key, problem));
        }
        if !parameter.is_ephemeris() {
            values.set(parameter, start);
        }
        if !matches!(prior, Prior::Periodic | Prior::Disc { .. }) {
            let (min, max) = prior.bounds();
            section.min = min.is_finite().then_some(min);
            section.max = max.is_finite().then_some(max);
        }
        raw.parameters.set(parameter, section);
        free.push(FreeParameter { parameter, prior });
    }
    match without_planet(&free, values) {
        Some((parameter, of)) => {
            let (name, k) = (parameter.name(), of.k.name());
            let problem = format!("{name} has no effect while planet.{k} is fixed at 0: free {k} too, or fix {name}");
            Err(Fault::new(format!("parameters.{name}"), problem))
        }
        None => Ok(free),
    }
}

/// What is said of the spots has a meaning where they are integrated out, and lies within the bounds of a fit. What is
/// left to the profiles is free in a chain: with a weak prior, all over those bounds.
fn resolve_field(raw: &mut Config, values: &mut ParameterValues) -> Result<(), Fault> {
    let imaging = &raw.imaging;
    let integrated = imaging.objective.evolves();
    let something_is_free = !raw.parameters.is_empty();
    let given = [imaging.spot_amplitude, imaging.spot_slope, imaging.spot_lifetime_d];
    for (parameter, given) in Parameter::FIELD.into_iter().zip(given) {
        let name = parameter.name();
        let (axis, prior) = (raw.has_axis(parameter), raw.parameters.has(parameter));
        let wanted = [(prior, "parameters"), (axis, "grid.axes"), (!given.is_default(), "imaging")];
        if let Some((_, section)) = wanted.into_iter().find(|(is_there, _)| *is_there && !integrated) {
            return Err(Fault::new(format!("{section}.{name}"), OF_INTEGRATED_MAPS));
        }
        match given {
            _ if !integrated => {}
            Hyperparameter::Word(OfField::Static) if parameter != Parameter::SpotLifetime => {
                return Err(Fault::new(format!("imaging.{name}"), "only spot_lifetime_d may be \"static\""));
            }
            Hyperparameter::Word(OfField::Static) if prior || axis => {
                let problem = "\"static\" spots live for ever, and their lifetime cannot be free";
                return Err(Fault::new(format!("imaging.{name}"), problem));
            }
            Hyperparameter::Word(OfField::Static) => {}
            Hyperparameter::Number(value) => {
                check_value(parameter, value, &format!("imaging.{name}"))?;
                values.set(parameter, value);
            }
            Hyperparameter::Word(OfField::Fitted) => {
                values.set(parameter, parameter.usual());
                if let Some(kind) = parameter.spec().usual_prior.filter(|_| something_is_free && !prior) {
                    raw.parameters.set(parameter, PriorSection::even(kind, parameter.widest()));
                }
            }
        }
    }
    Ok(())
}

fn check_imaging(imaging: &ImagingSettings, jitter: VelocityJitter) -> Result<(), Fault> {
    check_pixels("imaging.pixels", imaging.pixels)?;
    check_seasons(imaging)?;
    if let Some(degree) = imaging.spot_break_degree {
        const KEY: &str = "imaging.spot_break_degree";
        if !imaging.objective.evolves() {
            return Err(Fault::new(KEY, OF_INTEGRATED_MAPS));
        }
        if !(0.0..=MOST_BREAK_DEGREE).contains(&degree) {
            return Err(Fault::new(KEY, format!("{degree} must be from 0 to {MOST_BREAK_DEGREE}")));
        }
    }
    if !(imaging.default_spot > 0.0 && imaging.default_spot < 0.5) {
        let problem = format!("{} must be above 0 and below 0.5", imaging.default_spot);
        return Err(Fault::new("imaging.default_spot", problem));
    }
    if imaging.objective.evolves() && imaging.chi2_target.is_word() {
        let problem = "auto is for one map of a star that does not change, not for imaging.objective \
                       \"marginal-likelihood\", the default: leave it out, or give the objective \"spottedness\"";
        return Err(Fault::new("imaging.chi2_target", problem));
    }
    if imaging.nuisances.is_some() && imaging.chi2_target.is_word() {
        let problem =
            "auto goes by velocities that nuisances of line and continuum take up: give a number, such as 0.97";
        return Err(Fault::new("imaging.chi2_target", problem));
    }
    if !jitter.is_default() && imaging.chi2_target.is_word() {
        let problem = "auto goes by velocities, which observations.velocity_jitter_kms says are not the star's alone: \
                       give a number, such as 0.97";
        return Err(Fault::new("imaging.chi2_target", problem));
    }
    if let Some(priors) = &imaging.nuisances {
        check_nuisances(
            priors,
            ["continuum_offset", "continuum_slope", "equivalent_width"].map(|n| format!("imaging.nuisances.{n}")),
        )?;
    }
    automatic("imaging.chi2_target", imaging.chi2_target)
}

/// What tells the seasons apart.
fn check_seasons(imaging: &ImagingSettings) -> Result<(), Fault> {
    const GAP: &str = "imaging.season_gap_d";
    let ImagingSettings { season_gap_d: gap, seasons, objective, .. } = imaging;
    let given = [(gap.is_some(), GAP), (!seasons.is_empty(), "imaging.seasons")].map(|(is, key)| is.then_some(key));
    match (given, *objective) {
        ([Some(key), _] | [None, Some(key)], ObjectiveKind::MarginalLikelihood) => {
            let problem = "leave it out: with imaging.objective \"marginal-likelihood\", the default, spots change \
                           all the time; for a map of each season give the objective \"spottedness\"";
            return Err(Fault::new(key, problem));
        }
        ([Some(_), Some(key)], _) => return Err(Fault::new(key, "stands in place of season_gap_d: give one of them")),
        _ => {}
    }
    if let Some(gap) = gap.filter(|gap| gap.is_nan() || *gap <= 0.0) {
        return Err(Fault::new(GAP, format!("{gap} must be above 0")));
    }
    check_windows(seasons, "imaging.seasons")?;
    match seasons.windows(2).position(|two| two[1][0] <= two[0][1]) {
        None => Ok(()),
        Some(k) => {
            let [[_, end], [start, _]] = [seasons[k], seasons[k + 1]];
            let problem = format!("begins at {start} d, and imaging.seasons[{k}] ends only at {end} d");
            Err(Fault::new(format!("imaging.seasons[{}]", k + 1), problem))
        }
    }
}

/// The sampler, the number of its walkers filled in.
fn resolve_sampler(raw: &mut Config, free: usize) -> Result<(), Fault> {
    let usual = match raw.imaging.objective {
        ObjectiveKind::MarginalLikelihood => FEW_WALKERS,
        _ => raw.sampler.walkers(),
    };
    raw.sampler.walkers.get_or_insert(usual.max(2 * free));
    // Commands that do not sample need no free parameter. The message starts with the key.
    let message = |e: String| {
        e.split_once(": ").map(|(key, problem)| Fault::new(key, problem)).unwrap_or(Fault::new("sampler", e))
    };
    raw.sampler.validate(free.max(1)).map_err(|e| message(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::super::written::Config;
    use serde_json::json;

    #[test]
    fn walkers_are_as_many_as_the_objective_and_the_parameters_need() {
        let walkers = |objective: &str, more: &[&str], given: Option<usize>| {
            let mut free =
                json!({ "k_kms": { "prior": "uniform", "min": 0, "max": 1 }, "phi": { "prior": "periodic" } });
            for name in more {
                free[*name] = json!({ "prior": "uniform", "min": 1, "max": 80 });
            }
            let star = json!({ "rotation_period_d": 3, "inclination_deg": 40, "vsini_kms": 30, "contrast": 0.1,
                "line": { "sigma_kms": 2.5, "equivalent_width_kms": 5.8 } });
            let config = Config::default().with("star", star).with("instrument.resolving_power", 65_000.0);
            let config = config.with("observations.path", "star.txt").with("imaging.objective", objective);
            config.with("parameters", free).with("sampler.walkers", given).settings().unwrap().sampler.walkers()
        };
        let many = ["vsini_kms", "inclination_deg", "porb_over_prot", "line_sigma_kms"];
        assert_eq!(walkers("spottedness", &many, None), 32);
        // with the three numbers of the spots
        assert_eq!([walkers("marginal-likelihood", &[], None), walkers("marginal-likelihood", &many, None)], [16, 18]);
        assert_eq!(walkers("marginal-likelihood", &many, Some(40)), 40);
    }
}
