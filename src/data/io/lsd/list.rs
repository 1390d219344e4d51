//! The list of profiles: one line `FILE TIME_DAYS [VRAD_KMS]` per profile, separated by blanks, tabs, commas or
//! semicolons; file names with blanks are quoted. A first line may name the columns, including exposure times; so may a
//! comment.

use super::error::LsdError;
use super::row::shown;
use crate::data::io::FileError;
use crate::data::io::table::{self, Separator, number};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The entry of a profile in a list, without its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Its file, as the list names it.
    pub file: String,
    /// Its path; `None` for profiles from memory.
    pub path: Option<PathBuf>,
    /// Velocity that is subtracted from its axis (km/s).
    pub vrad_kms: f64,
    /// The line of the list, from 1; 0 where there is no list.
    pub line: usize,
}

impl From<Entry> for Label {
    fn from(Entry { line, file, path, vrad_kms, .. }: Entry) -> Self {
        Label { file, path: Some(path), vrad_kms, line }
    }
}

/// One line of the list.
pub(super) struct Entry {
    pub line: usize,
    pub file: String,
    pub path: PathBuf,
    pub time_d: f64,
    pub vrad_kms: f64,
    pub exposure_s: Option<f64>,
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

/// Names of the columns that a first line may have, bare: file, time, velocity, exposure time (s).
const NAMES: [&[&str]; 4] = [
    &["file", "files", "filename", "name", "path", "profile"],
    &["time", "timed", "timedays", "date", "jd", "bjd", "hjd", "mjd", "bjdtdb", "rjd", "rbjd"],
    &["vrad", "vradkms", "rv", "radialvelocity", "velocity"],
    &["exposures", "exposure", "exposuretime", "exposuretimes", "exptime", "exptimes", "texp", "texps"],
];

/// Positions of file, time, velocity and exposure time in a line.
type Places = [usize; 4];

/// Positions in a line without names of columns: four are too many.
const UNNAMED: Places = [0, 1, 2, usize::MAX];

/// The lines of a list of that content.
pub(super) fn parse_list(list: &Path, bytes: &[u8]) -> Result<Vec<Entry>, LsdError> {
    let text: Cow<str> = table::text(bytes).map_err(|what| {
        LsdError::from(FileError::of(list, format!("is {what}; a list of profiles is text, FILE TIME_DAYS [VRAD_KMS]")))
    })?;
    let folder = list.parent().unwrap_or(Path::new(""));
    let (mut entries, mut places, mut is_first) = (Vec::new(), None, true);
    for (line, text) in text.lines().enumerate().map(|(k, text)| (k + 1, text)) {
        if Separator::Blanks.cells(text).is_empty() {
            if let Some(comment) = text.trim_start().strip_prefix('#').filter(|_| is_first) {
                places = named(comment, true).or(places);
            }
            continue;
        }
        if std::mem::take(&mut is_first)
            && let Some(names) = named(text, false)
        {
            places = Some(names);
            continue;
        }
        let fault = |problem| FileError::Line { path: list.into(), line, problem };
        let Row { file, time_d, vrad_kms, exposure_s } = read(text, places).map_err(fault)?;
        entries.push(Entry { line, file: file.to_owned(), path: folder.join(file), time_d, vrad_kms, exposure_s });
    }
    Ok(entries)
}

const SEPARATORS: [Separator; 4] = [Separator::Blanks, Separator::Tab, Separator::Comma, Separator::Semicolon];

/// The positions of the columns, if a line names them. A comment counts only if it consists of names, including that of
/// exposure times.
fn named(line: &str, is_comment: bool) -> Option<Places> {
    const MOST: usize = 12;
    table::all_readings(line, 2..=MOST).iter().find_map(|columns| {
        let is_name = |bare: &str| NAMES.iter().any(|names| names.contains(&bare));
        let is_exposure = |bare: &str| NAMES[3].contains(&bare);
        if is_comment
            && !(columns.iter().all(|column| is_name(&column.bare))
                && columns.iter().any(|column| is_exposure(&column.bare)))
        {
            return None;
        }
        let place = |names: &[&str]| columns.iter().position(|column| names.contains(&column.bare.as_str()));
        let or_none = |names: &[&str]| place(names).unwrap_or(usize::MAX);
        Some([place(NAMES[0])?, place(NAMES[1])?, or_none(NAMES[2]), or_none(NAMES[3])])
    })
}

/// The entry in a line.
struct Row<'a> {
    file: &'a str,
    time_d: f64,
    vrad_kms: f64,
    exposure_s: Option<f64>,
}

/// The entry in a line, by the first separator that gives a valid one.
fn read(line: &str, places: Option<Places>) -> Result<Row<'_>, String> {
    let blanks = entry(&Separator::Blanks.cells(line), places);
    let is_quoted = line.contains(['"', '\'']);
    let by_a_mark = || {
        let others = SEPARATORS.into_iter().skip(1).filter_map(|separator| {
            let row = entry(&separator.cells(line), places).ok()?;
            // a comma within a number is not a separator
            let is_file = separator == Separator::Tab || is_quoted || !row.file.contains(char::is_whitespace);
            is_file.then_some(row)
        });
        others.into_iter().next()
    };
    blanks.or_else(|problem| by_a_mark().ok_or(problem))
}

fn entry<'a>(cells: &[&'a str], places: Option<Places>) -> Result<Row<'a>, String> {
    let [file, time, vrad, exposure] = places.unwrap_or(UNNAMED).map(|place| cells.get(place).copied());
    let (Some(file), Some(time)) = (file, time) else {
        return Err(format!("{} columns where FILE TIME_DAYS [VRAD_KMS] is due", cells.len()));
    };
    let quotes = if cells.len() > 2 { "; the name of a file with blanks stands in quotes" } else { "" };
    if places.is_none() && cells.len() > 3 {
        let names = "; a first line `# file time_d vrad_kms exposure_s` names more columns";
        return Err(format!("{} columns where FILE TIME_DAYS [VRAD_KMS] is due{quotes}{names}", cells.len()));
    }
    let finite = |name: &str, cell: &str, hint: &str| match number(cell) {
        Ok(value) if value.is_finite() => Ok(value),
        Err(problem) if problem.contains("decimal") => Err(format!("{name} {problem}")),
        _ => Err(format!("{name} {} is not a finite number{hint}", shown(cell))),
    };
    let time_d = finite("time", time, quotes)?;
    let vrad_kms = vrad.map_or(Ok(0.0), |vrad| finite("radial velocity", vrad, ""))?;
    let exposure_s = exposure.map(|exposure| match finite("exposure time", exposure, "")? {
        exposure_s if exposure_s < 0.0 => Err(format!("exposure time {exposure_s} s must be 0 or more")),
        exposure_s => Ok(exposure_s),
    });
    Ok(Row { file, time_d, vrad_kms, exposure_s: exposure_s.transpose()? })
}
