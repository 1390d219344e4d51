//! `dimcmc sample`: the ensemble chain.

use super::output::Output;
use super::{Failure, Global, analyse, progress};
use dimcmc::chain::{Convergence, Record};
use dimcmc::ensemble::StopReason;
use dimcmc::log_density::Status;
use dimcmc::run::{Run, StartFrom};
use dimcmc::scene::Scene;
use dimcmc::search::Stage;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Sample the posterior of the free parameters
///
/// Searches for the best parameters, then runs independent ensembles until every parameter has reached the R-hat and effective
/// sample size of the config, or the step limit. Writes manifest.json, chain.jsonl and summary.json. A run that was stopped,
/// by whatever, goes on with --resume and comes to the same bytes as one that was not.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc sample configs/demo.json --out runs/demo\n  \
                        dimcmc sample configs/demo.json --out runs/demo --extend 500")]
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
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Start {
    /// Around the optimum
    Optimum,
    /// All over the prior
    Prior,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let resume = args.resume || args.extend.is_some();
    if !resume {
        args.output.check()?;
    }
    let scene = Scene::load(&args.config)?;
    scene.settings.require_free()?;
    let folder = args.output.folder();
    let failed = |e| Failure::run(&args.config, e);
    let mut run = if resume {
        Run::resume(&scene, folder, args.extend).map_err(failed)?
    } else {
        let from = match args.start {
            Start::Optimum => StartFrom::Optimum,
            Start::Prior => StartFrom::Prior,
        };
        let spinner = progress::bar(global, None, "reconstructing");
        let run = Run::begin(&scene, folder, from, |stage| {
            spinner.set_message(match stage {
                Stage::FirstImage => "reconstructing at the config's values".to_string(),
                Stage::Climbing { starts } => format!("searching for the best parameters from {starts} starts"),
                Stage::Reference => "reference image and trade-off curve".to_string(),
            });
        });
        spinner.finish_and_clear();
        run.map_err(failed)?
    };
    let stop = stop_on_signals()?;
    let mut meter = Meter::new(global, &run);
    let reason = run.go(&stop, |records, convergence| meter.step(records, convergence));
    meter.bar.finish_and_clear();
    match reason.map_err(failed)? {
        StopReason::Interrupted => {
            let step = run.chain.steps().saturating_sub(1);
            let (config, folder) = (args.config.display(), folder.display());
            Err(Failure::failed(format!(
                "interrupted after step {step}; go on with: dimcmc sample {config} --out {folder} --resume"
            )))
        }
        StopReason::Converged | StopReason::StepLimit => analyse::report(folder, &run.manifest, &run.chain),
    }
}

/// A flag that the first Ctrl-C (or SIGTERM) sets; the second one ends the program at once.
fn stop_on_signals() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)))
            .map_err(|e| Failure::failed(format!("signal {signal}: {e}")))?;
    }
    Ok(stop)
}

/// What is shown while a chain grows.
struct Meter {
    bar: indicatif::ProgressBar,
    names: Vec<String>,
    began: Instant,
    first_step: usize,
    evaluations: usize,
    accepted: usize,
    moved: usize,
    convergence: String,
    ess_goal: f64,
    /// Fraction of the ESS goal reached, at the last look.
    done: f64,
}

impl Meter {
    fn new(global: &Global, run: &Run) -> Self {
        let bar = progress::bar(global, Some(run.last_step() as u64), "");
        bar.set_style(progress::style("{wide_bar} {pos}/{len} {msg}"));
        let first_step = run.chain.steps().saturating_sub(1);
        bar.set_position(first_step as u64);
        Meter {
            bar,
            names: run.manifest.names.clone(),
            began: Instant::now(),
            first_step,
            evaluations: 0,
            accepted: 0,
            moved: 0,
            convergence: "R-hat -".into(),
            ess_goal: run.ess_goal(),
            done: 0.0,
        }
    }

    fn step(&mut self, records: &[Record], convergence: Option<&Convergence>) {
        self.evaluations += records.iter().filter(|r| r.proposed != Status::OutsidePrior).count();
        self.accepted += records.iter().filter(|r| r.accepted).count();
        self.moved += records.len();
        let step = records.first().map_or(0, |r| r.step);
        if let Some(convergence) = convergence {
            self.look(convergence);
        }
        let elapsed = self.began.elapsed().as_secs_f64();
        let per_step = elapsed / (step.saturating_sub(self.first_step)).max(1) as f64;
        let to_limit = (self.bar.length().unwrap_or(0) as f64 - step as f64).max(0.0);
        let to_goal = if self.done > 0.0 { step as f64 * (1.0 / self.done.min(1.0) - 1.0) } else { to_limit };
        let left = indicatif::HumanDuration(std::time::Duration::from_secs_f64(per_step * to_limit.min(to_goal)));
        self.bar.set_position(step as u64);
        self.bar.set_message(format!(
            "{:.0} rec/s, acceptance {:.2}, {}, {left:#} left",
            self.evaluations as f64 / elapsed.max(1e-9),
            self.accepted as f64 / self.moved as f64,
            self.convergence,
        ));
    }

    /// The parameter that is farthest from its goals.
    fn look(&mut self, convergence: &Convergence) {
        let worst = convergence.diagnostics.iter().zip(&self.names);
        let rhat = worst.clone().filter_map(|(d, name)| Some((d.rhat?, name))).max_by(|a, b| a.0.total_cmp(&b.0));
        let ess = worst.filter_map(|(d, _)| d.ess).fold(f64::INFINITY, f64::min);
        if let Some((rhat, name)) = rhat.filter(|_| ess.is_finite()) {
            self.convergence = format!("R-hat {rhat:.3} ({name}), ESS {ess:.0}");
            self.done = ess / self.ess_goal;
        }
    }
}
