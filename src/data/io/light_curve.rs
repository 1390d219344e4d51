//! Light curves: tables of time, flux and its error in the formats of others, and the one that `dimcmc simulate`
//! writes.

mod columns;
mod zero_point;

use super::atomic::{WriteError, write};
use super::table::{self, NotText, Row, Table};
use super::{FileError, csv, outweighs};
use crate::surface::photometry::Flux;
use columns::{Brightness, Columns, Of};
use std::collections::{BTreeSet, HashSet};
use std::path::Path;

pub use zero_point::fitting;

/// Columns of the table that is written.
const COLUMNS: [&str; 3] = ["time", "flux", "sigma"];

/// Times (d) and fluxes beyond this are mistakes.
const LARGEST: [f64; 2] = [1e9, 1e30];

/// Magnitudes beyond these are missing values.
const MAGNITUDES: [f64; 2] = [-30.0, 40.0];

/// Where more than this share of the fluxes is 0 or below, they are not fluxes.
const FEW: f64 = 0.1;

/// Fluxes without a unit whose median is in this range, most of which lie within this of it, are magnitudes: fluxes are
/// near 1, or counts by the hundred.
const LIKE_MAGNITUDES: [f64; 2] = [2.5, 30.0];
const SPAN_OF_MAGNITUDES: f64 = 2.5;

/// A light curve as in its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// The measurements, in the order of time.
    pub fluxes: Vec<Flux>,
    /// Remarks on the reading of the table.
    pub remarks: Vec<String>,
    /// The origin of its times, as a Julian date, where the table gives one other than 0.
    pub zero_jd: Option<f64>,
}

/// Why a row is left out.
enum Unused {
    /// Its flag says so.
    Flagged,
    /// It lacks a valid number.
    Without(String),
}

/// Reads a light curve.
///
/// # Errors
/// [`FileError`]: a file that cannot be read, lacks a column that is needed, or has numbers invalid for a light curve.
pub fn read(path: &Path) -> Result<Measurements, FileError> {
    read_table(path, Of::LightCurve)
}

/// Reads the values of an activity indicator, which are in place of fluxes.
///
/// # Errors
/// As [`read`].
pub fn read_indicator(path: &Path) -> Result<Measurements, FileError> {
    read_table(path, Of::Indicator)
}

fn read_table(path: &Path, of: Of) -> Result<Measurements, FileError> {
    let bytes = std::fs::read(path).map_err(|source| FileError::Read { path: path.into(), source })?;
    let text = table::text(&bytes).map_err(|what| FileError::of(path, no_text(what, path)))?;
    parse(&text, of).map_err(|(line, problem)| match line {
        0 => FileError::of(path, problem),
        line => FileError::Line { path: path.into(), line, problem },
    })
}

/// Advice on a file that is not text.
fn no_text(what: NotText, path: &Path) -> String {
    let cure = match what {
        NotText::Fits => {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            format!(
                "in Python, `import lightkurve; lightkurve.read({name:?}).to_csv(\"lightcurve.csv\")` writes one (or \
                 `astropy.table.Table.read`, and `write`)"
            )
        }
        NotText::Compressed => "unpack it".into(),
        _ => "save it as comma-separated values".into(),
    };
    format!("is {what}, not a table as text: {cure}")
}

