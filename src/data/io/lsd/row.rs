//! A row of a profile, and errors of a line.

pub(super) use crate::data::io::table::shown;

/// The used values of a row.
pub(super) struct Row {
    pub line: usize,
    pub velocity: f64,
    pub intensity: f64,
    pub sigma: f64,
    /// How finely the velocity is printed.
    pub digits: Digits,
    /// Its flag, where there is a column of flags.
    pub flag: Option<String>,
    /// Why the bin is unusable, if it is.
    pub bad: Option<String>,
}

/// The digits that a number is printed with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Digits {
    /// Behind the point; negative where zeros stand before it.
    pub decimals: i32,
    /// From the first that is not 0.
    pub significant: i32,
}

impl Digits {
    /// The digits of a number as written in its file.
    pub fn of(cell: &str) -> Self {
        let (mantissa, exponent) = cell.split_once(['e', 'E', 'd', 'D']).unwrap_or((cell, "0"));
        let exponent = exponent.parse().map_or(0, |exponent: i32| exponent.clamp(-999, 999));
        let decimals = mantissa.split_once('.').map_or(0, |(_, behind)| behind.len() as i32);
        let digits = mantissa.chars().filter(char::is_ascii_digit);
        let significant = digits.skip_while(|digit| *digit == '0').count() as i32;
        Digits { decimals: decimals - exponent, significant }
    }
}

/// The error of a line (counted from 1), or with the file as a whole (line 0).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub line: usize,
    pub problem: String,
}

pub(super) fn fault<T>(line: usize, problem: String) -> Result<T, Fault> {
    Err(Fault { line, problem })
}
