//! One simulated star, and the three routes to its planet's orbit: grid and paraboloid (the paper's), chain,
//! periodogram.
//!
//! Grid and chain share the search for the reference. Where the star is modelled wrongly the target chi2 may be out of
//! reach; then it is raised to what is in reach, as an observer would, and the outcome says so.

use super::laboratory::ExperimentError;
use super::outcome::{Estimate, Outcome, Route};
use super::star::with;
use crate::data::config::{Config, GridSettings};
use crate::data::io::atomic::write_json;
use crate::data::io::paraboloid::ParaboloidFile;
use crate::data::scene::Scene;
use crate::inference::detection::{Detection, DetectionSettings, Spots};
use crate::inference::search;
use crate::inference::search::{Found, SearchError, SearchSettings};
use crate::model::Parameter;
use crate::planets::periodogram::{Frequencies, FrequencySettings, SearchSettings as PeriodSearch};
use crate::runs::grid_scan::{GridScan, GridScanError, PARABOLOID};
use crate::runs::manifest::RunSummary;
use crate::runs::origin::by_name;
use crate::runs::pool::Pool;
use crate::runs::run::{CHAIN, Run, RunError, StartFrom};
use crate::sampling::ensemble::StopReason;
use crate::sampling::landscape::{Axis, Grid, Paraboloid, Rule, Undefined, paraboloid};
use crate::sampling::optimise::Optimum;
use crate::surface::expansion::nuisances;
use crate::surface::static_map::{Reference, ReferenceError};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Nodes to each side of the best orbit along every axis, in standard deviations of the curvature.
const REACH: f64 = 3.0;

/// Shortest period on a grid, over the rotation period.
const SHORTEST: f64 = 0.3;

/// A target out of reach is set above what a provisional reference reaches, by the first of these factors at which
/// there is an image at the best orbit.
const ABOVE_REACHED: [f64; 5] = [1.05, 1.08, 1.12, 1.2, 1.5];

/// Where the nodes of a grid over K, Porb/Prot and phi are.
#[derive(Clone, Debug, PartialEq)]
pub enum Nodes {
    /// So many along each axis, around the best orbit.
    Around(usize),
    /// Ends and number of nodes of each axis.
    At([(f64, f64, usize); 3]),
}

/// One star.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of its folder.
    pub name: String,
    /// Its config; K, Porb/Prot and phi are free.
    pub config: Value,
    /// The grid, if that route is taken.
    pub grid: Option<Nodes>,
    /// Whether there is a chain.
    pub chain: bool,
    /// Draws of the periodogram's false alarms, if that route is taken.
    pub periodogram: Option<usize>,
}

impl Case {
    /// Runs it; landscape and chain are kept in `folder`.
    ///
    /// # Errors
    /// [`ExperimentError`].
    pub fn run(&self, folder: &Path, pool: &Pool) -> Result<Outcome, ExperimentError> {
        write_json(&folder.join("config.json"), &self.config)?;
        match self.tried(folder, pool) {
            // no image, no maximum: that is a result too
            Err(error) if error.is_of_the_star() => Ok(Outcome { failed: Some(error.to_string()), ..self.nothing() }),
            tried => tried,
        }
    }

    /// An outcome without any result.
    fn nothing(&self) -> Outcome {
        Outcome {
            config: self.config.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            failed: None,
            truth: BTreeMap::new(),
            chi2_target: f64::NAN,
            lambda_data: f64::NAN,
            spottedness: f64::NAN,
            search_reconstructions: 0,
            search_seconds: 0.0,
            grid: None,
            chain: None,
            k_upper95_kms: None,
            periodogram: None,
            false_alarm: None,
        }
    }

