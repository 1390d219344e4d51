//! Files of JSON lines that grow by complete blocks during a long computation, and can be resumed after any
//! interruption.
//!
//! The effects of a crash are repaired: a torn last line and an incomplete last block are dropped. Any other fault is
//! refused with file and line number; a bad line that any complete line follows is corruption, not a torn tail. While a
//! process writes such a file it holds a lock on it.

use super::atomic::{self, WriteError};
use serde::Serialize;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Errors of a journal.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Another process is writing the file.
    #[error("{}: another process is writing this run", path.display())]
    Locked {
        /// The file.
        path: PathBuf,
    },
    /// A line is wrong, and not because writing it was interrupted.
    #[error("{}, line {line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// The block to write is not the next one.
    #[error("{}: {problem}", path.display())]
    Next {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A parameter has the name of another key of a line, or of another parameter.
    #[error("`{name}` cannot be the name of a parameter in a chain: it is taken")]
    Name {
        /// The name.
        name: String,
    },
}

/// Why a line is refused by its parser.
#[derive(Debug)]
pub(super) struct Refusal {
    problem: String,
    /// Whether it may be a line torn by an interruption.
    torn: bool,
}

impl From<JournalError> for WriteError {
    fn from(error: JournalError) -> Self {
        match error {
            JournalError::Io { path, source } => WriteError { path, source },
            error => WriteError { path: PathBuf::new(), source: std::io::Error::other(error) },
        }
    }
}

impl From<serde_json::Error> for Refusal {
    fn from(error: serde_json::Error) -> Self {
        let text = error.to_string();
        // "line 1", which JSON's own message ends with, would be misleading
        let message = text.rfind(" at line ").map_or(text.as_str(), |end| &text[..end]);
        Refusal { problem: format!("{message} (column {})", error.column()), torn: !error.is_data() }
    }
}

impl From<String> for Refusal {
    fn from(problem: String) -> Self {
        Refusal { problem, torn: false }
    }
}

/// Whether `folder` contains only `lines`, still empty, and perhaps the `head` with the settings: the computation was
/// stopped, or could not write, before its first result. Nothing is lost by a new start.
pub fn is_false_start(folder: &Path, head: Option<&str>, lines: &str) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    let mut found = false;
    for entry in entries {
        let Ok(entry) = entry else { return false };
        let name = entry.file_name();
        let is_empty = entry.metadata().is_ok_and(|file| file.is_file() && file.len() == 0);
        match name == lines && is_empty {
            true => found = true,
            false if atomic::is_temporary(&name) || head.is_some_and(|head| name == head) => {}
            false => return false,
        }
    }
    found
}

/// Takes the lines one by one, without their ends; returns whether this one completes a block.
pub(super) type TakeLine<'a> = &'a mut dyn FnMut(&[u8]) -> Result<bool, Refusal>;

/// An exclusive claim on a file of lines, made before a long search for its start. Unless the file is begun, it and the
/// folders created for it are removed.
#[derive(Debug)]
pub struct Claim {
    file: File,
    path: PathBuf,
    /// Files and folders created for it, the innermost first.
    made: Made,
}

/// Files and folders that are removed if unused.
#[derive(Clone, Debug, Default)]
struct Made {
    file: Option<PathBuf>,
    folders: Vec<PathBuf>,
}

impl Made {
    /// A folder that is not empty stays.
    fn remove(&self) {
        let is_empty = |path: &&PathBuf| path.metadata().is_ok_and(|file| file.len() == 0);
        let _ = self.file.as_ref().filter(is_empty).map(std::fs::remove_file);
        self.folders.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
}

impl Claim {
    /// Claims `path`, and makes its folder; a file that is there already is kept until [`Claim::begin`] if `replace`,
    /// and refused otherwise.
    ///
    /// # Errors
    /// [`JournalError::Locked`] where another process has it; [`JournalError::Io`].
    pub fn of(path: &Path, replace: bool) -> Result<Self, JournalError> {
        let folder = atomic::folder_of(path);
        let absent = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let folders: Vec<PathBuf> = folder.ancestors().take_while(absent).map(Path::to_owned).collect();
        std::fs::create_dir_all(folder).map_err(at(folder))?;
        let mut made = Made { file: None, folders };
        let opened = match OpenOptions::new().read(true).write(true).create_new(true).open(path) {
            Ok(file) => {
                made.file = Some(path.to_owned());
                lock(&file, path).map(|()| file)
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => match hold(path) {
                Ok(Some(file)) if replace => Ok(file),
                Err(error) => Err(error),
                _ => Err(at(path)(error)),
            },
            Err(error) => Err(at(path)(error)),
        };
        match opened {
            Ok(file) => Ok(Claim { file, path: path.to_owned(), made }),
            Err(error) => {
                made.remove();
                Err(error)
            }
        }
    }

    /// A closure that removes all traces of it, for an exit of the program before it is begun.
    pub fn undo(&self) -> impl FnOnce() + Send + use<> {
        let made = self.made.clone();
        move || made.remove()
    }

    /// The file, emptied.
    ///
    /// # Errors
    /// [`JournalError::Io`].
    pub fn begin(mut self) -> Result<LineFile, JournalError> {
        self.file.set_len(0).map_err(at(&self.path))?;
        let file = self.file.try_clone().map_err(at(&self.path))?;
        self.made = Made::default();
        Ok(LineFile { writer: BufWriter::new(file), path: self.path.clone() })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.made.remove();
    }
}

/// A file open for appending, locked against other processes until it is dropped.
#[derive(Debug)]
pub struct LineFile {
    writer: BufWriter<File>,
    path: PathBuf,
}

impl LineFile {
    /// Makes a new, empty file; one that is there already is emptied if `replace`, and refused otherwise.
    ///
    /// # Errors
    /// [`JournalError::Io`] (the file is there already, for one), [`JournalError::Locked`].
    pub fn create(path: &Path, replace: bool) -> Result<Self, JournalError> {
        Claim::of(path, replace)?.begin()
    }

