//! The text of one profile: the lines before its rows (`layout`), then rows of velocity (km/s), I and its sigma, and
//! unused columns. A profile given as `1 - I` or `I - 1` becomes I (`level`).

use super::axis::Axis;
use super::layout::{Announced, Layout, wrong_count};
use super::level::{self, Given};
use super::row::{Digits, Fault, Row, fault, shown};
use crate::data::io::outweighs;
use crate::data::io::table::{Line, Lines, Separator, has_decimal_comma, number};
use crate::numerics::quantile::middle;
use std::ops::Range;

/// A profile as in its file, on a uniform velocity axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawProfile {
    pub axis: Axis,
    /// I, whatever the file contains.
    pub intensity: Vec<f64>,
    pub sigma: Vec<f64>,
    /// The quantity in the file instead.
    pub given: Given,
    /// Mean profiles in the file, of which this is the first.
    pub profiles: usize,
    /// Whether a column of flags marks some of the bins.
    pub is_flagged: bool,
    /// The unusable bins.
    bad: Vec<(usize, Fault)>,
    /// The range between ends without weight, where uncertainties are extremely large.
    weighty: Range<usize>,
}

/// Smallest standard error and largest numbers that a profile in units of the continuum can have.
const SMALLEST_SIGMA: f64 = 1e-9;
const LARGEST: f64 = 1e6;

/// Uncertainties larger than the median one by this factor mark the ends of a profile as no data.
const WEIGHTLESS: f64 = 100.0;

/// Fewest bins that make a profile.
pub(super) const MIN_BINS: usize = 5;

impl RawProfile {
    /// The bins that can be used: those around a range of velocities (km/s, in the file), or those between bad ends.
    ///
    /// # Errors
    /// A bad bin within the range, or in the middle half of the profile where no range is given.
    pub fn usable(&self, range_kms: Option<(f64, f64)>) -> Result<Range<usize>, Fault> {
        let bins = self.axis.bins;
        let middle = match range_kms {
            None => bins / 4..bins - bins / 4,
            Some((from, to)) => {
                let inside = |j: &usize| (from..=to).contains(&self.axis.at(*j));
                let first = (0..bins).find(inside).unwrap_or(bins / 2);
                first..(first..bins).take_while(inside).last().map_or(first, |last| last + 1)
            }
        };
        if let Some((_, bad)) = self.bad.iter().find(|(bin, _)| middle.contains(bin)) {
            let problem = format!(
                "{}, within the velocity range in use: interpolate the bin, leave the profile out, or narrow \
                 observations.velocity_range_kms",
                bad.problem
            );
            return fault(bad.line, problem);
        }
        let start = self.bad.iter().map(|(bin, _)| bin + 1).filter(|bin| *bin <= middle.start).max().unwrap_or(0);
        let end = self.bad.iter().map(|(bin, _)| *bin).filter(|bin| *bin >= middle.end).min().unwrap_or(bins);
        let weighty = if range_kms.is_none() { self.weighty.clone() } else { 0..bins };
        let (from, to) = (start.max(weighty.start), end.min(weighty.end));
        Ok(if from + MIN_BINS <= to { from..to } else { start..end })
    }
}

/// Reads the text of a profile.
pub(super) fn parse(text: &str) -> Result<RawProfile, Fault> {
    let lines = Lines::of(text);
    let layout = Layout::of(&lines)?;
    if let Some(first) = lines.lines.first().filter(|_| layout.first_row == lines.lines.len()) {
        return no_row(&lines, first.number, first.text);
    }
    let mut rows = rows(&lines.lines[layout.first_row..], &layout)?;
    if rows.windows(2).all(|pair| pair[1].velocity < pair[0].velocity) {
        rows.reverse();
    }
    let axis = Axis::through(&rows)?;
    let flags: Vec<&str> = rows.iter().filter_map(|row| row.flag.as_deref()).collect();
    let mut profile = RawProfile {
        axis,
        intensity: rows.iter().map(|r| r.intensity).collect(),
        sigma: rows.iter().map(|r| r.sigma).collect(),
        given: Given::Intensity,
        profiles: layout.announced.map_or(1, |announced| announced.profiles),
        is_flagged: flags.windows(2).any(|pair| pair[0] != pair[1]),
        bad: Vec::new(),
        weighty: 0..rows.len(),
    };
    let good: Vec<usize> = (0..rows.len()).filter(|j| rows[*j].bad.is_none()).collect();
    if good.len() < MIN_BINS {
        let (line, problem) = rows.iter().find_map(|row| Some((row.line, row.bad.clone()?))).unwrap_or_default();
        return fault(line, problem);
    }
    let numbers: Vec<f64> = good.iter().map(|j| rows[*j].intensity).collect();
    let filled = level::filled(&numbers);
    profile.given = level::given_as(&numbers[filled.clone()]).or_else(|problem| fault(0, problem))?;
    profile.intensity.iter_mut().for_each(|value| *value = profile.given.intensity(*value));
    let is_fill = |j: usize| good.binary_search(&j).is_ok_and(|k| !filled.contains(&k));
    for (j, row) in rows.iter().enumerate() {
        let fill = is_fill(j).then(|| format!("intensity is {} at the end of the profile, no data", row.intensity));
        profile.bad.extend(row.bad.clone().or(fill).map(|problem| (j, Fault { line: row.line, problem })));
    }
    let usual = middle(good.iter().map(|j| rows[*j].sigma).collect());
    let sound = rows.iter().enumerate().filter(|(_, row)| row.bad.is_none());
    profile.bad.extend(sound.filter_map(|(j, row)| {
        let problem = format!("sigma {:e} is {}", row.sigma, outweighs(row.sigma, usual, "bins")?);
        Some((j, Fault { line: row.line, problem }))
    }));
    let most = WEIGHTLESS * usual;
    let weightless = |row: &&Row| row.bad.is_some() || row.sigma > most;
    let start = rows.iter().take_while(weightless).count();
    profile.weighty = start..rows.len() - rows[start..].iter().rev().take_while(weightless).count();
    Ok(profile)
}

