//! A chain for other programs: one format per file, all from the same [`Contents`]; and the velocities of a search for
//! RV packages ([`velocities`]).
//!
//! | format | for | warm-up | ensembles and walkers |
//! |---|---|---|---|
//! | [`zarr`] | xarray, ArviZ | in its own groups | an ensemble is a chain of all walkers in turn (`draws`) |
//! | [`emcee`] | emcee, ArviZ | included, its length in `discard` | all walkers side by side |
//! | [`getdist`] | GetDist | omitted | an ensemble is a file |
//! | [`csv`] | pandas and other programs | included, marked | as in the chain, one row per line |
//!
//! Ensembles are independent of each other, walkers of one ensemble are not: R-hat compares ensembles. A periodic
//! parameter is unwrapped around its mode, as in `summary.json`, because means and R-hat ignore periods; only csv has
//! it as in the chain. Derived quantities (`chain::derived`: period, times, minimum mass) are included, draw by draw,
//! with the values underlying `summary.json`.

pub mod contents;
pub mod csv;
mod draws;
pub mod emcee;
pub mod getdist;
mod place;
pub mod velocities;
pub mod zarr;

pub use contents::{Contents, DerivedQuantity, Quantity};

use crate::data::io::FileError;
use crate::data::io::atomic::WriteError;
use crate::data::io::journal::JournalError;
use crate::runs::origin::OriginError;
use crate::sampling::chain::ChainError;
use std::path::{Path, PathBuf};

/// A format for the export of a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A Zarr store with ArviZ's groups.
    Zarr,
    /// An HDF5 file in the format of emcee's backend.
    Emcee,
    /// Text files of GetDist.
    Getdist,
    /// Comma-separated text.
    Csv,
}

impl Format {
    /// The default place of an export: in the run's folder, beside the chain.
    pub fn place(self, run: &Path) -> PathBuf {
        run.join(match self {
            Format::Zarr => "chain.zarr",
            Format::Emcee => "chain.h5",
            // the root of several names
            Format::Getdist => "chain",
            Format::Csv => "chain.csv",
        })
    }
}

/// Why a run is not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// There is no run or search, or it cannot be read.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// Its chain cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// Its chain is too short for a summary.
    #[error("{}: {source}", path.display())]
    Chain {
        /// The chain.
        path: PathBuf,
        /// The error in it.
        source: ChainError,
    },
    /// Its chain is only the start, which the format does not support.
    #[error("{}: only the start of the walkers is there, and that is no step for emcee", path.display())]
    OnlyStart {
        /// The chain.
        path: PathBuf,
    },
    /// A table of the search is missing or wrong.
    #[error(transparent)]
    Table(#[from] FileError),
    /// The export cannot go there.
    #[error("{}: {problem}", path.display())]
    Place {
        /// The place.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// The export cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Writes a run's chain to `out` in a format: a folder (zarr), a file (emcee, csv), or files whose names begin like
/// this (getdist). An earlier export there is replaced if `replace`, and nothing is written otherwise. Returns what was
/// written.
///
/// # Errors
/// [`ExportError`].
pub fn write(contents: &Contents, format: Format, out: &Path, replace: bool) -> Result<Vec<PathBuf>, ExportError> {
    let _claimed = place::claim_parent(out, || check(contents, format, out, replace))?;
    match format {
        Format::Zarr => zarr::write(contents, out)?,
        Format::Emcee => emcee::write(contents, out)?,
        Format::Getdist => getdist::write(contents, out)?,
        Format::Csv => csv::write(contents, out)?,
    }
    Ok(targets(format, contents.chain.shape().ensembles, out))
}

/// Writes the chain of the run in the folder `run`, as [`write`] does.
///
/// # Errors
/// [`ExportError`].
pub fn export(run: &Path, format: Format, out: &Path, replace: bool) -> Result<Vec<PathBuf>, ExportError> {
    write(&Contents::read(run)?, format, out, replace)
}

/// Whether the chain can be exported in this format, and the export may go to `out`.
fn check(contents: &Contents, format: Format, out: &Path, replace: bool) -> Result<(), ExportError> {
    let ensembles = contents.chain.shape().ensembles;
    if format == Format::Emcee {
        emcee::check(contents)?;
    }
    place::check_name(out)?;
    match format {
        Format::Zarr => place::check_folder(out, replace, &zarr::is_own),
        Format::Getdist => {
            let is_own = |file: &Path| getdist::is_own(contents, out, file);
            place::check_files(&targets(format, ensembles, out), replace, &is_own)?;
            getdist::check_strangers(out, ensembles)
        }
        Format::Emcee => place::check_files(&targets(format, ensembles, out), replace, &emcee::is_own),
        Format::Csv => place::check_files(&targets(format, ensembles, out), replace, &csv::is_own),
    }
}

/// Files or folders of an export.
fn targets(format: Format, ensembles: usize, out: &Path) -> Vec<PathBuf> {
    match format {
        Format::Getdist => getdist::files(out, ensembles),
        Format::Zarr | Format::Emcee | Format::Csv => vec![out.to_owned()],
    }
}
