//! The settings that programs use: the written config, checked, with all defaults, in the units of its consumers. Each
//! section is resolved in a file of its name.

mod checks;
mod grid;
mod imaging;
mod indicators;
mod observations;
mod orbits;
mod parameters;
mod photometry;
mod plan;
mod simulation;
mod star;

pub use grid::{GridSettings, MOST_NODES};
pub use indicators::IndicatorSettings;
pub use observations::{DataSetSettings, ObservationSource, too_long};
pub use photometry::{LightCurveSettings, LightSource};
pub use plan::PlannedProfiles;
pub use star::FITTED;

use super::error::{ConfigError, Fault};
use super::identity::fingerprint;
use super::written::{Config, Hyperparameter, ImagingSettings, OfField, VelocityDrift, VelocityJitter};
use crate::field::Lifetime;
use crate::model::{Clock, Elements, FreeParameter, Parameter, ParameterValues, Prior};
use crate::sampling::ensemble::SamplerSettings;
use crate::star::response::{self, velocity_grid};
use crate::star::{BrightnessModel, Size, StarSettings};
use crate::surface::Known;
use grid::resolve_grid;
use imaging::{check_brightness, check_imaging, resolve_field};
use indicators::resolve_indicators;
use observations::{has_own_jitters, largest_jitter_kms, resolve_sets};
use orbits::{check_orbits, resolve_orbits, start_of, without_planet};
use parameters::{check_value, resolve_prior};
use photometry::resolve_photometry;
use plan::resolve_plan;
use star::{fitted_star, resolve_instrument, resolve_star};
use std::path::{Path, PathBuf};

/// A whole config, resolved.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The config file.
    pub path: PathBuf,
    /// The star without the overrides of data sets.
    pub star: StarSettings,
    /// RV stability of the spectrograph (km/s), where it is known: scale of the priors of RV jitter and RV offsets of
    /// nights.
    pub stability_kms: Option<f64>,
    /// Mass of the star (solar masses), for the minimum mass of the planet.
    pub mass_msun: Option<f64>,
    /// The parameters as the config gives them: the fixed ones, and the start of the free ones.
    pub values: ParameterValues,
    /// The data sets, one at least.
    pub sets: Vec<DataSetSettings>,
    /// The light curves, mostly none.
    pub light_curves: Vec<LightCurveSettings>,
    /// The activity indicators, mostly none.
    pub indicators: Vec<IndicatorSettings>,
    /// Planned observations, mostly none.
    pub plan: Vec<PlannedProfiles>,
    /// RV jitter of the profiles.
    pub velocity_jitter: VelocityJitter,
    /// The Doppler image.
    pub imaging: ImagingSettings,
    /// The free parameters in the order of [`Parameter::ALL`]; may be empty, see [`Settings::require_free`].
    pub free: Vec<FreeParameter>,
    /// The chain.
    pub sampler: SamplerSettings,
    /// Numbers of the star that are fitted to the profiles.
    pub fitted: Vec<Parameter>,
    /// An RV drift that is marginalised over; `None` where the profiles decide whether there is one.
    pub drift: Option<VelocityDrift>,
    /// The likelihood grid.
    pub grid: Option<GridSettings>,
    /// The config with all defaults filled in and paths as given, for the manifest; it is itself a valid config.
    pub resolved: serde_json::Value,
    /// SHA-256 (hex) of the part of `resolved` that decides the posterior and the chain: all but `$schema`, `grid`,
    /// `plan`, names, `star.mass_msun`, and `sampler.steps`, `.rhat` and `.ess`, which may change on resuming.
    pub sha256: String,
}

/// Default number of walkers per ensemble under a marginal likelihood.
const FEW_WALKERS: usize = 16;

/// Checks the config that was read from the file at `path`, and fills in its defaults.
pub(super) fn resolve(mut written: Config, path: &Path) -> Result<Settings, Fault> {
    let stability_kms = resolve_instrument(&mut written.instrument)?;
    let star = resolve_star(&mut written.star, &written.instrument)?;
    let mut values = values(&written, &star)?;
    let size = Size::of(star.rotation_period_d, written.star.vsini_kms, written.star.inclination_deg);
    size.refused().map_or(Ok(()), |(key, problem)| Err(Fault::new(key, problem)))?;
    check_brightness(&mut written.imaging)?;
    let sets = resolve_sets(&mut written, &star, &values, path)?;
    let light_curves = resolve_photometry(&written, path)?;
    let plan = resolve_plan(&written, &sets, &light_curves)?;
    let indicators = resolve_indicators(&written, path)?;
    let velocity_jitter = resolve_jitter(&mut written);
    check_imaging(&written.imaging, velocity_jitter)?;
    resolve_field(&mut written, &mut values)?;
    let clock = Clock { rotation_period_d: star.rotation_period_d, epoch_d: star.epoch_d };
    let free = resolve_free(&mut written, &mut values, clock)?;
    check_orbits(&free, &values, clock, written.star.mass_msun)?;
    resolve_sampler(&mut written, free.len())?;
    if written.imaging.brightness() == BrightnessModel::BrightAndDark && values.get(Parameter::Contrast).is_some() {
        return Err(Fault::new(
            "parameters.contrast",
            "has no effect on a bright-and-dark map, which holds the brightness itself",
        ));
    }
    let fitted = match written.imaging.objective.properties().has_field {
        true => fitted_star(&written.star)?,
        false => Vec::new(),
    };
    let drift = match (written.star.velocity_drift, written.imaging.objective.properties().has_field) {
        (given, true) => given,
        (None | Some(VelocityDrift::None), false) => Some(VelocityDrift::None),
        (Some(_), false) => {
            let problem = "no effect but with imaging.objective \"marginal-likelihood\"";
            return Err(Fault::new("star.velocity_drift", problem));
        }
    };
    let grid = written.grid.as_ref().map(|grid| resolve_grid(grid, &free, &values)).transpose()?;
    let resolved = serde_json::to_value(&written).map_err(|e| Fault::new("config", e.to_string()))?;
    Ok(Settings {
        path: path.into(),
        star,
        stability_kms,
        mass_msun: written.star.mass_msun,
        values,
        sets,
        light_curves,
        indicators,
        plan,
        velocity_jitter,
        imaging: written.imaging,
        free,
        sampler: written.sampler,
        fitted,
        drift,
        grid,
        sha256: fingerprint(&resolved),
        resolved,
    })
}

