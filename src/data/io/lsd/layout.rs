//! The lines before the rows of a profile, and the layout of its rows.
//!
//! - Donati's text format (Donati et al. 1997, MNRAS 291, 658), as LSDpy and SpecpolFlow write it (`prof.save` in
//!   `lsdpFunc.py` of <https://github.com/folsomcp/LSDpy>, `LSD.save` in `profileLSD.py` of
//!   <https://github.com/folsomcp/specpolFlow>): a title; a line `npoints ncolumns` with the columns after the velocity
//!   (2: I, sigma; 6: V, sigma, null, sigma as well; 8: another null, sigma).
//! - iLSD (Kochukhov et al. 2010, A&A 524, A5; README of <https://github.com/okochukhov/iLSD>): a line `bins profiles
//!   S/N chi2`; rows of velocity, profile, sigma; before each further profile its own line `S/N chi2`.
//! - CSV and other tables (`data::io::table`): a line that names the columns, in any order and perhaps with units;
//!   rules of dashes or units below it, as in an `.rdb`; rows with commas, semicolons, tabs or blanks.
//!
//! Comments and titles before the rows are skipped, and any of these lines may be absent. A fourth column without a
//! name is a flag.

use super::names::{self, Columns};
use super::row::{Fault, fault, shown};
use crate::data::io::table::{Line, Lines, Separator, add_units, all_readings, is_below_names, number, readings};

/// The number of rows announced by a line before them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Announced {
    /// That line.
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

/// Columns of a row, the velocity among them, in files that do not name them; four hold a flag.
const USUAL: [usize; 4] = [3, 4, 7, 9];

impl Layout {
    /// The layout from the lines of a file and the comments at its beginning.
    pub fn of(Lines { lines, comments }: &Lines) -> Result<Self, Fault> {
        let (mut at, mut announced, mut count, mut named) = (0, None, None, None);
        while let Some(Line { number: line, text }) = lines.get(at).copied() {
            let counts_follow = lines.get(at + 1).is_some_and(|next| donati_counts(next.text).is_some());
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
            // the line below the names, dashes or units, has no names
            let below = named.is_some_and(|names| is_named(names) && is_below_names(&cells(text)));
            if !below {
                named = Some(Line { number: line, text });
            }
            at += 1;
        }
        let rows = &lines[at..];
        let separator = Separator::of(named.map(|line| line.text), rows.iter().map(|line| line.text));
        let first = rows.first().map_or_else(Vec::new, |line| separator.cells(line.text));
        let below = named.and_then(|names| lines[..at].iter().find(|line| line.number > names.number));
        let columns = match names_before(named, below, comments, (separator, first.len()))? {
            Some(columns) => columns,
            None => Columns::usual(count.unwrap_or(if is_usual(&first) { first.len() } else { 3 })),
        };
        Ok(Layout { separator, columns, announced, first_row: at })
    }
}

/// The cells of a line by itself.
fn cells(line: &str) -> Vec<&str> {
    Separator::of(None, std::iter::once(line)).cells(line)
}

/// Whether a row has as many cells as rows without names have. The last of four is a flag only if it is a whole number
/// or a word.
fn is_usual(cells: &[&str]) -> bool {
    USUAL.contains(&cells.len()) && (cells.len() != 4 || !number(cells[3]).is_ok_and(|flag| flag.fract() != 0.0))
}

/// Whether a line names the columns.
fn is_named(Line { text, .. }: Line) -> bool {
    all_readings(text, 3..=usize::MAX).iter().any(|names| names::columns(names).is_ok())
}

/// The columns of rows with this many cells from the line that names them: the last title, which must name them where
/// cells have separators, or the last comment. Units may be in the line `below`.
fn names_before(
    title: Option<Line>,
    below: Option<&Line>,
    comments: &[&str],
    (separator, count): (Separator, usize),
) -> Result<Option<Columns>, Fault> {
    let by_comment = || {
        let readings = comments.last().map_or_else(Vec::new, |text| readings(text, count));
        readings.iter().find_map(|names| names::columns(names).ok())
    };
    let Some(Line { number: line, text }) = title else { return Ok(by_comment()) };
    let mut all = readings(text, count);
    if all.is_empty() {
        // use the existing number, so that the row is reported as the error
        all = readings(text, separator.cells(text).len());
    }
    if let Some(below) = below {
        all.iter_mut().for_each(|names| add_units(names, &separator.cells(below.text)));
    }
    let mut problem = None;
    for names in &all {
        match names::columns(names) {
            Ok(columns) => return Ok(Some(columns)),
            Err(error) => problem = problem.or(Some(error)),
        }
    }
    match problem {
        // blanks separate the words of any title
        Some(problem) if separator != Separator::Blanks => fault(line, problem),
        _ => Ok(by_comment()),
    }
}

/// A line before the rows is a title unless it reads as numbers; one with the columns of a row and a single bad number
/// is a bad row.
fn is_title(line: &str) -> bool {
    let cells = cells(line);
    let bad = cells.iter().filter(|cell| number(cell).is_err()).count();
    is_below_names(&cells) || bad > if USUAL.contains(&cells.len()) { 1 } else { 0 }
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
        _ if layout.separator == Separator::Comma && found == 2 * due => {
            format!("{found} columns instead of {due}: decimal commas? write numbers with decimal points")
        }
        _ if found == 4 && layout.columns.flag.is_none() => {
            format!("{found} columns instead of {due}: name them in a line before the rows (velocity, I, sigma, ...)")
        }
        [_, _] if due == 3 => "2 columns instead of 3: velocity, I and sigma are due".into(),
        [one] if found < due => format!("{found} columns instead of {due}: {}", shown(one)),
        _ => format!("{found} columns instead of {due}"),
    }
}
