//! Light curves: tables of time, flux and its error as others write them, and the one that `dimcmc simulate` writes.

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

/// Times beyond it (d) are a mistake, and so are fluxes.
const LARGEST: [f64; 2] = [1e9, 1e30];

/// Magnitudes beyond these stand for none.
const MAGNITUDES: [f64; 2] = [-30.0, 40.0];

/// Where more than this share of the fluxes is 0 or below, they are no fluxes.
const FEW: f64 = 0.1;

/// Fluxes without a unit whose median is in this range, and most of which lie within so much, are magnitudes: fluxes
/// are near 1, or counts by the hundred.
const LIKE_MAGNITUDES: [f64; 2] = [2.5, 30.0];
const SPAN_OF_MAGNITUDES: f64 = 2.5;

/// A light curve as it is in its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// The measurements, in the order of time.
    pub fluxes: Vec<Flux>,
    /// What was made of the table on reading.
    pub remarks: Vec<String>,
    /// From where its days are counted, as a Julian date, where the table says so and it is not from 0.
    pub zero_jd: Option<f64>,
}

/// Why a row is left out.
enum Unused {
    /// Its flag says so.
    Flagged,
    /// It lacks a number that makes sense.
    Without(String),
}

/// Reads a light curve.
///
/// # Errors
/// [`FileError`]: a file that cannot be read, lacks a column that is needed, or has numbers that are none of a light
/// curve.
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

/// What is to be done with a file that is no text.
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

/// That many fluxes are 0 or below: the first of them.
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

/// That all measurements are of one band.
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
mod tests {
    use super::*;

    /// Times and fluxes that are read, and remarks.
    fn read(text: &str) -> (Vec<(f64, f64)>, Vec<String>) {
        let Measurements { fluxes, remarks, .. } = parse(text, Of::LightCurve).unwrap();
        assert!(fluxes.iter().all(|one| (one.sigma - 0.5e-3).abs() < 1e-9), "{fluxes:?}");
        (fluxes.iter().map(|one| (one.time_d, one.flux)).collect(), remarks)
    }

    fn refusal(text: &str, parts: &[&str]) {
        let (line, problem) = parse(text, Of::LightCurve).unwrap_err();
        let said = format!("line {line}: {problem}");
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }

    #[test]
    fn one_light_curve_however_it_is_written() {
        let rows = [(9000.5, 0.99), (9000.6, 0.98)];
        for text in [
            "time,flux,sigma\n9000.5,0.99,0.0005\n9000.6,0.98,0.0005\n",
            "\u{feff}TIME;FLUX;SIGMA\n9000.5;0.99;0.0005\n9000.6;0.98;0.0005\n",
            "# TIC 1\n# sector 2\n\nTime (d)\tFlux\tFlux Error\n9000.5\t0.99\t0.0005\n9000.6\t0.98\t0.0005\n",
            "# BJD_TDB rel_flux e_rel_flux\n9000.5 0.99 5e-4\n9000.6 0.98 5.0D-04\n",
            "hjd,camera,flux(mJy),flux_err,mag,mag_err\n9000.5,be,0.99,0.0005,11,0.1\n9000.6,bf,0.98,0.0005,11,0.1\n",
            "cadence,time,flux,flux_err,note,pos\n1,9000.5,0.99,0.0005,,\n2,9000.6,0.98,0.0005,a b,\n",
            "time,flux,error\n9000.6,0.98,5e-4\n9000.5,0.99,5e-4\n",
        ] {
            assert_eq!(read(text), (rows.to_vec(), Vec::new()), "{text}");
        }
    }

    #[test]
    fn rows_without_numbers_are_counted() {
        let rows = "9000.4,,5e-4\n9000.5,0.99,5e-4\n,0.9,5e-4\n9000.6,nan,5e-4\n9000.7,0.98,0\n9000.8,0.97,5e-4\n";
        let more = (0..20).map(|k| format!("{},1,5e-4\n", 9001 + k)).collect::<String>();
        let (found, remarks) = read(&format!("time,flux,sigma\n{rows}{more}9030,-1,5e-4\n"));
        assert_eq!(found.len(), 22);
        let due = "5 of 27 rows left out, whose numbers are missing or make no sense, line 2 the first: flux: \"\"";
        assert!(remarks.len() == 1 && remarks[0].contains(due), "{remarks:?}");
        refusal("time,flux,sigma\n9000.5,nan,1e-3\n", &["line 2: flux", "nan"]);
        refusal("time,flux,sigma\nnoon,1,1e-3\n", &["line 2: time", "noon"]);
        refusal("time;flux;sigma\n9000,5;0,99;0,001\n", &["line 2", "decimal comma"]);
    }

    #[test]
    fn flagged_rows_are_counted() {
        for [name, good, bad] in [["quality", "0", "128"], ["SAP_QUALITY", "0", "2"], ["Quality", "G", "B"]] {
            let text =
                format!("time,flux,sigma,{name}\n9000.5,0.99,5e-4,{good}\n9000.6,5,5e-4,{bad}\n9000.7,1,5e-4,{good}\n");
            let (found, remarks) = read(&text);
            assert_eq!(found, [(9000.5, 0.99), (9000.7, 1.0)]);
            assert_eq!(remarks, [format!("1 of 3 rows left out that the column {name} flags")]);
        }
        refusal("time,flux,sigma,quality\n9000.5,0.99,5e-4,1\n", &["quality", "every row"]);
    }

