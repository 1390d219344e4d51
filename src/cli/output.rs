//! Where results go: a folder of their own that is absent or empty, unless the user insists.
//!
//! It is checked before anything is computed and created once there is something to write, so that bad input leaves nothing
//! behind.

use super::Failure;
use std::path::{Path, PathBuf};

/// Options of every command that writes.
#[derive(Debug, clap::Args)]
pub struct Output {
    /// Folder for the results; created if need be, must be empty
    #[arg(long = "out", value_name = "DIR")]
    folder: PathBuf,
    /// Write into the folder even if it is not empty; files of the same names are replaced
    #[arg(long)]
    force: bool,
}

impl Output {
    /// That of a command with a folder of its own where none is given.
    pub fn to(folder: PathBuf, force: bool) -> Self {
        Output { folder, force }
    }

    /// Whether results may go there.
    pub fn check(&self) -> Result<(), Failure> {
        let folder = self.folder.display();
        let wrong = |problem: String| Err(Failure::input(format!("--out {folder}: {problem}")));
        match std::fs::read_dir(&self.folder) {
            Ok(entries) => match entries.count() {
                0 => Ok(()),
                _ if self.force => Ok(()),
                _ => wrong("the folder is not empty; give another one, or --force to replace the files in it".into()),
            },
            Err(e) => match obstacle(&self.folder) {
                Some(file) if file == self.folder => wrong("is not a folder".into()),
                Some(file) => wrong(format!("{} is not a folder", file.display())),
                None if e.kind() == std::io::ErrorKind::NotFound => Ok(()),
                None => wrong(format!("cannot be used: {e}")),
            },
        }
    }

    /// Whether what is in the folder is to be replaced.
    pub fn replaces(&self) -> bool {
        self.force
    }

    /// The folder as given.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder, created if need be.
    pub fn create(&self) -> Result<&Path, Failure> {
        self.check()?;
        let failed = |e| Failure::failed(format!("--out {}: cannot be created: {e}", self.folder.display()));
        std::fs::create_dir_all(&self.folder).map_err(failed)?;
        Ok(&self.folder)
    }
}

/// What exists of the path, if that is no folder.
fn obstacle(folder: &Path) -> Option<&Path> {
    folder.ancestors().find(|parent| parent.exists()).filter(|parent| !parent.is_dir())
}
