//! One simulated star, and the three routes to its planet's orbit: grid and paraboloid (the paper's), chain,
//! periodogram.
//!
//! Grid and chain share the search for the reference. With a wrong model of the star the target chi2 may be out of
//! reach; then it is raised to an attainable value, as an observer would do, and the outcome reports it.

use super::{Estimate, Failure, Interrupted, Outcome, Route, with};
use dimcmc::internals::data::config::GridSettings;
use dimcmc::internals::data::io::atomic::write_json;
use dimcmc::internals::data::io::paraboloid::ParaboloidFile;
use dimcmc::internals::inference::detection::{Detection, DetectionSettings};
use dimcmc::internals::inference::search::{self, SearchError};
use dimcmc::internals::planets::periodogram::{Frequencies, SearchSettings as PeriodSearch};
use dimcmc::internals::runs::grid_scan::{GridScan, GridScanError, PARABOLOID};
use dimcmc::internals::runs::run::CHAIN;
use dimcmc::internals::sampling::landscape::{Axis, Grid, Rule, Undefined, paraboloid};
use dimcmc::internals::surface::ReferenceError;
use dimcmc::internals::surface::SurfaceError;
use dimcmc::internals::surface::SurfaceSettings;
use dimcmc::internals::surface::expansion::nuisances;
use dimcmc::internals::surface::record::by_name;
use dimcmc::internals::surface::static_map::Posterior;
use dimcmc::internals::surface::static_map::Reference;
use dimcmc::{Config, Found, FrequencySettings, Optimum, Parameter, Pool, Run, RunError, Scene, StartFrom, StopReason};
use dimcmc::{ParameterSummary, RunSummary};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Nodes on each side of the best orbit along every axis, in standard deviations of the curvature.
const REACH: f64 = 3.0;

/// Shortest period on a grid, over the rotation period.
const SHORTEST: f64 = 0.3;

/// A target out of reach is set above what a provisional reference reaches, by the first of these factors at which
/// there is an image at the best orbit.
const ABOVE_REACHED: [f64; 5] = [1.05, 1.08, 1.12, 1.2, 1.5];

/// The nodes of a grid over K, Porb/Prot and phi.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum Nodes {
    /// This many along each axis, around the best orbit.
    Around(usize),
    /// Ends and number of nodes of each axis.
    At([(f64, f64, usize); 3]),
}

/// One star.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Name of its folder.
    pub name: String,
    /// Its config; K, Porb/Prot and phi are free.
    pub config: Value,
    /// The grid, if that route is taken.
    pub grid: Option<Nodes>,
    /// Whether there is a chain.
    pub chain: bool,
    /// Draws for the periodogram's false-alarm probability, if that route is taken.
    pub periodogram: Option<usize>,
}

impl Case {
    /// Runs it; likelihood grid and chain are stored in `folder`.
    pub fn run(&self, folder: &Path, pool: &Pool) -> Result<Outcome, Failure> {
        write_json(&folder.join("config.json"), &self.config)?;
        match self.tried(folder, pool) {
            // no image, no maximum: that is a result too
            Err(error) if is_of_the_star(&error) => {
                Ok(Outcome { failed: Some(error.to_string()), ..Outcome::default() })
            }
            tried => tried,
        }
    }