/// The error where no line is a row.
fn no_row(lines: &Lines, line: usize, text: &str) -> Result<RawProfile, Fault> {
    let commas = lines.lines.iter().find_map(|line| {
        let by = [Separator::Blanks, Separator::Semicolon].map(|separator| separator.cells(line.text));
        let cell = by.into_iter().filter(|cells| cells.len() > 1).flatten().find(|cell| has_decimal_comma(cell))?;
        Some((line.number, number(cell).err()?))
    });
    match commas {
        Some((line, problem)) => fault(line, problem),
        None => fault(line, format!("no row of numbers (with decimal points) here or below: {}", shown(text))),
    }
}

/// The rows of the first profile, as many as announced; those at its ends without a velocity are left out.
fn rows(lines: &[Line], layout: &Layout) -> Result<Vec<Row>, Fault> {
    let mut rows: Vec<Row> = Vec::new();
    for line in lines {
        match layout.announced {
            Some(Announced { points, profiles, .. }) if rows.len() == points => match profiles {
                1 => return fault(line.number, format!("more rows than the {points} points announced")),
                _ => break,
            },
            _ => rows.push(parse_row(line.number, &layout.separator.cells(line.text), layout)?),
        }
    }
    if let Some(Announced { line, points, .. }) = layout.announced.filter(|announced| rows.len() < announced.points) {
        return fault(line, format!("announces {points} points, but {} rows follow", rows.len()));
    }
    let nowhere = |row: &&Row| row.velocity.is_nan();
    let first = rows.iter().take_while(nowhere).count();
    let last = rows[first..].iter().rev().take_while(nowhere).count();
    let rows: Vec<Row> = rows.drain(first..rows.len() - last).collect();
    match rows.iter().find(|row| !row.velocity.is_finite()) {
        Some(row) => fault(row.line, format!("velocity is {}, not a finite number", row.velocity)),
        _ if rows.len() < MIN_BINS => fault(0, format!("holds {} points, at least {MIN_BINS} are needed", rows.len())),
        _ => Ok(rows),
    }
}

fn parse_row(line: usize, cells: &[&str], layout: &Layout) -> Result<Row, Fault> {
    let columns = layout.columns;
    if cells.len() != columns.count {
        return fault(line, wrong_count(layout, cells));
    }
    let read = |cell: &str| number(cell).or_else(|problem| fault(line, problem));
    if layout.separator == Separator::Blanks {
        // unused cells need only be numbers
        let unused = cells.iter().enumerate().filter(|(column, _)| columns.flag != Some(*column));
        unused.into_iter().try_for_each(|(_, cell)| read(cell).map(drop))?;
    }
    let velocity = read(cells[columns.velocity])?;
    let intensity = read(cells[columns.intensity])?;
    let sigma = read(cells[columns.sigma])?;
    Ok(Row {
        line,
        velocity,
        intensity,
        sigma,
        digits: Digits::of(cells[columns.velocity]),
        flag: columns.flag.map(|column| cells[column].to_owned()),
        bad: bad(intensity, sigma),
    })
}

/// Why numbers of a bin cannot be used.
fn bad(intensity: f64, sigma: f64) -> Option<String> {
    for (name, value) in [("intensity", intensity), ("sigma", sigma)] {
        if !value.is_finite() {
            return Some(format!("{name} is {value}, not a finite number"));
        }
    }
    if sigma <= 0.0 {
        return Some(format!("sigma is {sigma}, it must be above 0"));
    }
    if !(SMALLEST_SIGMA..=LARGEST).contains(&sigma) || intensity.abs() > LARGEST {
        let due = "is not in units of the continuum: divide both by it";
        return Some(format!("intensity {intensity:e} with sigma {sigma:e} {due}"));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(n: usize) -> String {
        (0..n).map(|j| format!("{:.2} 0.9 1e-3\n", -9.0 + 1.8 * j as f64)).collect()
    }

    #[test]
    fn headers_may_be_missing() {
        let bare = parse(&rows(11)).unwrap();
        assert_eq!(bare.axis.bins, 11);
        assert!((bare.axis.step - 1.8).abs() < 1e-12);
        for header in ["title of a star\n", "11 2\n", "***LSD 2014 3\n 11 2\n", "# a b\n\n"] {
            assert_eq!(parse(&format!("{header}{}", rows(11))).unwrap(), bare, "{header:?}");
        }
    }

    #[test]
    fn a_bad_first_row_is_no_title() {
        let text = rows(11).replacen("-9.00", "-9.0o", 1);
        assert_eq!(parse(&text).unwrap_err(), Fault { line: 1, problem: "\"-9.0o\" is not a number".into() });
    }

    #[test]
    fn the_broken_step_is_named() {
        let text = format!("t\n 11 2\n{}", rows(11).replacen("-1.80", "-1.75", 1));
        assert_eq!(parse(&text).unwrap_err().line, 7);
        // A moved last point stretches the mean step; it is still the last line that is named.
        let text = format!("t\n 11 2\n{}", rows(11).replacen("\n9.00", "\n9.50", 1));
        assert_eq!(parse(&text).unwrap_err().line, 13);
    }
}
