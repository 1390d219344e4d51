//! The list of profiles: `FILE TIME_DAYS [VRAD_KMS]` a line, between blanks, tabs, commas or semicolons; a file whose
//! name holds blanks stands in quotes. A first line may name the columns.

use super::error::LsdError;
use super::row::shown;
use crate::data::io::FileError;
use crate::data::io::table::{self, Separator, number};
use std::borrow::Cow;
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
    let entries = list_bytes(list).and_then(|bytes| parse_list(list, &bytes));
    std::iter::once(list.to_owned()).chain(entries.into_iter().flatten().map(|entry| entry.path)).collect()
}

/// The content of the list at `list`.
pub(super) fn list_bytes(list: &Path) -> Result<Vec<u8>, LsdError> {
    std::fs::read(list).map_err(|source| FileError::Read { path: list.into(), source }.into())
}

/// Names of the columns that a first line may have, bare: file, time, velocity.
const NAMES: [&[&str]; 3] = [
    &["file", "files", "filename", "name", "path", "profile"],
    &["time", "timed", "timedays", "date", "jd", "bjd", "hjd", "mjd", "bjdtdb", "rjd", "rbjd"],
    &["vrad", "vradkms", "rv", "radialvelocity", "velocity"],
];

/// Where in a line the file, the time and the velocity stand.
type Places = [usize; 3];

/// The lines of a list of that content.
pub(super) fn parse_list(list: &Path, bytes: &[u8]) -> Result<Vec<Entry>, LsdError> {
    let text: Cow<str> = table::text(bytes).map_err(|what| {
        LsdError::from(FileError::of(list, format!("is {what}; a list of profiles is text, FILE TIME_DAYS [VRAD_KMS]")))
    })?;
    let folder = list.parent().unwrap_or(Path::new(""));
    let (mut entries, mut places, mut is_first) = (Vec::new(), None, true);
    for (line, text) in text.lines().enumerate().map(|(k, text)| (k + 1, text)) {
        if Separator::Blanks.cells(text).is_empty() {
            continue;
        }
        if std::mem::take(&mut is_first) {
            places = named(text);
            if places.is_some() {
                continue;
            }
        }
        let (file, time_d, vrad_kms) =
            read(text, places).map_err(|problem| FileError::Line { path: list.into(), line, problem })?;
        entries.push(Entry { line, file: file.to_owned(), path: folder.join(file), time_d, vrad_kms });
    }
    Ok(entries)
}

const SEPARATORS: [Separator; 4] = [Separator::Blanks, Separator::Tab, Separator::Comma, Separator::Semicolon];

/// The places of the columns, if a line names them.
fn named(line: &str) -> Option<Places> {
    const MOST: usize = 12;
    (2..=MOST).flat_map(|columns| table::readings(line, columns)).find_map(|columns| {
        let place = |names: &[&str]| columns.iter().position(|column| names.contains(&column.bare.as_str()));
        Some([place(NAMES[0])?, place(NAMES[1])?, place(NAMES[2]).unwrap_or(usize::MAX)])
    })
}

/// The file, the time and the velocity of a line, by the first separator that makes sense of it.
fn read(line: &str, places: Option<Places>) -> Result<(&str, f64, f64), String> {
    let blanks = entry(&Separator::Blanks.cells(line), places);
    let is_quoted = line.contains(['"', '\'']);
    let by_a_mark = || {
        let others = SEPARATORS.into_iter().skip(1).filter_map(|separator| {
            let (file, time_d, vrad_kms) = entry(&separator.cells(line), places).ok()?;
            // a comma within a number is no separator
            let is_file = separator == Separator::Tab || is_quoted || !file.contains(char::is_whitespace);
            is_file.then_some((file, time_d, vrad_kms))
        });
        others.into_iter().next()
    };
    blanks.or_else(|problem| by_a_mark().ok_or(problem))
}

fn entry<'a>(cells: &[&'a str], places: Option<Places>) -> Result<(&'a str, f64, f64), String> {
    let [file, time, vrad] = places.unwrap_or([0, 1, 2]).map(|place| cells.get(place).copied());
    let (Some(file), Some(time)) = (file, time) else {
        return Err(format!("{} columns where FILE TIME_DAYS [VRAD_KMS] is due", cells.len()));
    };
    let quotes = if cells.len() > 2 { "; the name of a file with blanks stands in quotes" } else { "" };
    if places.is_none() && cells.len() > 3 {
        return Err(format!("{} columns where FILE TIME_DAYS [VRAD_KMS] is due{quotes}", cells.len()));
    }
    let finite = |name: &str, cell: &str, hint: &str| match number(cell) {
        Ok(value) if value.is_finite() => Ok(value),
        Err(problem) if problem.contains("decimal") => Err(format!("{name} {problem}")),
        _ => Err(format!("{name} {} is not a finite number{hint}", shown(cell))),
    };
    let time_d = finite("time", time, quotes)?;
    Ok((file, time_d, vrad.map_or(Ok(0.0), |vrad| finite("radial velocity", vrad, ""))?))
}
