//! `dimcmc export`: a run's chain, or the velocities of a search, for other programs.

use super::signals::{RESULT, Signals};
use super::{Failure, Global, console};
use crate::numerics::text::shown;
use crate::runs::export::{self, Contents};
use std::path::PathBuf;

/// Export a chain, or the RVs of a search, to other programs
///
/// Without --out the export goes into the run's folder: chain.zarr, chain.h5, chain.csv, or chain_1.txt,
/// chain.paramnames, ... The burn-in is marked or removed as in `analyse`. A running chain can be exported. For a
/// folder of `periodogram`, --format rv writes the spot-corrected RVs to its subfolder rv: tables for radvel, juliet,
/// kima and pyaneti, the full covariance, a likelihood for radvel and tinygp, and the loss of precision without the
/// covariance.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc export runs/demo --format zarr\n  \
                        dimcmc export runs/demo --format getdist --out getdist/demo\n  \
                        dimcmc export runs/demo_periodogram --format rv")]
pub struct Args {
    /// Folder of the run, or of the search
    run: PathBuf,
    /// Target program
    #[arg(long, value_enum)]
    format: Format,
    /// File (emcee, csv), folder (zarr, rv) or prefix of the file names (getdist)
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// Replace an earlier export
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// xarray and ArviZ: a Zarr store, one chain per ensemble
    Zarr,
    /// HDF5 backend of emcee: all walkers side by side
    Emcee,
    /// GetDist: one text file per ensemble, names and ranges
    Getdist,
    /// pandas and others: one row per line of the chain
    Csv,
    /// RV packages: the RVs of a search with their covariance
    Rv,
}

/// Runs the command.
pub fn run(args: &Args, _global: &Global) -> Result<(), Failure> {
    let _signals = Signals::catch(RESULT)?;
    let format = match args.format {
        Format::Zarr => export::Format::Zarr,
        Format::Emcee => export::Format::Emcee,
        Format::Getdist => export::Format::Getdist,
        Format::Csv => export::Format::Csv,
        Format::Rv => return velocities(args),
    };
    let out = args.out.clone().unwrap_or_else(|| format.place(&args.run));
    let contents = Contents::read(&args.run)?;
    let written = export::write(&contents, format, &out, args.force)?;
    let names: Vec<String> = written.iter().map(|path| shown(path)).collect();
    console::line(format_args!("written: {}", names.join(", ")));
    for note in contents.notes() {
        console::line(format_args!("note: {note}"));
    }
    Ok(())
}

/// Writes the velocities of a search.
fn velocities(args: &Args) -> Result<(), Failure> {
    let out = args.out.clone().unwrap_or_else(|| args.run.join("rv"));
    let names: Vec<String> =
        export::velocities::write(&args.run, &out, args.force)?.iter().map(|path| shown(path)).collect();
    console::line(format_args!("written: {}", names.join(", ")));
    Ok(())
}