    fn tried(&self, folder: &Path, pool: &Pool) -> Result<Outcome, Failure> {
        let began = Instant::now();
        let (scene, found) = search(&self.config, &folder.join("config.json"), pool)?;
        let search_seconds = began.elapsed().as_secs_f64();
        let image = Posterior::behind(&*found.posterior).map(|posterior| &posterior.reference().solution);
        let data = scene.imager.data.depth.len() as f64;
        let ends = found.attempts.iter().filter_map(|attempt| attempt.end.as_ref().ok());
        let mut outcome = Outcome {
            truth: scene.truth.map(|values| by_name(&values)).unwrap_or_default(),
            chi2_target: Some(scene.chi2_target),
            lambda_data: image.map(|image| image.image.lambda * data),
            spottedness: image.map(|image| image.spottedness),
            search_reconstructions: ends.map(|end| end.evaluations).sum::<usize>() + found.optimum.evaluations,
            search_seconds,
            ..Outcome::default()
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

/// Whether the failure is due to the star: one that cannot be imaged, or has no best orbit, is a result of an
/// experiment.
pub fn is_of_the_star(error: &Failure) -> bool {
    error.is::<SearchError>()
        || error.is::<ReferenceError>()
        || error.is::<SurfaceError>()
        || matches!(error.downcast_ref(), Some(RunError::UnresolvedSpots(_) | RunError::PriorStart))
}

impl Nodes {
    /// The grid; the best orbit is where the curvature is known.
    pub fn grid(&self, optimum: &Optimum) -> Grid {
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
pub fn search(config: &Value, path: &Path, pool: &Pool) -> Result<(Scene, Found), Failure> {
    let found = |scene: Scene| match search::find(&scene.imager, &scene.space, scene.search_settings(), &|_| ()) {
        Ok(found) => Ok(Ok((scene, found))),
        Err(SearchError::Reference(error)) => Ok(Err(error)),
        Err(error) => Err(Failure::from(error)),
    };
    let mut last = match found(Scene::new(&Config::at(config.clone(), path))?)? {
        Ok(found) => return Ok(found),
        Err(error) => error,
    };
    if matches!(last, ReferenceError::NothingToFit { .. }) {
        return Err(last.into());
    }
    let first = Scene::new(&Config::at(config.clone(), path))?;
    let target = first.chi2_target;
    let reached = Reference::provisional(&first.imager, first.settings.values, target)?.solution.chi2;
    let reached = reached / first.imager.data.depth.len() as f64;
    for factor in ABOVE_REACHED {
        if pool.stopped() {
            return Err(Interrupted.into());
        }
        let target = json!((1e4 * factor * reached).round() / 1e4);
        match found(Scene::new(&Config::at(with(config.clone(), &[("/imaging/chi2_target", target)]), path))?)? {
            Ok(found) => return Ok(found),
            Err(error) => last = error,
        }
    }
    Err(last.into())
}

/// The likelihood grid on `grid`, stored in `folder`, and its paraboloid.
pub fn landscape(
    scene: &Scene,
    found: Found,
    grid: Grid,
    folder: &Path,
    pool: &Pool,
) -> Result<(Route, GridScan), Failure> {
    let began = Instant::now();
    let names: Vec<String> = grid.names().map(str::to_owned).collect();
    let free = scene.settings.free.iter().filter(|f| names.iter().any(|name| name == f.parameter.name()));
    let plan = GridSettings { free: free.copied().collect(), grid };
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    // a stopped one is resumed
    let mut survey = match GridScan::resume(scene, &plan, folder) {
        Err(GridScanError::Origin(_)) => GridScan::begin(scene, &plan, found, folder, GridScan::claim(folder, true)?)?,
        resumed => resumed?,
    };
    let resumed = !survey.landscape.nodes().is_empty();
    if !survey.go(pool, |_| ())? {
        return Err(Interrupted.into());
    }
    let fitted = paraboloid(&survey.landscape, Rule::default());
    let truth = survey.header.origin.truth.as_ref();
    ParaboloidFile::new(&plan.grid, Rule::default(), truth, &fitted).write(&folder.join(PARABOLOID))?;
    let vertex = |(name, one): (&String, &dimcmc::internals::sampling::landscape::Estimate)| {
        (name.clone(), Estimate::gaussian(one.vertex, one.error))
    };
    let route = Route {
        note: fitted.as_ref().err().map(Undefined::to_string),
        parameters: fitted.map(|fitted| fitted.parameters.iter().map(vertex).collect()).unwrap_or_default(),
        reconstructions: survey.landscape.nodes().len(),
        seconds: (!resumed).then(|| began.elapsed().as_secs_f64()),
    };
    Ok((route, survey))
}

/// The chain, stored in `folder`, and its summary.
pub fn chain(scene: &Scene, found: Found, folder: &Path, pool: &Pool) -> Result<(Route, RunSummary), Failure> {
    let began = Instant::now();
    let resumed = folder.join(CHAIN).exists();
    let mut run = match Run::resume(scene, folder, None, pool) {
        Err(RunError::Origin(_)) => Run::in_memory(scene, found, StartFrom::Optimum, pool)?.kept_in(folder, true)?,
        resumed => resumed?,
    };
    if run.go(pool, |_, _| ())? == StopReason::Interrupted {
        return Err(Interrupted.into());
    }
    let (summary, _) = run.manifest.summarise(&scene.settings, &run.chain)?;
    let estimate = |one: &ParameterSummary| Estimate { value: one.median, ci68: one.ci68, ci95: one.ci95 };
    let route = Route {
        parameters: summary.parameters.iter().map(|(name, one)| (name.clone(), estimate(one))).collect(),
        reconstructions: run.preparation + summary.evaluations,
        seconds: (!resumed).then(|| began.elapsed().as_secs_f64()),
        note: (!summary.converged).then(|| "not converged".to_owned()),
    };
    Ok((route, summary))
}

/// The best orbit of the periodogram, and its false-alarm probability.
fn periodogram(scene: &Scene, draws: usize) -> Result<(Route, f64), Failure> {
    let began = Instant::now();
    let imager = &scene.imager;
    let frequencies = Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, FrequencySettings::default())?;
    let settings = DetectionSettings {
        search: PeriodSearch { draws, seed: 1 },
        ..DetectionSettings::of(SurfaceSettings::spottedness(scene.chi2_target), nuisances(&scene.settings.free))
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
        seconds: Some(began.elapsed().as_secs_f64()),
        note: peak.on_edge.then(|| "the best period lies on the edge of the search".to_owned()),
    };
    Ok((route, false_alarm))
}
