//! `dimcmc plot`: figures of the results in a folder.

use super::output::Output;
use super::report_lines::Report;
use super::signals::{RESULT, Signals};
use super::{Failure, Global};
use crate::figures::plot::{self, DPI};
use crate::runs::grid_scan::HEADER;
use std::path::PathBuf;

/// Plot the results in FOLDER as SVG and PNG
///
/// Uses saved files only: map, profiles, residuals and RVs of `map`; periodogram and RVs of `periodogram`; corner plot,
/// traces and autocorrelation of a run; slices of a likelihood grid, optionally with the contours of a run; confidence
/// ellipses of `optimise`; estimates of `compare`; the injected map of `simulate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  dimcmc plot runs/demo\n  dimcmc plot runs/demo_grid --with runs/demo --out figures"
)]
pub struct Args {
    /// Folder that another command wrote
    folder: PathBuf,
    /// Folder for the figures, `figures` in FOLDER if not given; must be empty
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into a non-empty folder; files of the same names are replaced
    #[arg(long)]
    force: bool,
    /// Overlay the contours of the run in this folder on a likelihood grid
    #[arg(long = "with", value_name = "RUN")]
    run: Option<PathBuf>,
    /// Resolution of the PNG files (pixels per inch); figures are 88 to 180 mm wide
    #[arg(long, value_name = "N", default_value_t = DPI, value_parser = dpi)]
    dpi: f64,
}

fn dpi(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(dpi) if (30.0..=1200.0).contains(&dpi) => Ok(dpi),
        _ => Err("a number from 30 to 1200".into()),
    }
}

/// Runs the command.
pub fn run(args: &Args, _global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    let folder = args.out.clone().unwrap_or_else(|| args.folder.join("figures"));
    let output = Output::to(folder, args.force);
    output.check()?;
    if let Some(run) =
        args.run.as_ref().filter(|_| args.folder.is_dir() && !plot::kinds(&args.folder).contains(&HEADER))
    {
        let (run, folder) = (run.display(), args.folder.display());
        return Err(Failure::input(format!(
            "--with {run}: {folder} holds no likelihood grid ({HEADER}) to overlay the run on"
        )));
    }
    let figures = plot::figures(&args.folder, args.run.as_deref())?;
    signals.defer();
    let folder = output.create()?;
    let files = plot::write(&figures, &folder, args.dpi)?;
    let mut report = Report::default();
    for note in figures.iter().flat_map(|figure| &figure.notes) {
        report = report.line("note", note);
    }
    report.written(&folder, files.join(", ")).print();
    Ok(())
}
