//! Atomic writes: files, sets of files and folders that are either complete or absent, written under hidden names, then
//! renamed. Leftovers of a crash under such a name are removed by the next command that writes there.
//!
//! Hidden names contain the id of the writing program. Ids are reused, and those of another machine are meaningless, so
//! a lock held by the writer shows whether it still runs.

use serde::Serialize;
use std::ffi::OsStr;
use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Write as _};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write: {source}", .path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The message of the system.
    pub source: std::io::Error,
}

/// File of a stage that is locked as long as its writer runs.
const LOCK: &str = "lock";

/// Where the files of a stage are.
const FILES: &str = "files";

/// Where a stage keeps what it replaces.
const OLD: &str = "old";

/// Endings of hidden names: a set being written, and a complete set being moved to its place.
const WRITING: &str = "tmp";
const WHOLE: &str = "whole";

/// On a file system without locks, files unmodified for this long count as abandoned.
const ABANDONED: Duration = Duration::from_secs(3600);

/// Longest wait for a folder, and time between two attempts.
const LONGEST: Duration = Duration::from_secs(10);
const PAUSE: Duration = Duration::from_millis(5);

/// Writes `bytes` to `path`, in place of whatever is there.
///
/// # Errors
/// A folder that is not there or cannot be written to, a full disc.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    if !is_staged(path) {
        clear(folder_of(path), |of| Some(of) == path.file_name());
    }
    let temporary = beside(path, path.file_name().unwrap_or_default(), WRITING);
    let written = File::create(&temporary).and_then(|mut file| {
        // without locks on this file system its age has to say whether it is abandoned
        let _ = file.try_lock();
        file.write_all(bytes).and_then(|()| file.sync_all()).and_then(|()| std::fs::rename(&temporary, path))
    });
    written.map_err(|source| {
        // Report the error of the file itself, not that of removing its partial copy.
        let _ = std::fs::remove_file(&temporary);
        WriteError { path: path.into(), source }
    })
}

/// Writes a set of files into `folder`, which must exist: `fill` makes them in the folder that it is given, and files
/// of the same names are replaced. Where `fill` fails nothing has changed; a set whose move a crash has interrupted is
/// completed by [`clear_abandoned`].
///
/// # Errors
/// Those of `fill`, and as [`write()`].
pub fn write_set(folder: &Path, fill: &dyn Fn(&Path) -> Result<(), WriteError>) -> Result<(), WriteError> {
    let stage = Stage::new(folder)?;
    fill(&stage.files()).map_err(|WriteError { path, source }| {
        let in_place = path.strip_prefix(stage.files()).map(|below| folder.join(below));
        WriteError { path: in_place.unwrap_or(path), source }
    })?;
    let whole = beside(&folder.join("set"), OsStr::new(STAGE), WHOLE);
    let placed = std::fs::rename(&stage.path, &whole).and_then(|()| place(&whole.join(FILES), folder));
    let _ = std::fs::remove_dir_all(&whole);
    placed.map_err(|source| WriteError { path: folder.into(), source })
}

/// Writes a folder: `fill` makes it, under the name it is given. A folder that is at `path` already is replaced,
/// whatever is in it; between two renames it is missing.
///
/// # Errors
/// Those of `fill`, and as [`write()`].
pub fn write_folder(path: &Path, fill: &dyn Fn(&Path) -> std::io::Result<()>) -> Result<(), WriteError> {
    let stage = Stage::new(folder_of(path))?;
    let (new, old) = (stage.files().join("new"), stage.path.join(OLD));
    let replace = || match path.symlink_metadata() {
        Ok(_) => {
            std::fs::rename(path, &old)?;
            std::fs::rename(&new, path).inspect_err(|_| drop(std::fs::rename(&old, path)))
        }
        Err(_) => std::fs::rename(&new, path),
    };
    fill(&new).and_then(|()| replace()).map_err(|source| WriteError { path: path.into(), source })
}

/// A claim on a folder: no other command that writes its results atomically moves them there while it is held.
#[derive(Debug)]
pub struct Claimed {
    folder: PathBuf,
    _lock: Option<File>,
}

