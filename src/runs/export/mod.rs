//! A chain for other programs: one format a file, all from the same [`Contents`]; and the velocities of a search for
//! RV packages ([`velocities`]).
//!
//! | format | for | warm-up | ensembles and walkers |
//! |---|---|---|---|
//! | [`zarr`] | xarray, ArviZ | in groups of its own | an ensemble is a chain of all walkers in turn (`draws`) |
//! | [`emcee`] | emcee, ArviZ | there, `discard` says how much | all walkers side by side |
//! | [`getdist`] | GetDist | left out | an ensemble is a file |
//! | [`csv`] | pandas and everything else | there, marked | as in the chain, a row a line |
//!
//! Ensembles are independent of each other, walkers of one ensemble are not: R-hat compares ensembles. A periodic
//! parameter is unwrapped around its mode, as in `summary.json`, for means and R-hat take no heed of periods; only csv
//! has it as it stands in the chain. What follows from the parameters (`chain::derived`: period, times, minimum mass)
//! goes along, draw by draw, with the values that `summary.json` is of.

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

/// A format that a chain can be exported in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A Zarr store with ArviZ's groups.
    Zarr,
    /// An HDF5 file as emcee's backend writes it.
    Emcee,
    /// Text files of GetDist.
    Getdist,
    /// Comma-separated text.
    Csv,
}

impl Format {
    /// Where an export goes if nothing else is said: into the run's folder, beside the chain.
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
    /// Its chain is too short for anything to be said.
    #[error("{}: {source}", path.display())]
    Chain {
        /// The chain.
        path: PathBuf,
        /// What is wrong with it.
        source: ChainError,
    },
    /// Its chain is only the start, which the format has no place for.
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
        /// What is wrong with it.
        problem: String,
    },
    /// The export cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Writes a run's chain to `out` in a format: a folder (zarr), a file (emcee, csv), or files whose names begin so
/// (getdist). What an earlier export left there is replaced if `replace`, and nothing is written otherwise. Returns
/// what was written.
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

/// Whether the chain can be exported so, and the export may go to `out`.
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

/// Files or folders that an export consists of.
fn targets(format: Format, ensembles: usize, out: &Path) -> Vec<PathBuf> {
    match format {
        Format::Getdist => getdist::files(out, ensembles),
        Format::Zarr | Format::Emcee | Format::Csv => vec![out.to_owned()],
    }
}