/// The RV jitter, its default filled in. Without it a field would attribute RV offsets of profiles to evolving spots or
/// planets.
fn resolve_jitter(written: &mut Config) -> VelocityJitter {
    let objective = written.imaging.objective;
    if has_own_jitters(written) {
        return VelocityJitter::Number(largest_jitter_kms(&written.observations.sections));
    }
    let sections = &mut written.observations.sections;
    let jitter = sections[0].velocity_jitter_kms.unwrap_or(VelocityJitter::usual(objective));
    // that of all data sets
    for section in sections {
        section.velocity_jitter_kms = jitter.mentioned(objective);
    }
    jitter
}

/// The parameters as the config gives them; those of the surface where they are free or on an axis.
fn values(written: &Config, resolved: &StarSettings) -> Result<ParameterValues, Fault> {
    let mut values = ParameterValues::of_eight([0.0; 8]);
    let needed = |p: &Parameter| !p.is_optional() || (p.is_surface() && written.is_free(*p));
    for parameter in Parameter::ALL.into_iter().filter(needed) {
        let key = parameter.spec().config_key;
        let value = match parameter {
            Parameter::LimbDarkening => resolved.limb_darkening.coefficients().0,
            Parameter::Contrast => resolved.contrast,
            _ if parameter.is_orbital() => written.planet.get(parameter).expect("the planet has what is usual"),
            _ => match written.number_at(key) {
                Some(value) => value,
                None if Parameter::REGIONS.contains(&parameter) => parameter.usual(),
                None => return Err(Fault::new(key, "auto is no start of a free parameter, give a number")),
            },
        };
        check_value(parameter, value, key)?;
        values.set(parameter, value);
    }
    resolve_orbits(written, &mut values, resolved)?;
    Ok(values)
}

