//! `dimcmc reproduce`: the paper's experiments.

use super::signals::Signals;
use super::{Failure, Global, cluster, console, progress};
use crate::figures::plot::{self, DPI};
use crate::numerics::text::shown;
use crate::runs::experiments::files::{Made, SUMMARY, TABLE};
use crate::runs::experiments::{ExperimentError, Laboratory, ROWS, Report, Row};
use crate::runs::run::RunError;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Repeat the experiments of Petit et al. (2015), and a few beyond them
///
/// Every row of experiments gets a folder with table.csv, summary.json and figures. A row that is there already is left
/// alone; one that was stopped goes on where it was. Without a ROW, all are done, which takes the better part of an
/// hour on two cores.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc reproduce R2 --quick --out runs/reproduced --work runs/reproduce_raw\n  \
                        dimcmc reproduce --list")]
pub struct Args {
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

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let rows = rows(&args.rows)?;
    if args.list {
        for row in rows {
            console::line(format_args!("{:<11}  {}", row.name, row.title));
            if !row.paper.is_empty() {
                console::line(format_args!("{:<11}  paper: {}", "", row.paper));
            }
        }
        return Ok(());
    }
    let or = |given: &Option<PathBuf>, full: &str, quick: &str| {
        given.clone().unwrap_or_else(|| PathBuf::from(if args.quick { quick } else { full }))
    };
    let out = or(&args.out, "results", "runs/quick");
    let work = or(&args.work, "runs/reproduce", "runs/reproduce_quick");
    let signals = Signals::catch("reconstruction")?;
    let pool = cluster::pool(global, &signals);
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
        // what is wrong with the folder is to be known before, not after
        create(&folder)?;
        if args.force {
            remove(&work.join(row.name))?;
        }
        let spinner = progress::bar(global, None, "begins");
        let report = |message: &str| spinner.set_message(message.to_owned());
        signals.defer();
        let laboratory = Laboratory { folder: work.clone(), quick: args.quick, pool: &pool, report: &report };
        let began = Instant::now();
        let result = row.run(&laboratory);
        spinner.finish_and_clear();
        let result = result.map_err(|error| match error {
            ExperimentError::Interrupted | ExperimentError::Run(RunError::Interrupted) => {
                signals.interrupted(format!("{}: {}", row.name, ExperimentError::Interrupted))
            }
            error => Failure::failed(format!("{}: {error}", row.name)),
        })?;
        let made = Made {
            command: format!("dimcmc reproduce {}{}", row.name, if args.quick { " --quick" } else { "" }),
            quick: args.quick,
            seconds: began.elapsed().as_secs_f64().round(),
            threads: rayon::current_num_threads(),
        };
        result.write(row, &made, &folder)?;
        // without its figures a row is not done
        let figures = figures(&result, &folder).inspect_err(|_| {
            let _ = std::fs::remove_file(folder.join(SUMMARY));
        })?;
        let paper = if row.paper.is_empty() { String::new() } else { format!("\n  paper: {}", row.paper) };
        console::print(format_args!("{}: {}{paper}\n{}", row.name, row.title, result.text()));
        console::line(format_args!(
            "  in {} s; written: {}: {TABLE}, {SUMMARY}{figures}",
            made.seconds,
            shown(&folder)
        ));
    }
    Ok(())
}

/// Draws the figures of a row into `folder`; their names, each after a comma.
fn figures(report: &Report, folder: &Path) -> Result<String, Failure> {
    let mut figures = if report.figure.is_empty() { Vec::new() } else { plot::figures(folder, None)? };
    for drawn in &report.drawn {
        for mut figure in plot::figures(&drawn.folder, drawn.chain.as_deref())? {
            // traces and autocorrelations are for whoever has the chain
            if figure.name == "corner" || figure.name == "landscape" {
                figure.name = format!("{}_{}", drawn.name, figure.name);
                figures.push(figure);
            }
        }
    }
    let mut names = String::new();
    for figure in &figures {
        let name = plot::write_png(figure, folder, DPI)?;
        names.push_str(&format!(", {name}"));
    }
    Ok(names)
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
    let made: Made = serde_json::from_slice(&std::fs::read(folder.join(SUMMARY)).ok()?).ok()?;
    Some(made.quick)
}

fn remove(folder: &Path) -> Result<(), Failure> {
    match std::fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Failure::failed(format!("{}: {e}", folder.display())))
        }
        _ => Ok(()),
    }
}

fn create(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| Failure::failed(format!("{}: {e}", folder.display())))
}
