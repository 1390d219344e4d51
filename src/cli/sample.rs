//! `dimcmc sample`: the ensemble chain.

use super::output::{Output, fitted, remarks, scene};
use super::search::search;
use super::signals::Signals;
use super::{Failure, Global, analyse, cluster, console, progress};
use crate::data::config::Config;
use crate::data::io::effort::EFFORT;
use crate::runs::manifest;
use crate::runs::run::{CHAIN, Cost, Meter, Pace, Run, RunError, SUMMARY, StartFrom};
use crate::sampling::ensemble::{MOST_STEPS, StopReason};
use indicatif::{HumanDuration, ProgressBar};
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Sample the posterior of the free parameters
///
/// Searches for the best parameters, then runs independent ensembles until every parameter reaches the R-hat and
/// effective sample size of the config, or the step limit. Writes manifest.json, chain.jsonl and summary.json.
/// Interrupted runs can be resumed with `--resume`; the result is bit-identical to an uninterrupted run.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc sample configs/demo.json --out runs/demo\n  \
                        dimcmc sample configs/demo.json --out runs/demo --extend 500\n  \
                        dimcmc sample configs/demo.json --out runs/demo_2 --seed 2")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Resume the run in the folder
    #[arg(long)]
    resume: bool,
    /// Resume the run in the folder and make N more steps in any case
    #[arg(long, value_name = "N", conflicts_with = "resume")]
    extend: Option<usize>,
    /// Where the walkers start
    #[arg(long, value_enum, default_value = "optimum", conflicts_with_all = ["resume", "extend"])]
    start: Start,
    /// Seed, in place of sampler.seed: for runs of one config to be merged
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    shown: analyse::Shown,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Start {
    /// Around the maxima found by the search
    Optimum,
    /// Drawn from the prior
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
    let scene = scene(&match args.seed {
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
        let claim = || Run::claim(folder, args.output.replaces());
        let claim = cluster::claim(&pool, &signals, claim).map_err(failed)?;
        let scene = fitted(global, scene.clone());
        let found = search(global, &args.config, &scene, &scene.space)?;
        let spinner = progress::bar(global, None, "start of the walkers");
        signals.defer();
        let run = Run::in_memory(&scene, found, from, &pool).and_then(|run| run.kept_by(claim()?, folder));
        spinner.finish_and_clear();
        run.map_err(failed)?
    };
    signals.defer();
    let cost = Cost::of(&run);
    if !resume && cost.time() > WORTH_SAYING && std::io::stderr().is_terminal() {
        console::note(words(&cost));
    }
    let bar = progress::bar(global, Some(BAR), "first step");
    let mut meter = Meter::new(&run);
    let reason = run.go(&pool, |records, convergence| show(&bar, &meter.step(records, convergence)));
    bar.finish_and_clear();
    let noted = Run::note_effort(folder, !resume, began.elapsed().as_secs_f64(), pool.size());
    match reason.map_err(failed)? {
        StopReason::Interrupted => {
            let step = run.chain.steps().saturating_sub(1);
            let (config, folder) = (args.config.display(), folder.display());
            let seed = args.seed.map(|seed| format!(" --seed {seed}")).unwrap_or_default();
            Err(signals.interrupted(format!(
                "interrupted after step {step}; resume with: dimcmc sample {config} --out {folder}{seed} --resume"
            )))
        }
        StopReason::Converged | StopReason::StepLimit => {
            noted.map_err(failed)?;
            analyse::report(folder, &run.manifest, &run.chain, args.shown)
        }
    }
}

/// Chains that take longer are announced.
const WORTH_SAYING: Duration = Duration::from_secs(20);

/// The expected cost of a chain, as text.
fn words(cost: &Cost) -> String {
    let Cost { steps, is_limit, evaluations, of_a_step } = *cost;
    let time = HumanDuration(cost.time());
    let each = of_a_step.as_secs_f64() / evaluations as f64;
    let bound = if is_limit { "at most" } else { "some" };
    format!(
        "the chain takes {bound} {steps} steps of {evaluations} evaluations, {each:.2} s each with all threads: \
        {time:#}; it ends when every parameter has reached its goals"
    )
}

/// Divisions of the bar.
const BAR: u64 = 1000;

/// Shows the progress of a chain.
fn show(bar: &ProgressBar, pace: &Pace) {
    bar.set_position((BAR as f64 * pace.step as f64 / pace.end.max(1.0)) as u64);
    let convergence = pace.convergence.as_ref().map(|words| format!(", {words}")).unwrap_or_default();
    bar.set_message(format!(
        "{}/{}, {}{:#} left, {:.0} rec/s, acceptance {:.2}{convergence}",
        pace.step,
        pace.last_step,
        // until the goals are in sight, only the step limit is known
        if pace.in_sight { "" } else { "at most " },
        HumanDuration(pace.left),
        pace.rate,
        pace.acceptance,
    ));
}
