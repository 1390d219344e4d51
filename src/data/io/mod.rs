//! Files in and out: LSD profiles, the journals of chains and likelihood grids, maps, tables, Zarr stores. No decisions
//! are taken here.

pub mod atomic;
pub mod csv;
pub mod effort;
pub mod journal;
pub mod landscape;
pub mod light_curve;
pub mod lines;
pub mod lsd;
pub mod map;
pub mod paraboloid;
pub mod provenance;
pub mod saved;
pub mod table;
pub mod truth;
pub mod zarr;
pub mod zdipy;

use std::path::{Path, PathBuf};

/// An uncertainty smaller than the usual one by more than this factor is a mistake that would dominate the fit.
const OUT_OF_PROPORTION: f64 = 1e3;

/// The error of an uncertainty so small relative to the `usual` one that it would outweigh all other `rows`, if it is.
fn outweighs(sigma: f64, usual: f64, rows: &str) -> Option<String> {
    let problem = || format!("less than a thousandth of the usual {usual:.1e}: it would outweigh all other {rows}");
    (OUT_OF_PROPORTION * sigma < usual).then(problem)
}

/// The error of a table, a list or another program's file: one line that names the file, and the line in it.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It cannot be read.
    #[error("{}: cannot read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The message of the system.
        source: std::io::Error,
    },
    /// A line is wrong.
    #[error("{}:{line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// The file as a whole is wrong.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl FileError {
    /// A file that is wrong as a whole.
    pub fn of(path: &Path, problem: impl Into<String>) -> Self {
        FileError::File { path: path.into(), problem: problem.into() }
    }
}
