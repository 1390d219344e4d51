//! The place of an export: existing files are kept, unless they are an earlier export and the user insists.

use super::ExportError;
use crate::data::io::atomic::{Claimed, WriteError, clear_abandoned, folder_of};
use std::io::Read as _;
use std::path::{Path, PathBuf};

const TAKEN: &str = "is there already; give another --out, or --force to replace it";

const FOREIGN: &str = "is there already, and no earlier export: it is not replaced";

fn wrong(path: &Path, problem: impl Into<String>) -> Result<(), ExportError> {
    Err(ExportError::Place { path: path.to_owned(), problem: problem.into() })
}

/// Whether the path ends in a name, in a folder or where one can be made.
pub fn check_name(out: &Path) -> Result<(), ExportError> {
    if out.file_name().is_none() {
        return wrong(out, "is no name for an export");
    }
    match out.ancestors().skip(1).find(|parent| parent.exists()) {
        Some(file) if !file.is_dir() => wrong(out, format!("{} is not a folder", file.display())),
        _ => Ok(()),
    }
}

/// Whether these files can be written: none exists yet, or each existing one `is_own` and `replace`. Another file is
/// not replaced, even on request.
pub fn check_files(files: &[PathBuf], replace: bool, is_own: &dyn Fn(&Path) -> bool) -> Result<(), ExportError> {
    for file in files {
        match file.symlink_metadata() {
            Err(_) => {}
            Ok(_) if file.is_dir() => return wrong(file, "is a folder; give the name of a file"),
            Ok(_) if !is_own(file) => return wrong(file, FOREIGN),
            Ok(_) if replace => {}
            Ok(_) => return wrong(file, TAKEN),
        }
    }
    Ok(())
}

/// Whether the folder can be written: it does not exist yet, or is empty, or it `is_own` and `replace`. Another one is
/// not replaced, even on request.
pub fn check_folder(folder: &Path, replace: bool, is_own: &dyn Fn(&Path) -> bool) -> Result<(), ExportError> {
    clear_abandoned(folder);
    let is_empty = || std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    match folder.symlink_metadata() {
        Err(_) => Ok(()),
        Ok(_) if is_empty() => Ok(()),
        Ok(_) if !is_own(folder) => wrong(folder, FOREIGN),
        Ok(_) if replace => Ok(()),
        Ok(_) => wrong(folder, TAKEN),
    }
}

/// Makes and claims the folder of the export, if `check` allows it.
pub fn claim_parent(out: &Path, check: impl Fn() -> Result<(), ExportError>) -> Result<Claimed, ExportError> {
    check()?;
    let folder = folder_of(out);
    std::fs::create_dir_all(folder).map_err(|source| WriteError { path: out.to_owned(), source })?;
    Claimed::folder(folder, check)
}

/// Whether the file begins like this.
pub fn begins_with(file: &Path, beginning: &[u8]) -> bool {
    let mut found = vec![0; beginning.len()];
    let read = std::fs::File::open(file).and_then(|mut file| file.read_exact(&mut found));
    read.is_ok() && found == beginning
}
