//! Errors of a list of observations or a profile: one line each, naming file and line.

use crate::data::io::FileError;
use crate::data::io::atomic::WriteError;
use std::path::PathBuf;

/// Why observations could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum LsdError {
    /// A file could not be read, or is wrong.
    #[error(transparent)]
    File(#[from] FileError),
    /// The list names a profile that could not be read.
    #[error("{}:{line}: cannot read profile {}: {source}", .list.display(), .profile.display())]
    Profile {
        /// The list.
        list: PathBuf,
        /// Line in the list (from 1).
        line: usize,
        /// The file it names.
        profile: PathBuf,
        /// The message of the system.
        source: std::io::Error,
    },
    /// Two profiles differ in their velocity axes.
    #[error("{}: velocity axis ({axis}) differs from that of {} ({expected}){cure}", .path.display(), .first.display())]
    Axis {
        /// The profile that differs.
        path: PathBuf,
        /// Its axis.
        axis: String,
        /// The first profile of the list.
        first: PathBuf,
        /// The axis of that one.
        expected: String,
        /// The difference, and advice.
        cure: String,
    },
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}