    fn tried(&self, folder: &Path, pool: &Pool) -> Result<Outcome, ExperimentError> {
        let began = Instant::now();
        let (scene, found) = search(&self.config, &folder.join("config.json"), pool)?;
        let search_seconds = began.elapsed().as_secs_f64();
        let image = found.posterior.mapped().map(|posterior| &posterior.reference().solution);
        let data = scene.imager.data.depth.len() as f64;
        let ends = found.attempts.iter().filter_map(|attempt| attempt.end.as_ref().ok());
        let mut outcome = Outcome {
            truth: scene.truth.map(|values| by_name(&values)).unwrap_or_default(),
            chi2_target: scene.settings.imaging.chi2_target.value(),
            lambda_data: image.map_or(f64::NAN, |image| image.image.lambda * data),
            spottedness: image.map_or(f64::NAN, |image| image.spottedness),
            search_reconstructions: ends.map(|end| end.evaluations).sum::<usize>() + found.optimum.evaluations,
            search_seconds,
            ..self.nothing()
        };
        if let Some(nodes) = &self.grid {
            let grid = nodes.grid(&found.optimum);
            outcome.grid = Some(landscape(&scene, found.clone(), grid, &folder.join("grid"), pool)?.0);
        }
        if self.chain {
            let (route, summary) = chain(&scene, found, &folder.join("chain"), pool)?;
            outcome.k_upper95_kms = summary.parameters[Parameter::K.name()].upper95;
            outcome.chain = Some(route);
        }
        if let Some(draws) = self.periodogram {
            let (route, false_alarm) = periodogram(&scene, draws)?;
            (outcome.periodogram, outcome.false_alarm) = (Some(route), Some(false_alarm));
        }
        Ok(outcome)
    }
}

impl Nodes {
    /// The grid; the best orbit is where the curvature is known.
    pub(super) fn grid(&self, optimum: &Optimum) -> Grid {
        let orbit = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi];
        let axis = |(i, parameter): (usize, &Parameter)| {
            let periodic = *parameter == Parameter::Phi;
            let (min, max, nodes) = match self {
                Nodes::At(axes) => axes[i],
                Nodes::Around(nodes) => {
                    let (best, sd) = (optimum.theta[i], optimum.written_covariance[(i, i)].max(0.0).sqrt());
                    let reach = REACH * sd;
                    match parameter {
                        Parameter::Phi if reach >= 0.5 => (0.0, 1.0, *nodes),
                        Parameter::K => ((best - reach).max(0.0), best + reach, *nodes),
                        Parameter::PorbOverProt => ((best - reach).max(SHORTEST), best + reach, *nodes),
                        _ => (best - reach, best + reach, *nodes),
                    }
                }
            };
            Axis { name: parameter.name().to_owned(), min, max, nodes, periodic }
        };
        Grid { axes: orbit.iter().enumerate().map(axis).collect() }
    }
}

/// The star of a config, and the best parameters there; its target chi2 is raised if it is out of reach.
pub fn search(config: &Value, path: &Path, pool: &Pool) -> Result<(Scene, Found), ExperimentError> {
    let found =
        |scene: Scene| match search::find(&scene.imager, &scene.space, SearchSettings::new(&scene.settings), &|_| ()) {
            Ok(found) => Ok(Ok((scene, found))),
            Err(SearchError::Reference(error)) => Ok(Err(error)),
            Err(error) => Err(error),
        };
    let mut last = match found(Scene::new(&Config::at(config.clone(), path))?)? {
        Ok(found) => return Ok(found),
        Err(error) => error,
    };
    if matches!(last, ReferenceError::NothingToFit { .. }) {
        return Err(last.into());
    }
    let first = Scene::new(&Config::at(config.clone(), path))?;
    let target = first.settings.imaging.chi2_target.value();
    let reached = Reference::provisional(&first.imager, first.settings.values, target)?.solution.chi2;
    let reached = reached / first.imager.data.depth.len() as f64;
    for factor in ABOVE_REACHED {
        if pool.stopped() {
            return Err(ExperimentError::Interrupted);
        }
        let target = json!((1e4 * factor * reached).round() / 1e4);
        match found(Scene::new(&Config::at(with(config.clone(), &[("/imaging/chi2_target", target)]), path))?)? {
            Ok(found) => return Ok(found),
            Err(error) => last = error,
        }
    }
    Err(last.into())
}