    /// Opens a file to resume it: hands its lines to `take`, and cuts it after the last whole block. It is only cut
    /// when it can be read without error.
    pub(super) fn recover(path: &Path, take: TakeLine) -> Result<Self, JournalError> {
        let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(at(path))?;
        lock(&file, path)?;
        let end = scan(&mut BufReader::new(&file), path, take)?;
        file.set_len(end).map_err(at(path))?;
        file.seek(SeekFrom::Start(end)).map_err(at(path))?;
        Ok(LineFile { writer: BufWriter::new(file), path: path.to_owned() })
    }

    /// Appends lines and hands them to the operating system.
    ///
    /// # Errors
    /// [`JournalError::Io`].
    pub fn append(&mut self, lines: impl IntoIterator<Item = impl Serialize>) -> Result<(), JournalError> {
        for line in lines {
            serde_json::to_writer(&mut self.writer, &line).map_err(|e| at(&self.path)(e.into()))?;
            self.writer.write_all(b"\n").map_err(at(&self.path))?;
        }
        self.writer.flush().map_err(at(&self.path))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Hands the lines of a file to `take` without changing it; it may be written at the same time. Returns whether it ends
/// with a complete block.
pub(super) fn read(path: &Path, take: TakeLine) -> Result<bool, JournalError> {
    let file = File::open(path).map_err(at(path))?;
    let whole = scan(&mut BufReader::new(&file), path, take)?;
    Ok(file.metadata().is_ok_and(|file| file.len() == whole))
}

/// Makes a file, if there is none, and locks it as [`hold`] does.
///
/// # Errors
/// As [`hold`].
pub fn hold_for(path: &Path) -> Result<File, JournalError> {
    let file = OpenOptions::new().write(true).create(true).truncate(false).open(path).map_err(at(path))?;
    lock(&file, path).map(|()| file)
}

/// Locks a file against others that would write it, until it is dropped; `None` where there is no such file.
///
/// # Errors
/// [`JournalError::Locked`]: another process writes it; [`JournalError::Io`].
pub fn hold(path: &Path) -> Result<Option<File>, JournalError> {
    match OpenOptions::new().read(true).write(true).open(path) {
        Ok(file) => lock(&file, path).map(|()| Some(file)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(at(path)(error)),
    }
}

/// The byte after the last whole block.
fn scan(reader: &mut dyn BufRead, path: &Path, take: TakeLine) -> Result<u64, JournalError> {
    let (mut end, mut complete, mut line) = (0u64, 0u64, 0usize);
    let mut bytes = Vec::new();
    loop {
        bytes.clear();
        end += reader.read_until(b'\n', &mut bytes).map_err(at(path))? as u64;
        line += 1;
        // No newline: the end of the file, or of its torn last line.
        let Some(text) = bytes.strip_suffix(b"\n") else { return Ok(complete) };
        match take(text) {
            Ok(true) => complete = end,
            Ok(false) => {}
            Err(Refusal { problem, torn }) => {
                let mut rest = Vec::new();
                reader.read_until(b'\n', &mut rest).map_err(at(path))?;
                if torn && !rest.ends_with(b"\n") {
                    return Ok(complete);
                }
                return Err(JournalError::Line { path: path.to_owned(), line, problem });
            }
        }
    }
}

fn at(path: &Path) -> impl Fn(std::io::Error) -> JournalError {
    move |source| JournalError::Io { path: path.to_owned(), source }
}

fn lock(file: &File, path: &Path) -> Result<(), JournalError> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(JournalError::Locked { path: path.to_owned() }),
        // A file system without locks: no other process can hold one either.
        Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => Ok(()),
        Err(TryLockError::Error(error)) => Err(at(path)(error)),
    }
}
