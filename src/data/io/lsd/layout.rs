//! What stands before the rows of a profile, and how its rows are laid out.
//!
//! - Donati's text format (Donati et al. 1997, MNRAS 291, 658), as LSDpy and SpecpolFlow write it (`prof.save` in
//!   `lsdpFunc.py` of <https://github.com/folsomcp/LSDpy>, `LSD.save` in `profileLSD.py` of
//!   <https://github.com/folsomcp/specpolFlow>): a title; a line `npoints ncolumns` with the columns after the velocity
//!   (2: I, sigma; 6: V, sigma, null, sigma as well; 8: another null, sigma).
//! - iLSD (Kochukhov et al. 2010, A&A 524, A5; README of <https://github.com/okochukhov/iLSD>): a line `bins profiles
//!   S/N chi2`; rows of velocity, profile, sigma; before each further profile a line of its own `S/N chi2`.
//! - CSV: a line that names the columns, in any order; rows with commas or semicolons.
//!
//! Comments and titles before the rows are passed over, and so may be any of these lines.

use super::names::{self, Columns};
use super::row::{Fault, fault, shown};

/// What separates the fields of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    Blanks,
    Comma,
    Semicolon,
}

impl Separator {
    /// The one that a row is written with.
    fn of(line: &str) -> Self {
        match () {
            () if line.contains(';') => Separator::Semicolon,
            () if line.contains(',') => Separator::Comma,
            () => Separator::Blanks,
        }
    }

    /// The fields of a line; one separator at its end is none too many.
    pub fn fields(self, line: &str) -> Vec<&str> {
        let mark = match self {
            Separator::Blanks => return line.split_whitespace().collect(),
            Separator::Comma => ',',
            Separator::Semicolon => ';',
        };
        let line = line.trim();
        line.strip_suffix(mark).unwrap_or(line).split(mark).map(str::trim).collect()
    }
}

/// How many rows a line before them announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Announced {
    /// The line that does.
    pub line: usize,
    pub points: usize,
    /// Mean profiles in the file.
    pub profiles: usize,
}

/// How rows are to be read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub separator: Separator,
    pub columns: Columns,
    pub announced: Option<Announced>,
    /// The first of the lines handed in that is a row.
    pub first_row: usize,
}

/// Columns of a row, the velocity among them, in files that do not name them.
const USUAL: [usize; 3] = [3, 7, 9];

impl Layout {
    /// Of the numbered lines of a file that are neither blank nor comments. `comments` are those at its beginning.
    pub fn of(lines: &[(usize, &str)], comments: &[&str]) -> Result<Self, Fault> {
        let (mut at, mut announced, mut count, mut named) = (0, None, None, None);
        while let Some((line, text)) = lines.get(at).copied() {
            let counts_follow = lines.get(at + 1).is_some_and(|(_, next)| donati_counts(next).is_some());
            if let Some((points, columns)) = donati_counts(text) {
                if !USUAL.contains(&columns.saturating_add(1)) {
                    let problem = format!("announces {columns} columns after the velocity, not 2, 6 or 8");
                    return fault(line, problem);
                }
                (announced, count) = (Some(Announced { line, points, profiles: 1 }), Some(columns + 1));
                at += 1;
                break;
            }
            if let Some((points, profiles)) = ilsd_counts(text) {
                (announced, count) = (Some(Announced { line, points, profiles }), Some(3));
                at += 1;
                break;
            }
            if !counts_follow && !is_title(text) {
                break;
            }
            named = Some((line, text));
            at += 1;
            if !counts_follow && names::columns(&Separator::of(text).fields(text)).is_ok() {
                break;
            }
        }
        let first = lines.get(at).map_or("", |(_, text)| text);
        let separator = Separator::of(first);
        let fields = separator.fields(first).len();
        let columns = match names_before(named, comments, separator)? {
            Some(columns) => columns,
            None => Columns::usual(count.unwrap_or(if USUAL.contains(&fields) { fields } else { 3 })),
        };
        Ok(Layout { separator, columns, announced, first_row: at })
    }
}

/// The columns by the line that names them: the last title, which must where rows have commas, or the last comment.
fn names_before(
    title: Option<(usize, &str)>,
    comments: &[&str],
    separator: Separator,
) -> Result<Option<Columns>, Fault> {
    let by_comment = || comments.last().and_then(|text| names::columns(&separator.fields(uncommented(text))).ok());
    let Some((line, text)) = title else { return Ok(by_comment()) };
    match names::columns(&separator.fields(text)) {
        Ok(columns) => Ok(Some(columns)),
        // blanks separate the words of any title
        Err(_) if separator == Separator::Blanks => Ok(by_comment()),
        Err(problem) => fault(line, problem),
    }
}

/// Marks that begin a comment.
const COMMENT: [char; 4] = ['#', '*', '!', '%'];

/// Whether a line is a comment.
pub(super) fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(COMMENT)
}

fn uncommented(line: &str) -> &str {
    line.trim_start().trim_start_matches(COMMENT).trim_start()
}

/// A line before the rows is a title unless it reads as numbers; one with the columns of a row and a single bad number
/// is a bad row.
fn is_title(line: &str) -> bool {
    let separator = Separator::of(line);
    let fields = separator.fields(line);
    let bad = fields.iter().filter(|f| f.parse::<f64>().is_err()).count();
    bad > if USUAL.contains(&fields.len()) { 1 } else { 0 }
}

/// The two whole numbers of a line `npoints ncolumns`.
fn donati_counts(line: &str) -> Option<(usize, usize)> {
    match line.split_whitespace().collect::<Vec<_>>()[..] {
        [points, columns] => Some((points.parse().ok()?, columns.parse().ok()?)),
        _ => None,
    }
}

/// The two whole numbers of a line `bins profiles S/N chi2`.
fn ilsd_counts(line: &str) -> Option<(usize, usize)> {
    match line.split_whitespace().collect::<Vec<_>>()[..] {
        [bins, profiles, snr, chi2] => {
            snr.parse::<f64>().ok()?;
            chi2.parse::<f64>().ok()?;
            Some((bins.parse().ok()?, profiles.parse().ok().filter(|count| *count > 0)?))
        }
        _ => None,
    }
}

/// Why a row with another number of fields cannot be read.
pub(super) fn wrong_count(layout: &Layout, fields: &[&str]) -> String {
    let (found, due) = (fields.len(), layout.columns.count);
    match fields {
        [] | [""] => "no numbers".into(),
        [one] if found < due => format!("{found} columns instead of {due}: {}", shown(one)),
        _ => format!("{found} columns instead of {due}"),
    }
}
