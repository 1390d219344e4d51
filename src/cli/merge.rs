//! `dimcmc merge`: runs of independent ensembles joined into one.

use super::output::Output;
use super::signals::{RESULT, Signals};
use super::{Failure, Global, analyse, console};
use crate::numerics::text::shown;
use crate::runs::merge::{MergeError, merge};
use std::path::PathBuf;

/// Merge runs that differ only in their seed
///
/// For chains sampled by a job array. The runs must share config, data, program version and reference, and differ in
/// their seeds. The merged run has all ensembles, the number of steps of the shortest run, and R-hat between all
/// ensembles. `analyse`, `compare`, `plot`, `report` and `export` accept it like any run. It cannot be extended: extend
/// the runs, then merge again. Writes manifest.json, chain.jsonl and summary.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc merge runs/demo runs/demo_2 --out runs/merged")]
pub struct Args {
    /// Folders of the runs
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    #[command(flatten)]
    output: Output,
    #[command(flatten)]
    shown: analyse::Shown,
}

/// Runs the command.
pub fn run(args: &Args, _global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    let same = |run: &&PathBuf| std::fs::canonicalize(run).ok() == std::fs::canonicalize(args.output.folder()).ok();
    if args.output.folder().exists() && args.runs.iter().any(|run| same(&run)) {
        let problem = "is one of the runs: give a new folder";
        return Err(Failure::input(format!("--out {}: {problem}", args.output.folder().display())));
    }
    let merged = merge(&args.runs).map_err(failure)?;
    signals.defer();
    let folder = args.output.create()?;
    merged.write(&folder, args.output.replaces()).map_err(failure)?;
    analyse::report(&folder, &merged.manifest, &merged.chain, args.shown)?;
    for (run, beyond) in args.runs.iter().zip(&merged.beyond).filter(|(_, beyond)| **beyond > 0) {
        let shortest = merged.chain.steps() - 1;
        console::line(format_args!(
            "note: {}: its last {beyond} steps are left out, the shortest run ends at step {shortest}",
            shown(run)
        ));
    }
    Ok(())
}

fn failure(error: MergeError) -> Failure {
    match error {
        MergeError::Write(_) | MergeError::Chain(_) => Failure::failed(error),
        error => Failure::of(error),
    }
}
