//! Whether the times of a list are days in one time system, one for each of several profiles.

use super::list::Entry;
use std::collections::HashMap;
use std::path::PathBuf;

/// Times of this size are not days, and velocities of that size (km/s) do not occur in stars.
const BEYOND_SENSE_D: f64 = 1e9;
const BEYOND_SENSE_KMS: f64 = 1e4;

/// Origin of the Modified Julian Date, as a Julian date.
const MJD_ZERO_D: f64 = 2_400_000.5;

/// Julian dates within this of that are plausible.
const OUR_TIME_D: f64 = 200_000.0;

/// Longer than profiles like these have been observed (d): 50 years.
pub const LONGEST_D: f64 = 18_262.5;

/// No rotating star is observed with at least this between any two of its profiles (d).
const SPARSEST_D: f64 = 100.0;

/// A gap of this share of the whole span indicates another time system beyond it.
const GAP: f64 = 0.9;

const DAYS_PER_YEAR: f64 = 365.25;
const SECONDS_PER_DAY: f64 = 86_400.0;

/// The error of a list, with its line.
pub(super) type Fault = (usize, String);

/// Checks times and velocities, that there are at least `fewest`, and that no file is listed twice.
///
/// # Errors
/// The first line at fault, with the likely cure.
pub(super) fn check(entries: &[Entry], fewest: usize) -> Result<(), Fault> {
    entries.iter().try_for_each(of_sense)?;
    if let ([only], 2..) = (entries, fewest) {
        let problem = "the only profile of the list: spots and RVs differ only in their variation, list two or more";
        return Err((only.line, problem.into()));
    }
    let mut sorted: Vec<&Entry> = entries.iter().collect();
    sorted.sort_by(|a, b| a.time_d.total_cmp(&b.time_d));
    one_zero_point(&sorted)?;
    in_days(&sorted)?;
    no_file_twice(entries)?;
    no_time_twice(entries)
}

fn of_sense(entry: &Entry) -> Result<(), Fault> {
    let (time, vrad) = (entry.time_d, entry.vrad_kms);
    if time.abs() >= BEYOND_SENSE_D {
        return Err((entry.line, format!("time {time:e} is no time in days; divide seconds by {SECONDS_PER_DAY}")));
    }
    if vrad.abs() >= BEYOND_SENSE_KMS {
        return Err((entry.line, format!("radial velocity {vrad:e} is no velocity in km/s; divide m/s by 1000")));
    }
    Ok(())
}

/// Checks entries sorted by time: no Julian dates mixed with others, no jump of decades.
fn one_zero_point(sorted: &[&Entry]) -> Result<(), Fault> {
    let Some(k) = (1..sorted.len()).max_by(|a, b| gap(sorted, *a).total_cmp(&gap(sorted, *b))) else { return Ok(()) };
    let (first, last) = (sorted[0].time_d, sorted[sorted.len() - 1].time_d);
    if last - first <= LONGEST_D || gap(sorted, k) < GAP * (last - first) {
        return Ok(());
    }
    // those of fewer profiles are named, by the first of them in the list
    let (before, after) = sorted.split_at(k);
    let first_listed = |entries: &[&Entry]| entries.iter().map(|e| (e.line, e.time_d)).min_by_key(|(line, _)| *line);
    let ends = (first_listed(before), first_listed(after));
    let (Some(before_first), Some(after_first)) = ends else { return Ok(()) };
    let late_is_odd = (after.len(), after_first.0) < (before.len(), before_first.0)
        || (after.len() == before.len() && after_first.0 > before_first.0);
    let ((line, time), (other_line, other)) =
        if late_is_odd { (after_first, before_first) } else { (before_first, after_first) };
    let julian = |time: f64| (time - MJD_ZERO_D).abs() < OUR_TIME_D;
    let cure = match julian(time) != julian(other) {
        true => format!("a Julian date beside another count of days; MJD is JD - {MJD_ZERO_D}"),
        false => "another time system, or not days?".into(),
    };
    let years = (time - other).abs() / DAYS_PER_YEAR;
    Err((line, format!("time {time} is {years:.0} years from time {other} in line {other_line}: {cure}")))
}

/// The time from entry `k - 1` to entry `k` (d).
fn gap(sorted: &[&Entry], k: usize) -> f64 {
    sorted[k].time_d - sorted[k - 1].time_d
}

/// Checks entries sorted by time: neither too long nor too sparse for days.
fn in_days(sorted: &[&Entry]) -> Result<(), Fault> {
    let gaps = (1..sorted.len()).map(|k| gap(sorted, k));
    let (sum, least) = (gaps.clone().sum::<f64>(), gaps.filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min));
    let line = sorted.iter().map(|entry| entry.line).min().unwrap_or(0);
    let in_seconds = sum / SECONDS_PER_DAY;
    let cure =
        format!("days are due; if these are seconds ({in_seconds:.3} d in all), divide them by {SECONDS_PER_DAY}");
    if sum > LONGEST_D {
        return Err((line, format!("the times span {:.0} years from here on: {cure}", sum / DAYS_PER_YEAR)));
    }
    if sorted.len() > 2 && least >= SPARSEST_D && least.is_finite() {
        return Err((line, format!("no two of the times are nearer than {least:.0} days to each other: {cure}")));
    }
    Ok(())
}

fn no_file_twice(entries: &[Entry]) -> Result<(), Fault> {
    let mut seen: HashMap<PathBuf, usize> = HashMap::new();
    for entry in entries {
        // a missing file is reported by its reader
        let path = std::fs::canonicalize(&entry.path).unwrap_or_else(|_| entry.path.clone());
        if let Some(line) = seen.insert(path, entry.line) {
            return Err((
                entry.line,
                format!("{} is listed in line {line} already: leave one of them out", entry.file),
            ));
        }
    }
    Ok(())
}

fn no_time_twice(entries: &[Entry]) -> Result<(), Fault> {
    let mut seen: HashMap<u64, &Entry> = HashMap::new();
    for entry in entries {
        // 0 and -0 are the same time
        if let Some(Entry { line, file, time_d, .. }) = seen.insert((entry.time_d + 0.0).to_bits(), entry) {
            let problem = format!(
                "{} has the time {time_d} of {file} in line {line}: is it the same profile? leave one out, or give \
                each \
                 its own time",
                entry.file
            );
            return Err((entry.line, problem));
        }
    }
    Ok(())
}