/// Reads the text of a table; a problem has its line, or 0.
fn parse(text: &str, of: Of) -> Result<Measurements, (usize, String)> {
    let table = Table::of(text);
    let Some(first) = table.rows.first() else { return Err((0, "the table has no row of numbers".into())) };
    let columns = Columns::of(&table, text, of).map_err(|problem| (0, problem))?;
    let is_used = |row: &&Row| !columns.flag.is_some_and(|flag| columns::is_flagged(row.cell(flag)));
    if let Some(band) = columns.band {
        one_band(&columns, table.rows.iter().filter(is_used).map(|row| row.cell(band)))?;
    }
    let mut rows = Vec::new();
    let mut seen = HashSet::new();
    let (mut flagged, mut without, mut copies) = (0, Vec::new(), Vec::new());
    for row in &table.rows {
        match numbers(row, &columns) {
            Ok(numbers) if !seen.insert(numbers.map(f64::to_bits)) => copies.push(row.line),
            Ok(numbers) => rows.push(numbers),
            Err(Unused::Flagged) => flagged += 1,
            Err(Unused::Without(problem)) => without.push((row.line, problem)),
        }
    }
    let count = |is_none: &dyn Fn(f64) -> bool| rows.iter().filter(|[_, flux, _]| is_none(*flux)).count();
    let mut remarks = columns.remarks.clone();
    if columns.brightness == Brightness::Flux {
        let dark = count(&|flux| flux <= 0.0);
        if dark as f64 > FEW * rows.len() as f64 {
            return Err(not_positive(&table, &columns, dark, rows.len()));
        }
        let is_dark = |row: &&Row| numbers(row, &columns).is_ok_and(|[_, flux, _]| flux <= 0.0);
        without.extend(table.rows.iter().filter(is_dark).map(|row| (row.line, "flux is 0 or below".into())));
        without.sort_by_key(|(line, _)| *line);
        rows.retain(|[_, flux, _]| *flux > 0.0);
    }
    match (rows.is_empty(), without.first()) {
        (true, Some(first)) => return Err(first.clone()),
        (true, None) => {
            let flag = columns.flag.map(|flag| columns.name(flag)).unwrap_or_default();
            let problem = format!("{flag} flags every row: good ones have 0 or G there; leave the column out");
            return Err((first.line, problem));
        }
        _ => {}
    }
    if let Some((line, problem)) = without.first() {
        let (these, all) = (without.len(), table.rows.len());
        remarks.push(format!(
            "{these} of {all} rows left out, whose numbers are missing or make no sense, line {line} the first: \
             {problem}"
        ));
    }
    if let Some(line) = copies.first() {
        let (these, all) = (copies.len(), table.rows.len());
        remarks.push(format!("{these} of {all} rows left out, copies of others, line {line} the first"));
    }
    if let Some(flag) = columns.flag.filter(|_| flagged > 0) {
        let (name, all) = (columns.name(flag), table.rows.len());
        remarks.push(format!("{flagged} of {all} rows left out that the column {name} flags"));
    }
    let sorted = |column: usize| {
        let mut values: Vec<f64> = rows.iter().map(|row| row[column]).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let sigmas = sorted(2);
    let usual = sigmas[sigmas.len() / 2];
    let too_sure = |row: &'_ Row| {
        let problem = outweighs(numbers(row, &columns).ok()?[2], usual, "rows")?;
        let (name, cell) = (columns.name(columns.sigma), table::shown(row.cell(columns.sigma)));
        Some((row.line, format!("{name}: {cell} is {problem}. Correct it, or leave the row out")))
    };
    if let Some(problem) = table.rows.iter().find_map(too_sure) {
        return Err(problem);
    }
    let values = sorted(1);
    let median = values[values.len() / 2];
    if columns.brightness == Brightness::Magnitude {
        remarks.push(format!("magnitudes, converted to fluxes in units of that at {median:.3} mag"));
        rows.iter_mut().for_each(|row| *row = flux_of(*row, median));
    } else if columns.brightness == Brightness::Flux && !columns.has_unit {
        let span = values[values.len() * 19 / 20] - values[values.len() / 20];
        let is_there = (LIKE_MAGNITUDES[0]..=LIKE_MAGNITUDES[1]).contains(&median) && span < SPAN_OF_MAGNITUDES;
        if is_there {
            let (name, last) = (columns.name(columns.value), values.len() - 1);
            let problem = format!(
                "{name}: values from {} to {} look like magnitudes: call the column mag, and it is made a flux. If it \
                 is one, give its unit in the name, as in \"{name} (mJy)\", or divide it by its median",
                values[0], values[last]
            );
            return Err((0, problem));
        }
    }
    let flux = |[time_d, flux, sigma]: [f64; 3]| Flux { time_d, flux, sigma };
    let mut fluxes: Vec<Flux> = rows.into_iter().map(flux).collect();
    fluxes.sort_by(|a, b| a.time_d.total_cmp(&b.time_d));
    Ok(Measurements { fluxes, remarks, zero_jd: columns.zero_jd })
}

