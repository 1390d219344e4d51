//! Which columns of a table are those of a light curve, by names used by observers and archives.

use crate::data::io::table::{self, Lines, Name, Table, readings};
use std::collections::{HashMap, HashSet};

/// What a column of brightness holds, or that of the values of an activity indicator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Brightness {
    Flux,
    Magnitude,
    Indicator,
}

/// The kind of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    LightCurve,
    Indicator,
}

impl Of {
    /// The required columns.
    fn columns(self) -> &'static str {
        match self {
            Of::LightCurve => "time, flux, sigma",
            Of::Indicator => "time, value, sigma",
        }
    }
}

/// Names of times that are Julian dates, or days in any time system; in order of preference.
const TIMES: [&str; 14] =
    ["time", "times", "bjd", "bjdtdb", "bjdutc", "hjd", "hjdutc", "jd", "jdutc", "t", "tmid", "midtime", "days", "day"];

/// Names of days with another origin, and that origin.
const ZERO_POINTS: [(&str, f64); 12] = [
    ("btjd", BTJD),
    ("tjd", BTJD),
    ("bkjd", BKJD),
    ("kjd", BKJD),
    ("mjd", MJD),
    ("bmjd", MJD),
    ("hmjd", MJD),
    ("mjdtdb", MJD),
    ("bmjdtdb", MJD),
    ("mjdutc", MJD),
    ("rjd", RJD),
    ("rbjd", RJD),
];

/// Origins of time systems as Julian dates.
pub const BTJD: f64 = 2_457_000.0;
pub const BKJD: f64 = 2_454_833.0;
pub const MJD: f64 = 2_400_000.5;
pub const RJD: f64 = 2_400_000.0;

/// Names of fluxes; in order of preference.
const FLUXES: [&str; 19] = [
    "flux",
    "fluxes",
    "f",
    "normflux",
    "normalizedflux",
    "normalisedflux",
    "fluxnorm",
    "relativeflux",
    "relflux",
    "correctedflux",
    "fluxcorr",
    "fcor",
    "pdcsapflux",
    "kspsapflux",
    "sapflux",
    "detflux",
    "counts",
    "intensity",
    "brightness",
];

/// Names of magnitudes.
const MAGNITUDES: [&str; 13] = [
    "mag",
    "mags",
    "magnitude",
    "magnitudes",
    "vmag",
    "bmag",
    "gmag",
    "rmag",
    "imag",
    "zmag",
    "tmag",
    "kpmag",
    "magcorr",
];

/// Prefixes and suffixes that turn the name of a column into that of its error.
const OF_ERRORS: [&str; 11] =
    ["err", "error", "errors", "sigma", "sig", "uncertainty", "unc", "e", "d", "std", "stddev"];

/// Names of errors of any quantity.
const ERRORS: [&str; 14] = [
    "sigma",
    "fluxerr",
    "fluxerror",
    "err",
    "error",
    "errors",
    "eflux",
    "e",
    "sig",
    "uncertainty",
    "unc",
    "std",
    "magerr",
    "merr",
];

/// Names of flags, and of bands.
const FLAGS: [&str; 11] = [
    "quality",
    "sapquality",
    "qualityflag",
    "qualityflags",
    "dquality",
    "flag",
    "flags",
    "catflags",
    "qflag",
    "qual",
    "q",
];
const BANDS: [&str; 6] = ["filter", "filt", "filtercode", "band", "passband", "bandpass"];

/// Units of time that are days.
const DAYS: [&str; 11] = ["", "d", "day", "days", "jd", "bjd", "hjd", "bjdtdb", "tdb", "utc", "jdutc"];

/// Words of flags for good rows.
const GOOD: [&str; 5] = ["g", "good", "ok", "a", "pass"];

/// Largest number of lines searched for the line of names.
const MOST_LINES: usize = 100;

/// The columns of a light curve by their numbers.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    names: Vec<Name>,
    pub time: usize,
    pub value: usize,
    pub sigma: usize,
    pub flag: Option<usize>,
    pub band: Option<usize>,
    pub brightness: Brightness,
    /// Whether the brightness has a unit, in brackets or in its name.
    pub has_unit: bool,
    /// The origin of times (JD), where given and not 0.
    pub zero_jd: Option<f64>,
    /// Remarks on the choice.
    pub remarks: Vec<String>,
}