impl Deref for Claimed {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.folder
    }
}

impl Claimed {
    /// Waits until no other command moves results into `folder`, and checks again whether they may go there, since
    /// another process may have written there meanwhile. The claim is empty where folders cannot be locked, and where
    /// one is locked for longer than moving files takes.
    ///
    /// # Errors
    /// Those of `check`.
    pub fn folder<E>(folder: &Path, check: impl FnOnce() -> Result<(), E>) -> Result<Self, E> {
        let claimed = Claimed { folder: folder.to_owned(), _lock: lock(folder) };
        check()?;
        Ok(claimed)
    }
}

fn lock(folder: &Path) -> Option<File> {
    let (folder, began) = (File::open(folder).ok()?, Instant::now());
    loop {
        match folder.try_lock() {
            Ok(()) => return Some(folder),
            Err(TryLockError::WouldBlock) if began.elapsed() < LONGEST => {}
            Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return None,
        }
        std::thread::sleep(PAUSE);
    }
}

/// Removes from `folder` partial files of writers that no longer run, and moves complete sets to their place.
pub fn clear_abandoned(folder: &Path) {
    clear(folder, |_| true);
}

/// Writes `value` as indented JSON; non-finite numbers become null.
///
/// # Errors
/// As [`write()`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    let mut json = serde_json::to_vec_pretty(value)
        .map_err(|e| WriteError { path: path.into(), source: std::io::Error::other(e) })?;
    json.push(b'\n');
    write(path, &json)
}

/// Whether this is a hidden name of a partial file.
pub fn is_temporary(name: &OsStr) -> bool {
    hidden(name).is_some()
}

/// Encoding of a name in the hidden names of stages.
const STAGE: &str = "dimcmc";

/// A hidden folder in which files are made; it is removed with its content.
struct Stage {
    path: PathBuf,
    _lock: File,
}

impl Stage {
    fn new(folder: &Path) -> Result<Self, WriteError> {
        clear(folder, |of| of == STAGE);
        let path = beside(&folder.join("set"), OsStr::new(STAGE), WRITING);
        let failed = |source| WriteError { path: folder.into(), source };
        std::fs::create_dir(&path).map_err(failed)?;
        let locked = File::create(path.join(LOCK)).and_then(|file| {
            let _ = file.try_lock();
            std::fs::create_dir(path.join(FILES)).map(|()| file)
        });
        let lock = locked.inspect_err(|_| drop(std::fs::remove_dir_all(&path))).map_err(failed)?;
        Ok(Stage { path, _lock: lock })
    }

    fn files(&self) -> PathBuf {
        self.path.join(FILES)
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.path);
    }
}

/// Whether a file belongs to a stage itself, with no other files left.
fn is_staged(path: &Path) -> bool {
    let in_stage = |name: &OsStr| hidden(name).is_some_and(|(of, _)| of == STAGE);
    path.ancestors().skip(1).filter_map(Path::file_name).any(in_stage)
}

/// Moves everything in `from` to the same names in `to`, folders by their content.
fn place(from: &Path, to: &Path) -> std::io::Result<()> {
    for entry in std::fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        match entry.file_type()?.is_dir() {
            true => {
                std::fs::create_dir_all(&target)?;
                place(&entry.path(), &target)?;
            }
            false => std::fs::rename(entry.path(), target)?,
        }
    }
    Ok(())
}

/// Removes from `folder` abandoned files whose hidden names are `of` such a name.
fn clear(folder: &Path, of: impl Fn(&OsStr) -> bool) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let Some((name, ending)) = hidden(&name).filter(|(name, _)| of(OsStr::new(name))) else { continue };
        let is_folder = path.is_dir();
        let lock = if is_folder && name == STAGE { path.join(LOCK) } else { path.clone() };
        if !is_abandoned(&lock) {
            continue;
        }
        if ending == WHOLE && place(&path.join(FILES), folder).is_err() {
            continue;
        }
        // a failure to remove is harmless
        let _ = if is_folder { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
    }
}

