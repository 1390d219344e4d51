//! The text of one LSD profile (Donati format): an optional title line, an optional line `npoints ncolumns`, then rows of
//! velocity (km/s) and 2 (I, sigma) or 6 (I, sigma, V, sigma, N, sigma) further columns.
//!
//! Only velocity, I and its sigma are kept; the other columns need only be numbers. Left out: the star's frame and the cut.

/// A profile as it stands in its file, on a uniform velocity axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawProfile {
    pub axis: Axis,
    pub intensity: Vec<f64>,
    pub sigma: Vec<f64>,
}

/// A uniform velocity axis (km/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub first: f64,
    pub step: f64,
    pub bins: usize,
}

impl Axis {
    /// Velocity of bin `j`.
    pub fn at(&self, j: usize) -> f64 {
        self.first + j as f64 * self.step
    }

    /// Whether both ends agree within 1 % of a step.
    pub fn agrees_with(&self, other: &Axis) -> bool {
        let close = |a: f64, b: f64| (a - b).abs() <= UNIFORMITY * self.step;
        self.bins == other.bins
            && close(self.first, other.first)
            && close(self.at(self.bins - 1), other.at(other.bins - 1))
    }
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bins from {:.3} km/s in steps of {:.4}", self.bins, self.first, self.step)
    }
}

/// What is wrong with a line (counted from 1), or with the file as a whole (line 0).
#[derive(Debug, PartialEq)]
pub(super) struct Fault {
    pub line: usize,
    pub problem: String,
}

/// Smallest standard error and largest numbers that a profile in units of the continuum can have.
const SMALLEST_SIGMA: f64 = 1e-9;
const LARGEST: f64 = 1e6;

/// How far a point may be off the uniform axis, in steps.
const UNIFORMITY: f64 = 0.01;

/// Fewest bins that make a profile.
pub(super) const MIN_BINS: usize = 5;

struct Row {
    line: usize,
    velocity: f64,
    intensity: f64,
    sigma: f64,
}

/// Reads the text of a profile.
pub(super) fn parse(text: &str) -> Result<RawProfile, Fault> {
    let mut lines = text.lines().enumerate().map(|(k, l)| (k + 1, l)).filter(|(_, l)| !l.trim().is_empty()).peekable();
    let counts_follow = lines.clone().nth(1).is_some_and(|(_, line)| counts(line).is_some());
    lines.next_if(|(_, line)| counts_follow || is_title(line));
    let announced = match lines.peek().and_then(|(line, text)| Some((*line, counts(text)?))) {
        Some((line, (points, columns))) => {
            lines.next();
            if columns != 2 && columns != 6 {
                return fault(line, format!("announces {columns} columns after the velocity, not 2 or 6"));
            }
            Some((line, points, columns + 1))
        }
        None => None,
    };
    let mut columns = announced.map(|(_, _, columns)| columns);
    let mut rows: Vec<Row> = Vec::new();
    for (line, text) in lines {
        if let Some((_, points, _)) = announced.filter(|(_, points, _)| rows.len() == *points) {
            return fault(line, format!("more rows than the {points} points announced"));
        }
        let fields: Vec<&str> = text.split_whitespace().collect();
        rows.push(parse_row(line, &fields, *columns.get_or_insert(if fields.len() == 7 { 7 } else { 3 }))?);
    }
    match announced {
        Some((line, points, _)) if rows.len() < points => {
            fault(line, format!("announces {points} points, but {} rows follow", rows.len()))
        }
        _ if rows.len() < MIN_BINS => fault(0, format!("holds {} points, at least {MIN_BINS} are needed", rows.len())),
        _ => Ok(RawProfile {
            axis: uniform_axis(&rows)?,
            intensity: rows.iter().map(|r| r.intensity).collect(),
            sigma: rows.iter().map(|r| r.sigma).collect(),
        }),
    }
}

