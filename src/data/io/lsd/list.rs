//! The list of profiles: `FILE TIME_DAYS [VRAD_KMS]` a line.

use super::error::LsdError;
use super::row::shown;
use crate::data::io::FileError;
use std::path::{Path, PathBuf};

/// What a list says of a profile beside its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Its file, as the list names it.
    pub file: String,
    /// Where that is; `None` for profiles that are in no file.
    pub path: Option<PathBuf>,
    /// Velocity that is subtracted from its axis (km/s).
    pub vrad_kms: f64,
}

impl From<Entry> for Label {
    fn from(Entry { file, path, vrad_kms, .. }: Entry) -> Self {
        Label { file, path: Some(path), vrad_kms }
    }
}

/// One line of the list.
pub(super) struct Entry {
    pub line: usize,
    pub file: String,
    pub path: PathBuf,
    pub time_d: f64,
    pub vrad_kms: f64,
}

/// The list at `list` and the profiles that it names, as far as it can be read.
pub fn files(list: &Path) -> Vec<PathBuf> {
    let entries = list_bytes(list).and_then(|bytes| parse_list(list, &String::from_utf8_lossy(&bytes)));
    std::iter::once(list.to_owned()).chain(entries.into_iter().flatten().map(|entry| entry.path)).collect()
}

/// The content of the list at `list`.
pub(super) fn list_bytes(list: &Path) -> Result<Vec<u8>, LsdError> {
    std::fs::read(list).map_err(|source| FileError::Read { path: list.into(), source }.into())
}

/// The lines of a list of that content.
pub(super) fn parse_list(list: &Path, text: &str) -> Result<Vec<Entry>, LsdError> {
    let folder = list.parent().unwrap_or(Path::new(""));
    let mut entries = Vec::new();
    for (line, text) in text.lines().enumerate().map(|(k, text)| (k + 1, text)) {
        let fields: Vec<&str> = text.split_whitespace().take_while(|f| !f.starts_with('#')).collect();
        let fail = |problem| LsdError::from(FileError::Line { path: list.into(), line, problem });
        let number = |name: &str, field: &str| match field.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(fail(format!("{name} {} is not a finite number", shown(field)))),
        };
        let (file, time_d, vrad_kms) = match fields[..] {
            [] => continue,
            [file, time] => (file, number("time", time)?, 0.0),
            [file, time, vrad] => (file, number("time", time)?, number("radial velocity", vrad)?),
            _ => return Err(fail(format!("{} columns where FILE TIME_DAYS [VRAD_KMS] is due", fields.len()))),
        };
        entries.push(Entry { line, file: file.to_owned(), path: folder.join(file), time_d, vrad_kms });
    }
    Ok(entries)
}