/// Priors of the free parameters, with their defaults filled into `written`, and their starts checked (and wrapped) in
/// `values`.
fn resolve_free(written: &mut Config, values: &mut ParameterValues, clock: Clock) -> Result<Vec<FreeParameter>, Fault> {
    let entries = written.parameters.clone();
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
        written.parameters.set(parameter, section);
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

/// The sampler, the number of its walkers filled in.
fn resolve_sampler(written: &mut Config, free: usize) -> Result<(), Fault> {
    let usual = match written.imaging.objective.properties().marginalises {
        true => FEW_WALKERS,
        false => written.sampler.walkers(),
    };
    written.sampler.walkers.get_or_insert(usual.max(2 * free));
    // Commands that do not sample need no free parameter. The message starts with the key.
    let message = |e: String| {
        e.split_once(": ").map(|(key, problem)| Fault::new(key, problem)).unwrap_or(Fault::new("sampler", e))
    };
    written.sampler.validate(free.max(1)).map_err(|e| message(e.to_string()))
}

impl Settings {
    /// The free parameters, for commands that require some.
    ///
    /// # Errors
    /// If there is none.
    pub fn require_free(&self) -> Result<&[FreeParameter], ConfigError> {
        match &self.free[..] {
            [] => Err(self.fault("parameters", "no parameter is free: give at least one of them a prior")),
            free => Ok(free),
        }
    }

    /// The likelihood grid, for the command that requires it.
    ///
    /// # Errors
    /// If the config has no `grid`.
    pub fn require_grid(&self) -> Result<&GridSettings, ConfigError> {
        self.grid.as_ref().ok_or_else(|| self.fault("grid", "missing, a likelihood grid needs its axes"))
    }

    /// Whether profiles of `star` in velocity bins of `step_kms` can be computed at `values`.
    ///
    /// # Errors
    /// If the local line is so narrow, or the star so fast, that the velocity grid becomes too large.
    pub fn check_velocity_grid(
        &self,
        star: &StarSettings,
        values: &ParameterValues,
        step_kms: f64,
    ) -> Result<(), ConfigError> {
        let (steps, nodes) = velocity_grid(&star.with(&values.state().surface), &values.state(), step_kms);
        if steps.is_nan() || steps > response::MOST_STEPS_PER_BIN {
            let sigma = star.line.sigma_kms;
            let problem = format!("{sigma} (with the instrument) is too narrow for velocity bins of {step_kms} km/s");
            return Err(self.fault("star.line.sigma_kms", &problem));
        }
        if nodes.is_nan() || nodes > response::MOST_NODES {
            let vsini = values[Parameter::Vsini];
            let problem = format!(
                "{vsini} km/s, at the pole or the equator, takes {nodes:.1e} steps of a fraction of the line's width, \
                 over {}: see star.domega_rad_d, star.line.sigma_kms and the velocity bins too",
                response::MOST_NODES
            );
            return Err(self.fault("star.vsini_kms", &problem));
        }
        Ok(())
    }

    /// The config with other observations, those of each data set in a list at `path_of` it; velocity range and
    /// uncertainties of observed ones are kept.
    pub fn with_observations(&self, path_of: impl Fn(&DataSetSettings) -> String) -> serde_json::Value {
        let mut config = self.resolved.clone();
        if let Some(top) = config.as_object_mut() {
            top.remove("$schema");
        }
        self.with_light_curves_from_here(&mut config);
        self.with_indicators_from_here(&mut config);
        let sections = match &mut config["observations"] {
            serde_json::Value::Array(sections) => sections.iter_mut().collect(),
            one => vec![one],
        };
        for (section, set) in sections.into_iter().zip(&self.sets) {
            if let Some(section) = section.as_object_mut() {
                section.remove("simulate");
                section.insert("path".into(), path_of(set).into());
            }
        }
        config
    }

    /// Tables of light curves by absolute paths; simulated ones, which belong to simulated profiles, are left out.
    fn with_light_curves_from_here(&self, config: &mut serde_json::Value) {
        let Some(written) = config.get("photometry").cloned() else { return };
        let sections = written.as_array().cloned().unwrap_or_else(|| vec![written]);
        let tables = sections.into_iter().zip(&self.light_curves).filter_map(|(mut section, curve)| {
            let LightSource::File(path) = &curve.source else { return None };
            section["path"] = std::path::absolute(path).unwrap_or_else(|_| path.clone()).to_str()?.into();
            Some(section)
        });
        let tables: Vec<serde_json::Value> = tables.collect();
        match (tables.is_empty(), config.as_object_mut()) {
            (true, Some(top)) => drop(top.remove("photometry")),
            _ => config["photometry"] = tables.into(),
        }
    }

    /// Tables of indicators by absolute paths.
    fn with_indicators_from_here(&self, config: &mut serde_json::Value) {
        let sections = match config.get_mut("indicators") {
            Some(serde_json::Value::Array(sections)) => sections.iter_mut().collect(),
            Some(one) => vec![one],
            None => return,
        };
        for (section, IndicatorSettings { path, .. }) in sections.into_iter().zip(&self.indicators) {
            let path = std::path::absolute(path).unwrap_or_else(|_| path.clone());
            if let Some(path) = path.to_str() {
                section["path"] = path.into();
            }
        }
    }

    /// The faculae of a simulated star, as the config has them.
    pub fn faculae_as_written(&self) -> Option<serde_json::Value> {
        let observations = &self.resolved["observations"];
        let first = observations.get(0).unwrap_or(observations);
        first["simulate"].get("faculae").cloned()
    }

    /// The prior of the field of spots under a marginal likelihood.
    pub fn known_field(&self) -> Known {
        let ImagingSettings { spot_amplitude, spot_slope, spot_lifetime_d, .. } = self.imaging;
        let priors = Parameter::FIELD.map(|p| self.free.iter().find(|f| f.parameter == p).map(|f| f.prior));
        // a value given with a prior is the start of a chain
        let number = |i: usize, given: Hyperparameter| given.number().filter(|_| priors[i].is_none());
        Known {
            amplitude: number(0, spot_amplitude),
            slope: number(1, spot_slope),
            break_degree: self.imaging.spot_break_degree,
            lifetime: match spot_lifetime_d {
                Hyperparameter::Word(OfField::Static) => Some(Lifetime::Static),
                days => number(2, days).map(Lifetime::Days),
            },
            priors,
            start: None,
            jitter_kms: self.velocity_jitter.number(),
            night_kms: 0.0,
            stability_kms: self.stability_kms,
        }
    }

    /// An error at a key.
    pub fn fault(&self, key: &str, problem: &str) -> ConfigError {
        ConfigError::Key { path: self.path.clone(), key: key.into(), problem: problem.into() }
    }
}

#[cfg(test)]
mod tests {
    use crate::data::config::document::Config;
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
        // with the three hyperparameters of the spots
        assert_eq!([walkers("marginal-likelihood", &[], None), walkers("marginal-likelihood", &many, None)], [16, 18]);
        assert_eq!(walkers("marginal-likelihood", &many, Some(40)), 40);
    }
}