/// The landscape on `grid`, kept in `folder`, and its paraboloid.
pub fn landscape(
    scene: &Scene,
    found: Found,
    grid: Grid,
    folder: &Path,
    pool: &Pool,
) -> Result<(Route, GridScan), ExperimentError> {
    let began = Instant::now();
    let names: Vec<String> = grid.names().map(str::to_owned).collect();
    let free = scene.settings.free.iter().filter(|f| names.iter().any(|name| name == f.parameter.name()));
    let plan = GridSettings { free: free.copied().collect(), grid };
    std::fs::create_dir_all(folder).map_err(|source| ExperimentError::Folder { path: folder.into(), source })?;
    // one that was stopped goes on
    let mut survey = match GridScan::resume(scene, &plan, folder) {
        Err(GridScanError::Origin(_)) => GridScan::begin(scene, &plan, found, folder, true)?,
        resumed => resumed?,
    };
    let resumed = !survey.landscape.nodes().is_empty();
    if !survey.go(pool, |_| ())? {
        return Err(ExperimentError::Interrupted);
    }
    let fitted = paraboloid(&survey.landscape, Rule::default());
    let truth = survey.header.origin.truth.as_ref();
    ParaboloidFile::new(&plan.grid, Rule::default(), truth, &fitted).write(&folder.join(PARABOLOID))?;
    let route = Route {
        note: fitted.as_ref().err().map(Undefined::to_string),
        parameters: fitted.ok().map(|fitted| vertex(&fitted)).unwrap_or_default(),
        reconstructions: survey.landscape.nodes().len(),
        seconds: if resumed { f64::NAN } else { began.elapsed().as_secs_f64() },
    };
    Ok((route, survey))
}

fn vertex(fitted: &Paraboloid) -> BTreeMap<String, Estimate> {
    let estimate = |(name, one): (&String, &crate::sampling::landscape::Estimate)| {
        (name.clone(), Estimate::gaussian(one.vertex, one.error))
    };
    fitted.parameters.iter().map(estimate).collect()
}

/// The chain, kept in `folder`, and its summary.
pub fn chain(scene: &Scene, found: Found, folder: &Path, pool: &Pool) -> Result<(Route, RunSummary), ExperimentError> {
    let began = Instant::now();
    let resumed = folder.join(CHAIN).exists();
    let mut run = match Run::resume(scene, folder, None, pool) {
        Err(RunError::Origin(_)) => Run::in_memory(scene, found, StartFrom::Optimum, pool)?.kept_in(folder, true)?,
        resumed => resumed?,
    };
    if run.go(pool, |_, _| ())? == StopReason::Interrupted {
        return Err(ExperimentError::Interrupted);
    }
    let (summary, _) = run.manifest.summarise(&scene.settings, &run.chain)?;
    let estimate = |one: &crate::sampling::chain::summary::ParameterSummary| Estimate {
        value: one.median,
        ci68: one.ci68,
        ci95: one.ci95,
    };
    let route = Route {
        parameters: summary.parameters.iter().map(|(name, one)| (name.clone(), estimate(one))).collect(),
        reconstructions: run.preparation + summary.evaluations,
        seconds: if resumed { f64::NAN } else { began.elapsed().as_secs_f64() },
        note: (!summary.converged).then(|| "not converged".to_owned()),
    };
    Ok((route, summary))
}

/// The best orbit of the periodogram, and its false-alarm probability.
fn periodogram(scene: &Scene, draws: usize) -> Result<(Route, f64), ExperimentError> {
    let began = Instant::now();
    let imager = &scene.imager;
    let frequencies = Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, FrequencySettings::default())?;
    let settings = DetectionSettings {
        chi2_target: scene.settings.imaging.chi2_target.value(),
        nuisances: nuisances(&scene.settings.free),
        search: PeriodSearch { draws, seed: 1 },
        eccentric: false,
        second_planet: false,
        spots: Spots::OneMap(None),
    };
    let found = Detection::find(imager, scene.settings.values, frequencies, &settings, &|_| ())?;
    let (peak, orbit) = (&found.best, &found.best.orbit);
    let estimates = [
        (Parameter::K, orbit.k_kms, Some(orbit.sigma_k_kms)),
        (Parameter::PorbOverProt, peak.porb_over_prot, peak.sigma_porb_over_prot),
        (Parameter::Phi, orbit.phi, Some(orbit.sigma_phi)),
    ];
    let estimate = |(parameter, value, sigma): (Parameter, f64, Option<f64>)| {
        Some((parameter.name().to_owned(), Estimate::gaussian(value, sigma?)))
    };
    let blind = &found.blind;
    let false_alarm = blind.false_alarm.probability(blind.best().orbit.delta_ln_l).value();
    let route = Route {
        parameters: estimates.into_iter().filter_map(estimate).collect(),
        reconstructions: 1 + found.rounds,
        seconds: began.elapsed().as_secs_f64(),
        note: peak.on_edge.then(|| "the best period lies on the edge of the search".to_owned()),
    };
    Ok((route, false_alarm))
}
