//! `dimcmc optimise`: the best parameters and their curvature.

use super::output::{Output, fitted, remarks, scene};
use super::search::search;
use super::signals::{RESULT, Signals};
use super::{Failure, Global, console};
use crate::data::config::Config;
use crate::runs::optimum::{self, OptimumFile};
use std::path::PathBuf;

/// Find the maximum of the posterior, with uncertainties
///
/// Climbs from the config's values and from other orbits within the prior, using the gradient of the log-probability.
/// Uncertainties follow from the curvature at the maximum. Writes optimum.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc optimise configs/demo.json --out runs/demo_optimum")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    let scene = scene(&Config::load(&args.config)?)?;
    args.output.spare(&scene.files(), |name| name == optimum::FILE)?;
    remarks(&scene);
    scene.settings.require_free()?;
    let scene = fitted(global, scene);
    let found = search(global, &args.config, &scene, &scene.space)?;
    let file = OptimumFile::new(&scene, &found);
    signals.defer();
    let folder = args.output.create()?;
    file.write(&folder)?;
    console::print(file.table());
    Ok(())
}