    #[test]
    fn magnitudes_become_fluxes_or_are_named() {
        for name in ["mag,mag_err", "Magnitude,Uncertainty", "Vmag,e_Vmag"] {
            let text =
                format!("HJD,{name}\n9000.5,11.2,0.01\n9000.6,>15.5,99.99\n9000.7,11.3,0.01\n9000.8,11.4,0.01\n");
            let Measurements { fluxes, remarks, .. } = parse(&text, Of::LightCurve).unwrap();
            let [first, middle] = [fluxes[0], fluxes[1]];
            assert!((first.flux / middle.flux - 10f64.powf(0.04)).abs() < 1e-12 && middle.flux == 1.0);
            assert!((middle.sigma - 0.009_210_34).abs() < 1e-7, "{middle:?}");
            assert!(remarks.len() == 2 && remarks[1].contains("magnitudes"), "{remarks:?}");
        }
        let numbers = "\n9000.5,11.2,0.01\n9000.6,11.3,0.01\n";
        refusal(&format!("time,flux,sigma{numbers}"), &["flux", "11.2 to 11.3", "magnitudes", "mag", "mJy"]);
        assert_eq!(parse(&format!("time,flux (mJy),sigma{numbers}"), Of::LightCurve).unwrap().fluxes[0].flux, 11.2);
        assert_eq!(parse(&format!("time,flux_mjy,sigma{numbers}"), Of::LightCurve).unwrap().fluxes[0].flux, 11.2);
        // instrumental ones, and changes of the flux
        refusal("time,flux,sigma\n1,-7.2,0.1\n2,-7.1,0.1\n", &["line 2", "-7.2 must be above 0", "mag"]);
        refusal("time,flux,sigma\n1,0.02,0.1\n2,-0.01,0.1\n", &["line 3", "Add them to 1"]);
    }

    #[test]
    fn zero_points_are_read_from_names() {
        let zero = |name: &str| parse(&format!("{name},flux,sigma\n9000.5,1,0.1\n"), Of::LightCurve).unwrap().zero_jd;
        for name in ["btjd", "BTJD", "time (BTJD)", "BJD - 2457000", "time_btjd", "Time [BJD-2457000]"] {
            assert_eq!(zero(name), Some(2_457_000.0), "{name}");
        }
        assert_eq!(
            ["bkjd", "MJD", "JD-2400000.5", "HJD-2450000"].map(zero),
            [Some(2_454_833.0), Some(2_400_000.5), Some(2_400_000.5), Some(2_450_000.0)]
        );
        assert_eq!(["time", "BJD_TDB", "JD", "time (d)"].map(zero), [None; 4]);
        refusal("time (s),flux,sigma\n1,1,0.1\n", &["time (s)", "days"]);
    }

    #[test]
    fn indicators_have_values_of_either_sign_by_any_name() {
        for text in [
            "time,value,sigma\n9000.5,-0.25,0.1\n9000.6,12,0.1\n",
            "BJD;S_MW;e_S_MW\n9000.5;-0.25;0.1\n9000.6;12;0.1\n",
            "# run 2\nmjd\tBl (G)\tsigma\tflag\n9000.5\t-0.25\t0.1\t0\n9000.55\t9\t0.1\t1\n9000.6\t12\t0.1\t0\n",
            "jd err halpha\n9000.6 0.1 12\n9000.5 0.1 -0.25\n",
            "9000.5 -0.25 0.1\n9000.6 12 0.1\n",
        ] {
            let Measurements { fluxes, .. } = parse(text, Of::Indicator).unwrap();
            let found: Vec<[f64; 3]> = fluxes.iter().map(|one| [one.time_d, one.flux, one.sigma]).collect();
            assert_eq!(found, [[9000.5, -0.25, 0.1], [9000.6, 12.0, 0.1]], "{text}");
        }
        let several = parse("time,halpha,halpha_err,bis\n1,2,0.1,3\n", Of::Indicator).unwrap();
        assert_eq!((several.fluxes[0].flux, &*several.remarks[0]), (2.0, "its value is the column halpha, not bis"));
        let (line, problem) = parse("time,halpha\n1,2\n", Of::Indicator).unwrap_err();
        assert!(line == 0 && problem.contains("no column sigma (the error of halpha)"), "{problem}");
    }

    #[test]
    fn one_flux_of_several_and_one_band() {
        let text = "TIME,SAP_FLUX,SAP_FLUX_ERR,PDCSAP_FLUX,PDCSAP_FLUX_ERR\n9000.5,900,2,0.99,0.0005\n";
        let (found, remarks) = read(text);
        assert_eq!((found, remarks.len()), (vec![(9000.5, 0.99)], 1));
        assert!(remarks[0].contains("PDCSAP_FLUX, not SAP_FLUX"), "{remarks:?}");
        let text = "JD,flux,flux_err,Filter\n9000.5,1,0.1,V\n9000.6,2,0.1,g\n";
        refusal(text, &["Filter", "V, g", "photometry"]);
        refusal("time,flux\n1,2\n", &["no column sigma", "time, flux, sigma"]);
    }
}