fn fault<T>(line: usize, problem: String) -> Result<T, Fault> {
    Err(Fault { line, problem })
}

/// A first line without `npoints ncolumns` after it is a title unless it reads as numbers; one with the columns of a row and
/// a single bad number is a bad row.
fn is_title(line: &str) -> bool {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let bad = fields.iter().filter(|f| f.parse::<f64>().is_err()).count();
    bad > if matches!(fields.len(), 3 | 7) { 1 } else { 0 }
}

/// The two whole numbers of a line `npoints ncolumns`.
fn counts(line: &str) -> Option<(usize, usize)> {
    let mut fields = line.split_whitespace().map(|f| f.parse().ok());
    match (fields.next(), fields.next(), fields.next()) {
        (Some(points), Some(columns), None) => Some((points?, columns?)),
        _ => None,
    }
}

fn parse_row(line: usize, fields: &[&str], columns: usize) -> Result<Row, Fault> {
    if fields.len() != columns {
        return fault(line, format!("{} columns instead of {columns}", fields.len()));
    }
    let mut numbers = [0.0; 7];
    for (number, field) in numbers.iter_mut().zip(fields) {
        match field.parse::<f64>() {
            Ok(value) => *number = value,
            Err(_) => return fault(line, format!("{} is not a number", shown(field))),
        }
    }
    let [velocity, intensity, sigma, ..] = numbers;
    for (name, value) in [("velocity", velocity), ("intensity", intensity), ("sigma", sigma)] {
        if !value.is_finite() {
            return fault(line, format!("{name} is {value}, not a finite number"));
        }
    }
    if sigma <= 0.0 {
        return fault(line, format!("sigma is {sigma}, it must be above 0"));
    }
    if !(SMALLEST_SIGMA..=LARGEST).contains(&sigma) || intensity.abs() > LARGEST {
        return fault(line, format!("intensity {intensity:e} with sigma {sigma:e} is not in units of the continuum"));
    }
    Ok(Row { line, velocity, intensity, sigma })
}

/// A piece of the user's text, quoted, escaped and cut to a length that keeps a message on one line.
pub(super) fn shown(text: &str) -> String {
    let short: String = text.chars().take(40).collect();
    format!("{short:?}")
}

/// The axis through the first and last point, if every point lies on it.
fn uniform_axis(rows: &[Row]) -> Result<Axis, Fault> {
    if let Some(pair) = rows.windows(2).find(|p| p[1].velocity <= p[0].velocity) {
        let (before, here) = (pair[0].velocity, pair[1].velocity);
        return fault(pair[1].line, format!("velocity {here} km/s does not increase from {before}"));
    }
    let first = rows[0].velocity;
    let axis =
        Axis { first, step: (rows[rows.len() - 1].velocity - first) / (rows.len() - 1) as f64, bins: rows.len() };
    let deviation = |j: usize| (rows[j].velocity - axis.at(j)).abs() / axis.step;
    // Written so that a NaN (from velocities near the end of the range of doubles) is a fault too.
    if (0..rows.len()).all(|j| deviation(j) <= UNIFORMITY) {
        return Ok(axis);
    }
    // The culprit is the first point that breaks the usual step; where none does, the axis drifts and its worst point is named.
    let mut steps: Vec<f64> = rows.windows(2).map(|p| p[1].velocity - p[0].velocity).collect();
    let breaks = |usual: f64| steps.iter().position(|s| (s - usual).abs() > UNIFORMITY * usual).map(|j| j + 1);
    let mut sorted = steps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let worst = || (0..rows.len()).max_by(|a, b| deviation(*a).total_cmp(&deviation(*b))).unwrap_or(0);
    let j = breaks(usual).unwrap_or_else(worst);
    let step = steps.swap_remove(j.max(1) - 1);
    fault(rows[j].line, format!("velocity axis is not uniform: a step of {step:.6} km/s where {usual:.6} is usual"))
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
