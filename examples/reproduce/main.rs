//! The experiments of Petit et al. (2015), repeated, and a few beyond them.
//!
//!     cargo run --release --example reproduce -- --list
//!     cargo run --release --example reproduce -- R1
//!
//! A row of `rows.rs` is data: its stars (`cases::paper` is the paper's, changed key by key), and which of the three
//! methods for an orbit is used for each (`cases::Case`): grid and paraboloid, chain, periodogram. A
//! `cases::Laboratory` runs them and stores results. `results/README.md` compares every number with the paper's.

mod cases;
mod changing;
mod coverage;
mod figure;
mod images;
mod landscape;
mod models;
mod orbits;
mod report;
mod rows;
mod stellar;
#[cfg(test)]
mod tests;

use cases::{Interrupted, Laboratory};
use clap::Parser as _;
use dimcmc::internals::cli::{Global, cluster, console, progress, signals::Signals};
use dimcmc::internals::numerics::text::shown;
use dimcmc::{Failure, RunError};
use report::{Made, SUMMARY, TABLE};
use rows::{ROWS, Row};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Repeat the experiments of Petit et al. (2015), and a few beyond them
///
/// Every row of experiments gets a folder with table.csv, summary.json and figures. A row that is there already is left
/// alone; one that was stopped goes on where it was. Without a ROW, all are done, which takes the better part of an
/// hour on two cores.
#[derive(clap::Parser)]
#[command(name = "reproduce", version, after_help = EXAMPLE)]
struct Args {
    #[command(flatten)]
    global: Global,
    /// Rows: R1 to R12, co-rotation, coverage, models, changing
    #[arg(value_name = "ROW")]
    rows: Vec<String>,
    /// Folder of the results; `results`, or with --quick `runs/quick`, if not given
    #[arg(long = "out", value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of chains, landscapes and what is done of a row; `runs/reproduce` or `runs/reproduce_quick` if not given
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
    /// A reduced version of everything, in two minutes: fewer stars, pixels and draws
    #[arg(long)]
    quick: bool,
    /// Do rows again that are there already
    #[arg(long)]
    force: bool,
    /// List the rows and what the paper found
    #[arg(long)]
    list: bool,
}

/// The command line of the program.
const COMMAND: &str = "cargo run --release --example reproduce --";

const EXAMPLE: &str = "Example:\n  cargo run --release --example reproduce -- R2 --quick --out runs/reproduced --work \
                       runs/reproduce_raw\n  cargo run --release --example reproduce -- --list";

fn main() -> ExitCode {
    console::end(run(&Args::parse())).into()
}

fn run(args: &Args) -> Result<(), Failure> {
    if cluster::join(&args.global, cluster::alone)? == cluster::Done::Everything {
        return Ok(());
    }
    let rows = rows(&args.rows)?;
    if args.list {
        console::print(list(&rows));
        return Ok(());
    }
    let [out, work] = args.folders();
    let signals = Signals::catch("reconstruction")?;
    let pool = cluster::pool(&args.global, &signals);
    for row in rows {
        let folder = out.join(row.name);
        if folder.join(SUMMARY).exists() && !args.force {
            if quick_there(&folder) != Some(args.quick) {
                let other = if args.quick { "in full" } else { "the reduced version, by --quick" };
                let problem = format!("{}: the row was done {other}; give another --out, or --force", folder.display());
                return Err(Failure::input(problem));
            }
            console::line(format_args!("{}: done before: {}; --force does it again", row.name, shown(&folder)));
            continue;
        }
        // report errors of the folder before, not after
        std::fs::create_dir_all(&folder).map_err(|e| Failure::failed(format!("{}: {e}", folder.display())))?;
        if args.force {
            remove(&work.join(row.name))?;
        }
        let spinner = progress::bar(&args.global, None, "begins");
        let report = |message: &str| spinner.set_message(message.to_owned());
        signals.defer();
        let laboratory = Laboratory { folder: work.clone(), quick: args.quick, pool: &pool, report: &report };
        let began = Instant::now();
        let result = (row.run)(&laboratory);
        spinner.finish_and_clear();
        let failed = |error| Failure::failed(format!("{}: {error}", row.name));
        let result = result.map_err(|error| match is_interrupted(&error) {
            true => signals.interrupted(format!("{}: {Interrupted}", row.name)),
            false => failed(error),
        })?;
        let made = Made {
            command: format!("{COMMAND} {}{}", row.name, if args.quick { " --quick" } else { "" }),
            quick: args.quick,
            seconds: began.elapsed().as_secs_f64().round(),
            threads: rayon::current_num_threads(),
        };
        result.write(row, &made, &folder).map_err(Failure::failed)?;
        // a row is not finished without its figures
        let figures = figure::write(&result, row.name, &folder).map_err(|error| {
            let _ = std::fs::remove_file(folder.join(SUMMARY));
            Failure::failed(error)
        })?;
        let paper = if row.paper.is_empty() { String::new() } else { format!("\n  paper: {}", row.paper) };
        console::print(format_args!("{}: {}{paper}\n{}", row.name, row.title, result.text()));
        let written = [TABLE, SUMMARY].into_iter().chain(figures.iter().map(String::as_str));
        let written = written.collect::<Vec<_>>().join(", ");
        console::line(format_args!("  in {} s; written: {}: {written}", made.seconds, shown(&folder)));
    }
    Ok(())
}

impl Args {
    /// Folders of the results, and of chains and likelihood grids.
    fn folders(&self) -> [PathBuf; 2] {
        let or = |given: &Option<PathBuf>, full: &str, quick: &str| {
            given.clone().unwrap_or_else(|| PathBuf::from(if self.quick { quick } else { full }))
        };
        [or(&self.out, "results", "runs/quick"), or(&self.work, "runs/reproduce", "runs/reproduce_quick")]
    }
}

/// Rows with what the paper found.
fn list(rows: &[&Row]) -> String {
    let mut lines = String::new();
    for row in rows {
        lines += &format!("{:<11}  {}\n", row.name, row.title);
        if !row.paper.is_empty() {
            lines += &format!("{:<11}  paper: {}\n", "", row.paper);
        }
    }
    lines
}

/// The rows of these names, all of them if there is none.
fn rows(names: &[String]) -> Result<Vec<&'static Row>, Failure> {
    if names.is_empty() {
        return Ok(ROWS.iter().collect());
    }
    let row = |name: &String| {
        let known = || ROWS.iter().map(|row| row.name).collect::<Vec<_>>().join(", ");
        Row::from_name(name)
            .ok_or_else(|| Failure::input(format!("no experiment is called {name}: there are {}", known())))
    };
    let mut rows: Vec<&'static Row> = Vec::new();
    for name in names {
        let row = row(name)?;
        if !rows.iter().any(|other| other.name == row.name) {
            rows.push(row);
        }
    }
    Ok(rows)
}

/// Whether what is in the folder is the reduced version.
fn quick_there(folder: &Path) -> Option<bool> {
    let made: Value = serde_json::from_slice(&std::fs::read(folder.join(SUMMARY)).ok()?).ok()?;
    made["quick"].as_bool()
}

/// Whether a signal stopped it.
fn is_interrupted(error: &cases::Failure) -> bool {
    error.is::<Interrupted>() || matches!(error.downcast_ref(), Some(RunError::Interrupted))
}

fn remove(folder: &Path) -> Result<(), Failure> {
    match std::fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Failure::failed(format!("{}: {e}", folder.display())))
        }
        _ => Ok(()),
    }
}
