//! Files and folders that are either there whole or not at all: written beside their place, then renamed.

use serde::Serialize;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write: {source}", .path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// What the system says.
    pub source: std::io::Error,
}

/// Writes `bytes` to `path`, in place of whatever is there.
///
/// # Errors
/// A folder that is not there or cannot be written to, a full disc.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let temporary = beside(path, "tmp");
    let written = File::create(&temporary)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&temporary, path));
    written.map_err(|source| {
        // What is wrong with the file itself is what matters; that its torn half may stay does not.
        let _ = std::fs::remove_file(&temporary);
        WriteError { path: path.into(), source }
    })
}

/// Writes a folder: `fill` makes it, under the name it is given. A folder that is at `path` already is replaced,
/// whatever is in it; between two renames it is missing.
///
/// # Errors
/// Those of `fill`, and as [`write()`].
pub fn write_folder(path: &Path, fill: &dyn Fn(&Path) -> std::io::Result<()>) -> Result<(), WriteError> {
    let (temporary, old) = (beside(path, "tmp"), beside(path, "old"));
    let replace = || match path.symlink_metadata() {
        Ok(_) => {
            std::fs::rename(path, &old)?;
            std::fs::rename(&temporary, path).inspect_err(|_| drop(std::fs::rename(&old, path)))?;
            std::fs::remove_dir_all(&old)
        }
        Err(_) => std::fs::rename(&temporary, path),
    };
    fill(&temporary).and_then(|()| replace()).map_err(|source| {
        let _ = std::fs::remove_dir_all(&temporary);
        WriteError { path: path.into(), source }
    })
}

/// A hidden name beside `path` that no other process uses.
fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.{ending}", std::process::id()));
    path.with_file_name(name)
}

/// Whether this is the name of a half-written file that a crash has left.
pub fn is_temporary(name: &std::ffi::OsStr) -> bool {
    let name = name.to_string_lossy();
    name.starts_with('.') && name.ends_with(".tmp")
}

/// Writes `value` as indented JSON; what is not a finite number becomes null.
///
/// # Errors
/// As [`write()`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    let mut json = serde_json::to_vec_pretty(value)
        .map_err(|e| WriteError { path: path.into(), source: std::io::Error::other(e) })?;
    json.push(b'\n');
    write(path, &json)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_and_leaves_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.json");
        for text in ["one", "two"] {
            write(&path, text.as_bytes()).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        let error = write(&dir.path().join("absent/x.json"), b"").unwrap_err().to_string();
        assert!(error.contains("absent/x.json: cannot write"), "{error}");
    }
}
