//! `dimcmc analyse`: credible intervals and convergence of a run.

use super::signals::{RESULT, Signals};
use super::{Failure, Global, console};
use crate::runs::manifest::Manifest;
use crate::runs::run::{Conclusion, read_chain};
use crate::sampling::chain::Chain;
use std::path::{Path, PathBuf};

/// Credible intervals and convergence of a run
///
/// Prints a table (with the injected values where they are known) and writes summary.json into the run's folder. An
/// earlier summary.json is replaced.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc analyse runs/demo --verbose")]
pub struct Args {
    /// Folder of the run
    run: PathBuf,
    #[command(flatten)]
    shown: Shown,
}

/// What is printed of a chain.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Shown {
    /// Also print acceptance, cost of an evaluation, and efficiency of each move
    #[arg(long, short)]
    verbose: bool,
}

/// Runs the command.
pub fn run(args: &Args, _global: &Global) -> Result<(), Failure> {
    let _signals = Signals::catch(RESULT)?;
    let manifest = Manifest::read(&args.run).map_err(Failure::of)?;
    let chain = read_chain(&args.run, &manifest)?;
    report(&args.run, &manifest, &chain, args.shown)
}

/// Writes the summary of `chain` into `folder` and prints its table.
pub fn report(folder: &Path, manifest: &Manifest, chain: &Chain, shown: Shown) -> Result<(), Failure> {
    let conclusion = Conclusion::of(folder, manifest, chain).map_err(|e| Failure::run(folder, e))?;
    conclusion.write(folder).map_err(|e| Failure::run(folder, e))?;
    console::line(conclusion.text);
    if shown.verbose {
        console::line(conclusion.diagnostics);
    }
    Ok(())
}
