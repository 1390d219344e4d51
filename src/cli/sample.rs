//! `dimcmc sample`: the ensemble chain.

use super::output::{Output, remarks};
use super::search::search;
use super::signals::Signals;
use super::{Failure, Global, analyse, cluster, progress};
use crate::data::config::Config;
use crate::data::io::effort::{EFFORT, Effort};
use crate::data::scene::Scene;
use crate::runs::manifest;
use crate::runs::run::{CHAIN, Run, RunError, SUMMARY, StartFrom};
use crate::sampling::chain::advice::growth_needed;
use crate::sampling::chain::{Convergence, Goals, Record};
use crate::sampling::ensemble::{MOST_STEPS, StopReason};
use crate::sampling::log_density::Status;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Sample the posterior of the free parameters
///
/// Searches for the best parameters, then runs independent ensembles until every parameter has reached the R-hat and
/// effective sample size of the config, or the step limit. Writes manifest.json, chain.jsonl and summary.json. A run
/// that was stopped, by whatever, goes on with --resume and comes to the same bytes as one that was not.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc sample configs/demo.json --out runs/demo\n  \
                        dimcmc sample configs/demo.json --out runs/demo --extend 500\n  \
                        dimcmc sample configs/demo.json --out runs/demo_2 --seed 2")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Go on with the run in the folder
    #[arg(long)]
    resume: bool,
    /// Go on with the run in the folder, and make N more steps in any case
    #[arg(long, value_name = "N", conflicts_with = "resume")]
    extend: Option<usize>,
    /// Where the walkers start
    #[arg(long, value_enum, default_value = "optimum", conflicts_with_all = ["resume", "extend"])]
    start: Start,
    /// In place of the config's sampler.seed: for runs of one config that are merged later
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Start {
    /// Around the maxima that the search finds
    Optimum,
    /// All over the prior
    Prior,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let began = Instant::now();
    let signals = Signals::catch("step")?;
    let resume = args.extend.is_some() || (args.resume && !args.output.cannot_go_on());
    if !resume {
        args.output.check()?;
    }
    if let Some(steps) = args.extend.filter(|steps| *steps > MOST_STEPS) {
        return Err(Failure::input(format!("--extend: must be at most {MOST_STEPS}, not {steps}")));
    }
    let config = Config::load(&args.config)?;
    let scene = Scene::new(&match args.seed {
        Some(seed) => config.with("sampler.seed", seed),
        None => config,
    })?;
    args.output.spare(&scene.files(), |name| [manifest::FILE, CHAIN, SUMMARY, EFFORT].contains(&name))?;
    remarks(&scene);
    scene.settings.require_free()?;
    let folder = args.output.folder();
    let pool = cluster::pool(global, &signals);
    let failed = |error| match error {
        RunError::Interrupted => signals.interrupted(error),
        error => Failure::run(&args.config, error),
    };
    let mut run = if resume {
        signals.defer();
        let spinner = progress::bar(global, None, "reading the chain, reference image");
        let run = Run::resume(&scene, folder, args.extend, &pool);
        spinner.finish_and_clear();
        run.map_err(failed)?
    } else {
        let from = match args.start {
            Start::Optimum => StartFrom::Optimum,
            Start::Prior => StartFrom::Prior,
        };
        let found = search(global, &args.config, &scene, &scene.space)?;
        let spinner = progress::bar(global, None, "start of the walkers");
        args.output.check()?;
        signals.defer();
        let run =
            Run::in_memory(&scene, found, from, &pool).and_then(|run| run.kept_in(folder, args.output.replaces()));
        spinner.finish_and_clear();
        run.map_err(failed)?
    };
    signals.defer();
    let mut meter = Meter::new(global, &run);
    let reason = run.go(&pool, |records, convergence| meter.step(records, convergence));
    meter.bar.finish_and_clear();
    let noted = Effort::add(folder, !resume, began.elapsed().as_secs_f64(), pool.size());
    match reason.map_err(failed)? {
        StopReason::Interrupted => {
            let step = run.chain.steps().saturating_sub(1);
            let (config, folder) = (args.config.display(), folder.display());
            let seed = args.seed.map(|seed| format!(" --seed {seed}")).unwrap_or_default();
            Err(signals.interrupted(format!(
                "interrupted after step {step}; go on with: dimcmc sample {config} --out {folder}{seed} --resume"
            )))
        }
        StopReason::Converged | StopReason::StepLimit => {
            noted?;
            analyse::report(folder, &run.manifest, &run.chain)
        }
    }
}

/// What is shown while a chain grows.
struct Meter {
    bar: indicatif::ProgressBar,
    names: Vec<String>,
    goals: Goals,
    began: Instant,
    first_step: usize,
    last_step: usize,
    evaluations: usize,
    accepted: usize,
    moved: usize,
    /// R-hat and ESS of the parameters farthest from their goals, at the last look.
    convergence: Option<String>,
    /// The step at which the goals should be reached, if one can tell.
    goal_step: Option<f64>,
}

/// Divisions of the bar.
const BAR: u64 = 1000;

impl Meter {
    fn new(global: &Global, run: &Run) -> Self {
        Meter {
            bar: progress::bar(global, Some(BAR), "first step"),
            names: run.manifest.names.clone(),
            goals: *run.goals(),
            began: Instant::now(),
            first_step: run.chain.steps().saturating_sub(1),
            last_step: run.last_step(),
            evaluations: 0,
            accepted: 0,
            moved: 0,
            convergence: None,
            goal_step: None,
        }
    }

    fn step(&mut self, records: &[Record], convergence: Option<&Convergence>) {
        self.evaluations += records.iter().filter(|r| r.proposed != Status::OutsidePrior).count();
        self.accepted += records.iter().filter(|r| r.accepted).count();
        self.moved += records.len();
        let step = records.first().map_or(0, |r| r.step);
        if let Some(convergence) = convergence {
            self.look(step, convergence);
        }
        let elapsed = self.began.elapsed().as_secs_f64();
        let per_step = elapsed / step.saturating_sub(self.first_step).max(1) as f64;
        let limit = self.last_step as f64;
        let end = self.goal_step.map_or(limit, |goal| goal.min(limit));
        let left = Duration::from_secs_f64(per_step * (end - step as f64).max(0.0));
        self.bar.set_position((BAR as f64 * step as f64 / end.max(1.0)) as u64);
        let mut message = format!(
            "{step}/{}, {}{:#} left, {:.0} rec/s, acceptance {:.2}",
            self.last_step,
            // until the goals are in sight, the step limit is all that is known
            if self.goal_step.is_none() { "at most " } else { "" },
            indicatif::HumanDuration(left),
            self.evaluations as f64 / elapsed.max(1e-9),
            self.accepted as f64 / self.moved as f64,
        );
        if let Some(convergence) = &self.convergence {
            message = format!("{message}, {convergence}");
        }
        self.bar.set_message(message);
    }

    /// The parameter that is farthest from its goals.
    fn look(&mut self, step: usize, convergence: &Convergence) {
        let named = || convergence.diagnostics.iter().zip(&self.names);
        let rhat = named().filter_map(|(d, name)| Some((d.rhat?, name))).max_by(|a, b| a.0.total_cmp(&b.0));
        let ess = named().filter_map(|(d, _)| d.ess).reduce(f64::min);
        if let Some(((rhat, name), ess)) = rhat.zip(ess) {
            self.convergence = Some(format!("R-hat {rhat:.3} ({name}), ESS {ess:.0} of {:.0}", self.goals.ess));
            self.goal_step = growth_needed(convergence, &self.goals).map(|growth| growth * step as f64);
        }
    }
}
