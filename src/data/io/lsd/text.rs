//! The text of one profile: what stands before its rows (`layout`), then rows of velocity (km/s), I and its sigma, and
//! others that are not used. What is given as `1 - I` or `I - 1` becomes I (`level`).

use super::axis::Axis;
use super::layout::{Announced, Layout, Separator, is_comment, wrong_count};
use super::level::{self, Given};
use super::row::{Fault, Row, fault, shown};

/// A profile as it stands in its file, on a uniform velocity axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawProfile {
    pub axis: Axis,
    /// I, whatever the file holds.
    pub intensity: Vec<f64>,
    pub sigma: Vec<f64>,
    /// What the file holds instead.
    pub given: Given,
    /// Mean profiles in the file, of which this is the first.
    pub profiles: usize,
}

/// Smallest standard error and largest numbers that a profile in units of the continuum can have.
const SMALLEST_SIGMA: f64 = 1e-9;
const LARGEST: f64 = 1e6;

/// Fewest bins that make a profile.
pub(super) const MIN_BINS: usize = 5;

/// Reads the text of a profile.
pub(super) fn parse(text: &str) -> Result<RawProfile, Fault> {
    let text = text.trim_start_matches('\u{feff}');
    let filled = text.lines().enumerate().map(|(k, l)| (k + 1, l)).filter(|(_, l)| !l.trim().is_empty());
    let comments: Vec<&str> = filled.clone().map(|(_, l)| l).take_while(|l| is_comment(l)).collect();
    let lines: Vec<(usize, &str)> = filled.filter(|(_, l)| !is_comment(l)).collect();
    let layout = Layout::of(&lines, &comments)?;
    if let Some((line, text)) = lines.first().filter(|_| layout.first_row == lines.len()) {
        return fault(*line, format!("no row of numbers (with decimal points) here or below: {}", shown(text)));
    }
    let rows = rows(&lines[layout.first_row..], &layout)?;
    let mut profile = RawProfile {
        axis: Axis::through(&rows)?,
        intensity: rows.iter().map(|r| r.intensity).collect(),
        sigma: rows.iter().map(|r| r.sigma).collect(),
        given: Given::Intensity,
        profiles: layout.announced.map_or(1, |announced| announced.profiles),
    };
    profile.given = level::given_as(&profile.intensity).or_else(|problem| fault(0, problem))?;
    profile.intensity.iter_mut().for_each(|value| *value = profile.given.intensity(*value));
    Ok(profile)
}

/// The rows of the first profile, as many as are announced.
fn rows(lines: &[(usize, &str)], layout: &Layout) -> Result<Vec<Row>, Fault> {
    let mut rows: Vec<Row> = Vec::new();
    for (line, text) in lines.iter().copied() {
        match layout.announced {
            Some(Announced { points, profiles, .. }) if rows.len() == points => match profiles {
                1 => return fault(line, format!("more rows than the {points} points announced")),
                _ => break,
            },
            _ => rows.push(parse_row(line, &layout.separator.fields(text), layout)?),
        }
    }
    match layout.announced {
        Some(Announced { line, points, .. }) if rows.len() < points => {
            fault(line, format!("announces {points} points, but {} rows follow", rows.len()))
        }
        _ if rows.len() < MIN_BINS => fault(0, format!("holds {} points, at least {MIN_BINS} are needed", rows.len())),
        _ => Ok(rows),
    }
}

fn parse_row(line: usize, fields: &[&str], layout: &Layout) -> Result<Row, Fault> {
    let columns = layout.columns;
    if fields.len() != columns.count {
        return fault(line, wrong_count(layout, fields));
    }
    let number = |field: &str| match field.parse::<f64>() {
        Ok(value) => Ok(value),
        Err(_) => fault(line, format!("{} is not a number", shown(field))),
    };
    if layout.separator == Separator::Blanks {
        // what is not used need only be numbers
        fields.iter().try_for_each(|field| number(field).map(drop))?;
    }
    let velocity = number(fields[columns.velocity])?;
    let intensity = number(fields[columns.intensity])?;
    let sigma = number(fields[columns.sigma])?;
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
