//! `dimcmc compare`: a chain compared with a likelihood grid.

use super::output::Output;
use super::signals::{RESULT, Signals};
use super::{Failure, Global, console};
use crate::data::io::atomic::write_json;
use crate::data::io::paraboloid;
use crate::numerics::text::shown;
use crate::runs::comparison::{Comparison, FILE, Pair};
use crate::runs::grid_scan::PARABOLOID;
use crate::runs::run::CHAIN;
use std::path::PathBuf;

/// Compare a chain with a likelihood grid of the same data
///
/// Per parameter: median and 68 % interval of the chain; vertex and error bar of the paraboloid; median and 68 %
/// interval of the likelihood grid under the chain's prior; their differences, and the cost of each. Run and grid must
/// share data, star, image and objective. Writes comparison.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc compare runs/demo runs/demo_grid --out runs/demo_comparison")]
pub struct Args {
    /// Folder of the run that `sample` wrote
    run: PathBuf,
    /// Folder of the likelihood grid that `grid` wrote
    grid: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Runs the command.
pub fn run(args: &Args, _global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    let pair = Pair::read(&args.run, &args.grid)?;
    let rule = paraboloid::rule(&args.grid.join(PARABOLOID));
    let comparison =
        Comparison::of(&pair, rule).map_err(|e| Failure::input(format!("{}: {e}", args.run.join(CHAIN).display())))?;
    signals.defer();
    let folder = args.output.create()?;
    write_json(&folder.join(FILE), &comparison)?;
    console::line(format_args!("{}written: {}: {FILE}", comparison.table(), shown(&folder)));
    Ok(())
}