/// Whether a file is unlocked.
fn is_abandoned(file: &Path) -> bool {
    let old = || {
        let age = file.metadata().and_then(|it| it.modified()).ok().and_then(|at| at.elapsed().ok());
        age.is_some_and(|age| age > ABANDONED)
    };
    match File::open(file) {
        Ok(open) => match open.try_lock() {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => false,
            Err(TryLockError::Error(_)) => old(),
        },
        // a stage whose writer has not yet locked it
        Err(error) => error.kind() == ErrorKind::NotFound,
    }
}

/// The hidden name of `of` beside `path`, which no other process uses.
fn beside(path: &Path, of: &OsStr, ending: &str) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(of);
    name.push(format!(".{}.{ending}", std::process::id()));
    path.with_file_name(name)
}

/// Name and ending from which a hidden name was made.
fn hidden(name: &OsStr) -> Option<(&str, &str)> {
    let (rest, ending) = name.to_str()?.strip_prefix('.')?.rsplit_once('.')?;
    let (name, process) = rest.rsplit_once('.')?;
    let is_number = !process.is_empty() && process.bytes().all(|b| b.is_ascii_digit());
    (is_number && [WRITING, WHOLE].contains(&ending)).then_some((name, ending))
}

/// The folder that a file is in.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

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

    #[test]
    fn a_set_is_there_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("a"), "old").unwrap();
        let failing = write_set(dir.path(), &|stage| {
            write(&stage.join("a"), b"new")?;
            write(&stage.join("absent/b"), b"new")
        });
        assert_eq!(failing.unwrap_err().path, dir.path().join("absent/b"));
        assert_eq!(
            (names(dir.path()), std::fs::read_to_string(dir.path().join("a")).unwrap()),
            (vec!["a".to_owned()], "old".to_owned())
        );
        write_set(dir.path(), &|stage| {
            std::fs::create_dir(stage.join("below")).unwrap();
            write(&stage.join("a"), b"new")?;
            write(&stage.join("below/b"), b"new")
        })
        .unwrap();
        assert_eq!(names(dir.path()), ["a", "below"]);
        assert_eq!(std::fs::read_to_string(dir.path().join("below/b")).unwrap(), "new");
    }

    #[test]
    fn what_a_crash_left_is_removed_and_a_whole_set_placed() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at(".a.json.123.tmp"), "half").unwrap();
        std::fs::create_dir_all(at(".dimcmc.5.tmp/files")).unwrap();
        std::fs::create_dir_all(at(".dimcmc.7.whole/files")).unwrap();
        std::fs::write(at(".dimcmc.7.whole/files/b.json"), "whole").unwrap();
        // a foreign file, and one whose writer runs
        std::fs::write(at(".mine.tmp"), "precious").unwrap();
        std::fs::write(at(".c.json.9.tmp"), "being written").unwrap();
        let living = File::open(at(".c.json.9.tmp")).unwrap();
        living.try_lock().unwrap();
        clear_abandoned(dir.path());
        assert_eq!(names(dir.path()), [".c.json.9.tmp", ".mine.tmp", "b.json"]);
        drop(living);
        // the next writer of that file removes it, and no other file
        std::fs::write(at(".d.json.9.tmp"), "another").unwrap();
        write(&at("c.json"), b"{}").unwrap();
        assert_eq!(names(dir.path()), [".d.json.9.tmp", ".mine.tmp", "b.json", "c.json"]);
    }

    #[test]
    fn a_folder_is_replaced_as_a_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store");
        for text in ["one", "two"] {
            let fill =
                |folder: &Path| std::fs::create_dir_all(folder).and_then(|()| std::fs::write(folder.join(text), text));
            write_folder(&path, &fill).unwrap();
            assert_eq!(names(&path), [text]);
        }
        write_folder(&path, &|_| Err(std::io::Error::other("full"))).unwrap_err();
        assert_eq!((names(dir.path()), names(&path)), (vec!["store".to_owned()], vec!["two".to_owned()]));
    }
}
