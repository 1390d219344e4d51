//! The computing time of a run or a likelihood grid: `effort.json`, beside results whose bytes do not depend on it.
//!
//! Sessions of a resumed computation add up; killed ones are missing.

use super::atomic::{WriteError, write_json};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the file.
pub const EFFORT: &str = "effort.json";

/// The content of `effort.json`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Effort {
    /// Seconds of all sessions, including the preceding search.
    pub seconds: f64,
    /// Sessions that finished or were stopped by a signal.
    pub sessions: u32,
    /// Threads of the last one.
    pub threads: usize,
}

impl Effort {
    /// The record in `folder`; `None` where none is readable.
    pub fn read(folder: &Path) -> Option<Self> {
        serde_json::from_slice(&std::fs::read(folder.join(EFFORT)).ok()?).ok()
    }

    /// Adds a session to those recorded in `folder`, or with `afresh` records it as the first.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add(folder: &Path, afresh: bool, seconds: f64, threads: usize) -> Result<(), WriteError> {
        let before = if afresh { None } else { Effort::read(folder) }.unwrap_or_default();
        let seconds = (1e3 * (before.seconds + seconds)).round() / 1e3;
        write_json(&folder.join(EFFORT), &Effort { seconds, sessions: before.sessions + 1, threads })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_add_up_until_a_fresh_start() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Effort::read(folder.path()), None);
        for (afresh, seconds, sessions) in [(true, 1.5, 1), (false, 4.0, 2), (true, 2.0, 1)] {
            Effort::add(folder.path(), afresh, if afresh { seconds } else { 2.5 }, 3).unwrap();
            assert_eq!(Effort::read(folder.path()), Some(Effort { seconds, sessions, threads: 3 }));
        }
    }
}