impl Columns {
    /// The columns of a table with this text.
    ///
    /// # Errors
    /// A missing column.
    pub fn of(table: &Table, text: &str, of: Of) -> Result<Self, String> {
        let count = table.rows.iter().map(|row| row.cells.len()).max().unwrap_or(0);
        // rows without a flux may come first, which are no names, and rows whose last cell is empty look shorter
        let Lines { lines, comments } = Lines::of(text);
        let lines = lines.iter().map(|line| line.text).chain(comments);
        let named = lines.filter(|line| line.contains(char::is_alphabetic)).take(MOST_LINES);
        let of_line = |line| [count, count + 1].into_iter().flat_map(move |count| readings(line, count));
        let others: Vec<Vec<Name>> = named.flat_map(of_line).collect();
        let mut first_problem = None;
        for names in table.names.iter().chain(&others) {
            let columns = match of {
                Of::LightCurve => Columns::named(names),
                Of::Indicator => Columns::of_indicator(names),
            };
            match columns {
                Ok(columns) => return Ok(columns),
                Err(problem) => drop(first_problem.get_or_insert(problem)),
            }
        }
        match first_problem {
            None if count == 3 => Ok(Columns::unnamed(of)),
            Some(problem) if table.names.iter().flatten().any(|name| !name.bare.is_empty()) => Err(problem),
            _ => {
                let due = of.columns();
                Err(format!("no line of names: the first line must name the columns, {due} among them"))
            }
        }
    }

    /// The three columns of a table without names.
    fn unnamed(of: Of) -> Self {
        let name = |bare: &str| Name { written: bare.into(), bare: bare.into(), unit: String::new() };
        let (value, brightness) = match of {
            Of::LightCurve => ("flux", Brightness::Flux),
            Of::Indicator => ("value", Brightness::Indicator),
        };
        Columns {
            names: ["time", value, "sigma"].map(name).to_vec(),
            time: 0,
            value: 1,
            sigma: 2,
            flag: None,
            band: None,
            brightness,
            has_unit: false,
            zero_jd: None,
            remarks: vec![format!("no line of names: the columns are taken for {}", of.columns())],
        }
    }

    fn named(names: &[Name]) -> Result<Self, String> {
        let first_of = |of: &[&str]| of.iter().find_map(|one| names.iter().position(|name| name.bare == *one));
        let missing = |what: &str| {
            let written: Vec<&str> = names.iter().map(|name| name.written.as_str()).collect();
            format!(
                "no column {what} among {}: the first line must name the columns, time, flux, sigma among them",
                written.join(", ")
            )
        };
        let time = time(names).ok_or_else(|| missing("time"))?;
        let zero_jd = zero_jd(&names[time].bare).or_else(|| zero_jd(&names[time].unit));
        if zero_jd.is_none() && !DAYS.contains(&names[time].unit.as_str()) {
            return Err(format!("column {}: times must be in days", names[time].written));
        }
        let with_unit = |of: &str| names.iter().position(|name| name.bare.starts_with(of) && is_value(&name.bare, of));
        let flux = first_of(&FLUXES).or_else(|| with_unit("flux")).filter(|k| !names[*k].unit.contains("mag"));
        let magnitude = first_of(&MAGNITUDES).or_else(|| names.iter().position(|name| name.unit == "mag"));
        let (value, brightness) = match (flux, magnitude) {
            (Some(flux), _) => (flux, Brightness::Flux),
            (None, Some(magnitude)) => (magnitude, Brightness::Magnitude),
            (None, None) => return Err(missing("flux")),
        };
        let bare = names[value].bare.as_str();
        let own = OF_ERRORS.iter().flat_map(|error| [format!("{bare}{error}"), format!("{error}{bare}")]);
        let own: Vec<String> = own.collect();
        let of_other = |name: &str| match brightness {
            Brightness::Flux | Brightness::Indicator => name.contains("mag"),
            Brightness::Magnitude => name.contains("flux"),
        };
        let usual: Vec<&str> = ERRORS.into_iter().filter(|name| !of_other(name)).collect();
        let own = own.iter().map(String::as_str).collect::<Vec<_>>();
        let sigma = first_of(&own).or_else(|| first_of(&usual)).filter(|k| *k != value && *k != time);
        let sigma = sigma.ok_or_else(|| missing(&format!("sigma (the error of {})", names[value].written)))?;
        let mut remarks = Vec::new();
        let others: Vec<&Name> = names
            .iter()
            .enumerate()
            .filter(|(k, one)| *k != value && FLUXES.contains(&&*one.bare))
            .map(|(_, n)| n)
            .collect();
        if brightness == Brightness::Flux && !others.is_empty() {
            let others: Vec<&str> = others.iter().map(|name| name.written.as_str()).collect();
            remarks.push(format!("its flux is the column {}, not {}", names[value].written, others.join(", ")));
        }
        Ok(Columns {
            has_unit: !names[value].unit.is_empty() || !FLUXES.contains(&bare),
            names: names.to_vec(),
            time,
            value,
            sigma,
            flag: first_of(&FLAGS),
            band: first_of(&BANDS),
            brightness,
            zero_jd,
            remarks,
        })
    }