/// Time, flux or magnitude, and its error, of a row.
fn numbers(row: &Row, columns: &Columns) -> Result<[f64; 3], Unused> {
    if columns.flag.is_some_and(|flag| columns::is_flagged(row.cell(flag))) {
        return Err(Unused::Flagged);
    }
    let number = |column: usize, [low, high]: [f64; 2]| {
        let (name, cell) = (columns.name(column), row.cell(column));
        let without = |problem: String| Err(Unused::Without(format!("{name}: {problem}")));
        match table::number(cell) {
            Ok(number) if number.is_nan() => without(format!("{} is no number", table::shown(cell))),
            Ok(number) if !(low..=high).contains(&number) => match low > 0.0 && number <= 0.0 {
                true => without(format!("{number} must be above 0")),
                false => without(format!("{number:e} must be from {low:e} to {high:e}")),
            },
            Ok(number) => Ok(number),
            Err(problem) => without(problem),
        }
    };
    let values = match columns.brightness {
        Brightness::Flux | Brightness::Indicator => [-LARGEST[1], LARGEST[1]],
        Brightness::Magnitude => MAGNITUDES,
    };
    let positive = [1.0 / LARGEST[1], LARGEST[1]];
    Ok([
        number(columns.time, [-LARGEST[0], LARGEST[0]])?,
        number(columns.value, values)?,
        number(columns.sigma, positive)?,
    ])
}

/// The error of too many fluxes of 0 or below, at the first of them.
fn not_positive(table: &Table, columns: &Columns, dark: usize, all: usize) -> (usize, String) {
    let name = columns.name(columns.value);
    let of_row = |row: &Row| numbers(row, columns).ok().map(|[_, flux, _]| (row.line, flux));
    let (line, flux) = table.rows.iter().filter_map(of_row).find(|(_, flux)| *flux <= 0.0).unwrap_or((0, 0.0));
    let problem = format!(
        "{name}: {flux} must be above 0, as {dark} of {all} are not. Are these magnitudes? Call the column mag. Are \
         they changes of the flux? Add them to 1, per cent divided by 100 and ppm by 1e6"
    );
    (line, problem)
}

/// Checks that all measurements are of one band.
fn one_band<'a>(columns: &Columns, cells: impl Iterator<Item = &'a str>) -> Result<(), (usize, String)> {
    let bands: BTreeSet<&str> = cells.filter(|cell| !table::is_missing(cell)).collect();
    match bands.len() {
        0 | 1 => Ok(()),
        _ => {
            let name = columns.band.map(|band| columns.name(band)).unwrap_or_default();
            let named = bands.into_iter().collect::<Vec<_>>().join(", ");
            let problem = format!(
                "column {name} has several: {named}. A light curve is of one band: give one table per band, listed \
                in photometry"
            );
            Err((0, problem))
        }
    }
}

/// Flux in units of that at `zero` magnitudes.
fn flux_of([time_d, magnitude, sigma]: [f64; 3], zero: f64) -> [f64; 3] {
    let flux = 10f64.powf(-0.4 * (magnitude - zero));
    [time_d, flux, 0.4 * std::f64::consts::LN_10 * flux * sigma]
}

/// Writes a light curve.
///
/// # Errors
/// A file that cannot be written.
pub fn write_to(path: &Path, measured: &[Flux]) -> Result<(), WriteError> {
    let mut table = csv::Table::new(&COLUMNS);
    measured.iter().for_each(|one| table.row(&[one.time_d, one.flux, one.sigma]));
    write(path, &table.into_bytes())
}

#[cfg(test)]
mod tests;
