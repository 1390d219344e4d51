//! `dimcmc report`: one page of whatever a folder holds.

use super::report_lines::Report;
use super::{Failure, Global};
use crate::data::io::atomic;
use crate::figures::report;
use std::path::PathBuf;

/// Write one HTML page of the results in FOLDER
///
/// Verdict, tables, notes, figures, config and citation in a single self-contained file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc report runs/demo\n  dimcmc report runs/demo --out demo.html")]
pub struct Args {
    /// Folder that another command wrote
    folder: PathBuf,
    /// The file; `report.html` in FOLDER if not given
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

/// Runs the command.
pub fn run(args: &Args, _global: &Global) -> Result<(), Failure> {
    let file = args.out.clone().unwrap_or_else(|| args.folder.join("report.html"));
    if file.is_dir() {
        return Err(Failure::input(format!("--out {}: is a folder, give the name of a file", file.display())));
    }
    if file.exists() && !args.force {
        return Err(Failure::input(format!(
            "--out {}: is there already; give another name, or --force",
            file.display()
        )));
    }
    // nothing that a page is made of
    if file.exists() && !report::is_page(&file) {
        return Err(Failure::input(format!(
            "--out {}: is there already, and no report: it is not replaced",
            file.display()
        )));
    }
    let page = report::report(&args.folder)?;
    atomic::write(&file, page.as_bytes())?;
    Report::default().line("written", file.display()).print();
    Ok(())
}
