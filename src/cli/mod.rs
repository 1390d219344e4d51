//! The commands, one file each: arguments, calls of the library, output. No formulas.
//!
//! A command is a file with `Args` (clap, an example in `after_help`) and `run(&Args, &Global) -> Result<(), Failure>`,
//! one line each in [`Command`] and [`run`], and a place in `groups`. Both spellings of a name: `#[command(alias =
//! "analyze")]`.

mod analyse;
mod batch;
pub mod cluster;
mod compare;
mod completions;
pub mod console;
mod export;
mod failure;
mod grid;
mod groups;
mod import;
mod init;
mod inject;
mod limits;
mod man;
mod map;
mod merge;
mod optimise;
mod output;
mod periodogram;
mod plan;
mod plot;
pub mod progress;
mod report;
mod report_lines;
mod sample;
mod schema;
mod search;
pub mod signals;
mod simulate;
mod survey;

pub use failure::Failure;
pub use init::first_config;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use std::ffi::OsString;
use std::num::NonZeroUsize;

/// The version, with the commit that it was built from where that is known.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), env!("DIMCMC_COMMIT"));

/// Planets around spotted stars: Doppler imaging and orbit inference from LSD profiles.
#[derive(Debug, Parser)]
#[command(name = "dimcmc", version = VERSION, arg_required_else_help = true, max_term_width = 100)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Heading of these options in `--help`.
const GENERAL: &str = "General options";

/// Options of every command.
#[derive(Debug, clap::Args)]
pub struct Global {
    /// Number of threads; all processors if not given, one per MPI rank on a cluster. Results do not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = threads, help_heading = GENERAL)]
    threads: Option<NonZeroUsize>,
    /// No progress bar
    #[arg(long, short, global = true, help_heading = GENERAL)]
    quiet: bool,
    #[arg(skip)]
    ranks: cluster::Others,
}

/// More threads than processors of any machine: the system would take minutes to create them, or fail.
const MOST_THREADS: usize = 4096;

fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let number = text.parse::<NonZeroUsize>().ok().filter(|number| number.get() <= MOST_THREADS);
    number.ok_or_else(|| format!("a whole number from 1 to {MOST_THREADS}"))
}

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::Args),
    Import(import::Args),
    Plan(plan::Args),
    Simulate(simulate::Args),
    Inject(inject::Args),
    Map(map::Args),
    Periodogram(periodogram::Args),
    Limits(limits::Args),
    #[command(alias = "optimize")]
    Optimise(optimise::Args),
    Grid(grid::Args),
    Sample(sample::Args),
    #[command(alias = "analyze")]
    Analyse(analyse::Args),
    Compare(compare::Args),
    Merge(merge::Args),
    Batch(batch::Args),
    Survey(survey::Args),
    Export(export::Args),
    Schema(schema::Args),
    Completions(completions::Args),
    Man(man::Args),
    Plot(plot::Args),
    Report(report::Args),
}

/// The whole command line, for help, manual and completions.
fn command() -> clap::Command {
    groups::grouped(Cli::command())
}

/// The whole program on one machine: reads its `arguments`, the name of the program first, runs the command, prints
/// errors. Returns the exit code.
///
/// Prints help or the error in the arguments and exits, if nothing else is to be done.
pub fn command_line(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    main(arguments, cluster::alone)
}

/// The same as one of several processes.
pub fn main(arguments: impl IntoIterator<Item = OsString>, join: cluster::Join) -> u8 {
    let matches = match command().try_get_matches_from(arguments) {
        Ok(matches) => matches,
        Err(error) => return misused(&error),
    };
    match Cli::from_arg_matches(&matches) {
        Ok(cli) => console::end(run(&cli, join)),
        Err(error) => misused(&error),
    }
}

/// Prints the requested help, or the error in the arguments in one line. Returns the exit code.
fn misused(error: &clap::Error) -> u8 {
    if let Some(failure) = has_moved(error) {
        return console::end(Err(failure));
    }
    if !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        error.exit();
    }
    console::end(Err(Failure::input(in_one_line(&error.to_string()))))
}