    /// Those of an activity indicator: its value is in the column `value`, or else in the first that is not a time,
    /// error or flag.
    fn of_indicator(names: &[Name]) -> Result<Self, String> {
        let missing = |what: &str| {
            let written: Vec<&str> = names.iter().map(|name| name.written.as_str()).collect();
            format!(
                "no column {what} among {}: the first line must name the columns, time, value, sigma among them",
                written.join(", ")
            )
        };
        let time = time(names).ok_or_else(|| missing("time"))?;
        let zero_jd = zero_jd(&names[time].bare).or_else(|| zero_jd(&names[time].unit));
        if zero_jd.is_none() && !DAYS.contains(&names[time].unit.as_str()) {
            return Err(format!("column {}: times must be in days", names[time].written));
        }
        // by name, the first of each: a table may have thousands of columns
        let places: HashMap<&str, usize> = names.iter().enumerate().rev().map(|(k, name)| (&*name.bare, k)).collect();
        let of_error = |of: &str| {
            let own = OF_ERRORS.iter().flat_map(|error| [format!("{of}{error}"), format!("{error}{of}")]);
            own.filter_map(|name| places.get(&*name).copied()).min()
        };
        let errors: HashSet<usize> = names.iter().filter_map(|name| of_error(&name.bare)).collect();
        let is_error = |k: usize| ERRORS.contains(&&*names[k].bare) || errors.contains(&k);
        let is_other = |name: &Name| FLAGS.contains(&&*name.bare) || BANDS.contains(&&*name.bare);
        let is_value = |k: &usize| *k != time && !is_error(*k) && !is_other(&names[*k]);
        let plain = names.iter().position(|name| name.bare == "value");
        let value = plain.or_else(|| (0..names.len()).find(is_value)).ok_or_else(|| missing("value"))?;
        let usual = || ERRORS.iter().find_map(|error| names.iter().position(|name| name.bare == *error));
        let sigma = of_error(&names[value].bare).or_else(usual).filter(|k| *k != value && *k != time);
        let sigma = sigma.ok_or_else(|| missing(&format!("sigma (the error of {})", names[value].written)))?;
        let others = (0..names.len()).filter(|k| *k != value && is_value(k)).map(|k| names[k].written.as_str());
        let others: Vec<&str> = others.collect();
        let remark = format!("its value is the column {}, not {}", names[value].written, others.join(", "));
        Ok(Columns {
            has_unit: true,
            names: names.to_vec(),
            time,
            value,
            sigma,
            flag: names.iter().position(|name| FLAGS.contains(&&*name.bare)),
            band: None,
            brightness: Brightness::Indicator,
            zero_jd,
            remarks: if others.is_empty() { Vec::new() } else { vec![remark] },
        })
    }

    /// The name of a column as written.
    pub fn name(&self, column: usize) -> &str {
        &self.names[column].written
    }
}

/// The column of times.
fn time(names: &[Name]) -> Option<usize> {
    // "time_bjd" is as "bjd"
    let is = |name: &Name, due: &str| name.bare == due || name.bare.strip_prefix("time") == Some(due);
    let plain = TIMES.iter().find_map(|due| names.iter().position(|name| is(name, due)));
    plain.or_else(|| names.iter().position(|name| zero_jd(&name.bare).is_some()))
}

/// The origin (JD) given by the name of a time, such as "BTJD", "BJD - 2457000", "time_mjd".
fn zero_jd(bare: &str) -> Option<f64> {
    let name = bare.strip_prefix("time").filter(|rest| !rest.is_empty()).unwrap_or(bare);
    if let Some((_, zero)) = ZERO_POINTS.iter().find(|(one, _)| *one == name) {
        return Some(*zero);
    }
    let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
    match (letters.contains("jd") || letters.is_empty(), &name[letters.len()..]) {
        (true, "24000005") => Some(MJD),
        (true, digits) if digits.len() == 7 && digits.starts_with("24") => digits.parse().ok(),
        _ => None,
    }
}

/// Whether a name that begins like one of brightness is not that of its error: `flux_mjy`, not `flux_err`.
fn is_value(bare: &str, of: &str) -> bool {
    let rest = &bare[of.len()..];
    ["mjy", "jy", "e/s", "adu", "counts", "erg"].iter().any(|unit| rest.starts_with(unit)) && !rest.ends_with("err")
}

/// Whether the flag of a row says that it is bad: a number other than 0, or a word that does not mean good.
pub(super) fn is_flagged(cell: &str) -> bool {
    match table::number(cell) {
        Ok(number) => number != 0.0 && !number.is_nan(),
        Err(_) => !GOOD.contains(&cell.trim().to_lowercase().as_str()),
    }
}
