//! Checks that several sections share.

use crate::data::config::error::Fault;
use crate::data::config::written::Automatic;
pub(super) use crate::model::parameters::most;
use crate::surface::nuisances::LineAndContinuum;

/// Fewest and most pixels of an image or a simulated star.
pub(super) const PIXELS: std::ops::RangeInclusive<usize> = 100..=2_000_000;

/// Longest name of a set.
const LONGEST_NAME: usize = 40;

/// RV offsets or RV jitter above this (km/s) are mistakes: profiles would show the wrong part of a line.
const LARGEST_ZERO_POINT_KMS: f64 = 100.0;

/// Keys of line and continuum.
pub(super) const NUISANCES: [&str; 3] = ["continuum_offset", "continuum_slope", "equivalent_width"];

/// Standard deviations of line and continuum, below `at`: more than ten times the continuum is a mistake.
pub(super) fn check_nuisances(at: &str, names: [&str; 3], priors: &LineAndContinuum) -> Result<(), Fault> {
    names.iter().zip(priors.numbers()).try_for_each(|(name, sd)| within(&format!("{at}.{name}"), sd, [0.0, 10.0]))
}

/// An RV offset (km/s).
pub(super) fn check_zero_point(key: &str, kms: f64) -> Result<(), Fault> {
    check_kms(key, kms, -LARGEST_ZERO_POINT_KMS)
}

/// The RV jitter (km/s).
pub(super) fn check_jitter(key: &str, kms: f64) -> Result<(), Fault> {
    check_kms(key, kms, 0.0)
}

fn check_kms(key: &str, kms: f64, least: f64) -> Result<(), Fault> {
    match (least..=LARGEST_ZERO_POINT_KMS).contains(&kms) {
        true => Ok(()),
        false => Err(Fault::new(key, format!("{kms} must be from {least} to {LARGEST_ZERO_POINT_KMS} km/s"))),
    }
}

pub(super) fn check_pixels(key: &str, pixels: usize) -> Result<(), Fault> {
    match PIXELS.contains(&pixels) {
        true => Ok(()),
        false => Err(Fault::new(key, format!("{pixels} must be from {} to {}", PIXELS.start(), PIXELS.end()))),
    }
}

/// Whether the absolute value of a number is at most `most`.
pub(super) fn check_size(key: &str, value: f64, most: f64) -> Result<(), Fault> {
    match value.abs() <= most {
        true => Ok(()),
        false => Err(Fault::new(key, format!("{value} must be from -{most:e} to {most:e}"))),
    }
}

pub(super) fn positive(key: &str, value: f64) -> Result<(), Fault> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(Fault::new(key, format!("{value} must be above 0"))) }
}

/// Positive, or left to the observations.
pub(super) fn automatic(key: &str, value: Automatic) -> Result<(), Fault> {
    match value {
        Automatic::Number(value) => positive(key, value),
        Automatic::Word(_) => Ok(()),
    }
}

pub(super) fn within(key: &str, value: f64, [low, high]: [f64; 2]) -> Result<(), Fault> {
    match (low..=high).contains(&value) {
        true => Ok(()),
        false => Err(Fault::new(key, format!("{value} must be from {low} to {high}"))),
    }
}

/// Windows of time `[start, end]` (d) at `key`.
pub(super) fn check_windows(windows: &[[f64; 2]], key: &str) -> Result<(), Fault> {
    for (k, [start, end]) in windows.iter().enumerate() {
        let key = format!("{key}[{k}]");
        check_size(&key, *start, most::TIME)?;
        check_size(&key, *end, most::TIME)?;
        if start >= end {
            return Err(Fault::new(key, format!("the start {start} must be before the end {end}")));
        }
    }
    Ok(())
}

/// Endings of the files that are written beside folders of such names.
const FILES: [&str; 4] = [".json", ".csv", ".txt", ".prof"];

/// Names are folders and files of `simulate`, and labels: of items at these keys with these names.
pub(super) fn names(all: &[(&str, &str)]) -> Result<(), Fault> {
    for (s, (key, name)) in all.iter().enumerate() {
        let fault = |problem: String| Err(Fault::new(format!("{key}.name"), problem));
        let plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
        if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(plain) || name.starts_with('.') {
            let problem = format!("{name:?} must be 1 to {LONGEST_NAME} letters, digits, '-', '_' or '.'");
            return fault(problem);
        }
        if let Some(ending) = FILES.iter().find(|ending| name.to_ascii_lowercase().ends_with(**ending)) {
            return fault(format!(
                "{name:?} ends like a file, and names a folder or the file {name}.csv: leave {ending} out"
            ));
        }
        if let Some((other, _)) = all[..s].iter().find(|(_, other)| other.eq_ignore_ascii_case(name)) {
            return fault(format!("{name:?} is the name of {other} already: each needs its own"));
        }
    }
    Ok(())
}