/// Combines clap's lines: the error, the suggestion, and the hint at help.
fn in_one_line(text: &str) -> String {
    let (said, usage) = text.split_once("\n\nUsage: ").unwrap_or((text, ""));
    let said = said.split("\n\nFor more").next().unwrap_or_default().trim().trim_start_matches("error: ");
    let parts: Vec<String> = said
        .split("\n\n")
        .map(|part| {
            let lines: Vec<&str> = part.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
            let head = lines.first().copied().unwrap_or_default();
            match lines.len() {
                0 | 1 => head.to_owned(),
                _ => format!("{head} {}", lines[1..].join(", ")),
            }
        })
        .collect();
    let command: Vec<&str> = usage.split_whitespace().take_while(|word| !word.starts_with(['[', '<', '-'])).collect();
    let help = if command.is_empty() { "dimcmc".to_owned() } else { command.join(" ") };
    format!("{}; see {help} --help", parts.join("; "))
}

/// The replacement of a command that no longer exists.
fn has_moved(error: &clap::Error) -> Option<Failure> {
    match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(name)) if name == "reproduce" => {
            Some(Failure::input("`dimcmc reproduce` is now `cargo run --release --example reproduce`"))
        }
        _ => None,
    }
}

/// Runs the command.
fn run(cli: &Cli, join: cluster::Join) -> Result<(), Failure> {
    if cluster::join(&cli.global, join)? == cluster::Done::Everything {
        return Ok(());
    }
    match &cli.command {
        Command::Init(args) => init::run(args, &cli.global),
        Command::Import(args) => import::run(args, &cli.global),
        Command::Plan(args) => plan::run(args, &cli.global),
        Command::Simulate(args) => simulate::run(args),
        Command::Inject(args) => inject::run(args),
        Command::Map(args) => map::run(args, &cli.global),
        Command::Periodogram(args) => periodogram::run(args, &cli.global),
        Command::Limits(args) => limits::run(args, &cli.global),
        Command::Optimise(args) => optimise::run(args, &cli.global),
        Command::Grid(args) => grid::run(args, &cli.global),
        Command::Sample(args) => sample::run(args, &cli.global),
        Command::Analyse(args) => analyse::run(args, &cli.global),
        Command::Compare(args) => compare::run(args, &cli.global),
        Command::Merge(args) => merge::run(args, &cli.global),
        Command::Batch(args) => batch::run(args, &cli.global),
        Command::Survey(args) => survey::run(args),
        Command::Export(args) => export::run(args, &cli.global),
        Command::Schema(args) => schema::run(args),
        Command::Completions(args) => completions::run(args),
        Command::Man(args) => man::run(args),
        Command::Plot(args) => plot::run(args, &cli.global),
        Command::Report(args) => report::run(args, &cli.global),
    }
}

#[test]
fn what_is_wrong_with_arguments_is_one_line() {
    for (text, line) in [
        (
            "error: unexpected argument '--forc' found\n\n  tip: a similar argument exists: '--force'\n\nUsage: dimcmc \
             map --out <DIR> <CONFIG>\n\nFor more information, try '--help'.\n",
            "unexpected argument '--forc' found; tip: a similar argument exists: '--force'; see dimcmc map --help",
        ),
        (
            "error: the following required arguments were not provided:\n  --out <DIR>\n  <CONFIG>\n\nUsage: dimcmc \
             map --out <DIR> <CONFIG>\n\nFor more information, try '--help'.\n",
            "the following required arguments were not provided: --out <DIR>, <CONFIG>; see dimcmc map --help",
        ),
        (
            "error: invalid value '0' for '--draws <N>': 0 is not in 1..\n\nFor more information, try '--help'.\n",
            "invalid value '0' for '--draws <N>': 0 is not in 1..; see dimcmc --help",
        ),
    ] {
        assert_eq!(in_one_line(text), line);
    }
}

/// Clap's own consistency checks.
#[test]
fn the_command_line_is_consistent() {
    command().debug_assert();
}
