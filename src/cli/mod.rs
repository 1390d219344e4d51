//! The commands, one file each: what is asked, which parts of the library answer, what is printed. No formulas.
//!
//! A command is a file with `Args` (clap, an example in `after_help`) and `run(&Args, &Global) -> Result<(), Failure>`, and one
//! line each in [`Command`] and [`run`]. Both spellings of a name: `#[command(alias = "analyze")]`.

mod analyse;
mod compare;
mod failure;
mod grid;
mod map;
mod optimise;
mod output;
mod periodogram;
mod plot;
mod progress;
mod report;
mod report_lines;
mod sample;
mod search;
mod signals;
mod simulate;

pub use failure::Failure;

use clap::{Parser, Subcommand};
use std::num::NonZeroUsize;

/// Orbits of planets around spotted stars: maximum-entropy Doppler imaging inside an ensemble sampler.
#[derive(Debug, Parser)]
#[command(name = "dimcmc", version, arg_required_else_help = true)]
pub struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Options of every command.
#[derive(Debug, clap::Args)]
pub struct Global {
    /// Number of threads; all processors if not given. Results do not depend on it
    #[arg(long, global = true, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// No progress bar
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    Simulate(simulate::Args),
    Map(map::Args),
    Periodogram(periodogram::Args),
    #[command(alias = "optimize")]
    Optimise(optimise::Args),
    Grid(grid::Args),
    Sample(sample::Args),
    #[command(alias = "analyze")]
    Analyse(analyse::Args),
    Compare(compare::Args),
    Plot(plot::Args),
    Report(report::Args),
}

/// Runs the command.
pub fn run(cli: &Cli) -> Result<(), Failure> {
    if let Some(threads) = cli.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()
            .map_err(|e| Failure::failed(format!("--threads {threads}: {e}")))?;
    }
    match &cli.command {
        Command::Simulate(args) => simulate::run(args),
        Command::Map(args) => map::run(args, &cli.global),
        Command::Periodogram(args) => periodogram::run(args, &cli.global),
        Command::Optimise(args) => optimise::run(args, &cli.global),
        Command::Grid(args) => grid::run(args, &cli.global),
        Command::Sample(args) => sample::run(args, &cli.global),
        Command::Analyse(args) => analyse::run(args, &cli.global),
        Command::Compare(args) => compare::run(args, &cli.global),
        Command::Plot(args) => plot::run(args, &cli.global),
        Command::Report(args) => report::run(args, &cli.global),
    }
}

/// Clap's own consistency checks.
#[test]
fn the_command_line_is_consistent() {
    use clap::CommandFactory as _;
    Cli::command().debug_assert();
}
