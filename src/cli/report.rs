//! `dimcmc report`: one page of a star.

use super::report_lines::Report;
use super::signals::{RESULT, Signals};
use super::{Failure, Global};
use crate::data::io::atomic::{self, Claimed};
use crate::figures::report;
use std::path::{Path, PathBuf};

/// Write one HTML page of a star from the results in FOLDERs
///
/// The verdict, velocities, dynamic spectra, maps, periodogram, posterior and detection limits, as far as the folders
/// hold them; assumptions, and how to cite. The page is a single file that needs nothing else and can be sent to
/// others. Its heading is `star.name` of the config. All folders must be of one star: of the same observations, or with
/// the same `star.name`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc report runs/demo\n  \
                  dimcmc report demo_map runs/demo_periodogram runs/demo --out p.html")]
pub struct Args {
    /// Folders that other commands wrote
    #[arg(required = true, value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    /// The file; if not given `report.html` in FOLDER, or beside the first of several
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

/// Runs the command.
pub fn run(args: &Args, _global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    let usual = || match &args.folders[..] {
        [one] => one.join("report.html"),
        several => several[0].parent().unwrap_or(Path::new("")).join("report.html"),
    };
    let file = args.out.clone().unwrap_or_else(usual);
    check(&file, args.force)?;
    let page = report::report(&args.folders)?;
    signals.defer();
    let _claimed = Claimed::folder(atomic::folder_of(&file), || check(&file, args.force))?;
    atomic::write(&file, page.as_bytes())?;
    Report::default().line("written", file.display()).print();
    Ok(())
}

/// Whether the page may be written.
fn check(file: &Path, force: bool) -> Result<(), Failure> {
    if file.is_dir() {
        return Err(Failure::input(format!("--out {}: is a folder, give the name of a file", file.display())));
    }
    if file.exists() && !force {
        return Err(Failure::input(format!(
            "--out {}: is there already; give another name, or --force",
            file.display()
        )));
    }
    // an existing file that is not such a page
    if file.exists() && !report::is_page(file) {
        return Err(Failure::input(format!(
            "--out {}: is there already, and no report: it is not replaced",
            file.display()
        )));
    }
    Ok(())
}
