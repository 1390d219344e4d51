//! One number, in the formats of other programs.

use super::shown;
use std::borrow::Cow;

/// Typographic minus signs: minus, en dash, full-width minus.
const MINUS: [char; 3] = ['\u{2212}', '\u{2013}', '\u{ff0d}'];

/// Markers of missing numbers, in lower case.
const MISSING: [&str; 8] = ["", "null", "none", "na", "n/a", "masked", "missing", "blank"];

/// The number in a cell; NaN for a marker of a missing number (an empty cell, `--`, `null`, ... or the `***` of
/// Fortran). Exponents may be Fortran's (`1.5D+01`), and a minus that of print (U+2212).
///
/// # Errors
/// Text that is not a number, quoted; a decimal comma is named.
pub fn number(cell: &str) -> Result<f64, String> {
    let cell = cell.trim();
    if let Ok(number) = cell.parse() {
        return Ok(number);
    }
    if is_missing(cell) {
        return Ok(f64::NAN);
    }
    let mut plain = Cow::Borrowed(cell);
    if plain.contains(MINUS) {
        plain = Cow::Owned(plain.replace(MINUS, "-"));
    }
    if plain.contains(['D', 'd']) && plain.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) {
        plain = Cow::Owned(plain.replacen(['D', 'd'], "e", 1));
    }
    plain.parse().map_err(|_| match has_decimal_comma(cell) {
        true => format!("{} has a decimal comma: write numbers with decimal points", shown(cell)),
        false => format!("{} is not a number", shown(cell)),
    })
}

/// Whether a cell is a marker of a missing number.
pub fn is_missing(cell: &str) -> bool {
    is_dashes(cell) || cell.bytes().all(|b| b == b'*') || MISSING.contains(&cell.to_lowercase().as_str())
}

/// Whether a cell is a rule of dashes, as under the names of an `.rdb`.
pub fn is_dashes(cell: &str) -> bool {
    !cell.is_empty() && cell.bytes().all(|b| b == b'-')
}

/// Whether a cell reads as a number with its comma replaced by a point.
pub fn has_decimal_comma(cell: &str) -> bool {
    let is_number = |text: &str| {
        let text = text.replace(MINUS, "-").replacen(['D', 'd'], "e", 1);
        text.parse::<f64>().is_ok()
    };
    match cell.split_once(',') {
        Some((whole, part)) => part.starts_with(|c: char| c.is_ascii_digit()) && is_number(&format!("{whole}.{part}")),
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_other_programs() {
        let all = [("-5.04D+01", -50.4), ("1.0d-3", 1e-3), ("\u{2212}50.4", -50.4), ("2.5e\u{2212}3", 2.5e-3)];
        for (cell, value) in all.into_iter().chain([(" +.5 ", 0.5), ("12", 12.0), ("-1.", -1.0)]) {
            assert_eq!(number(cell), Ok(value), "{cell:?}");
        }
    }

    #[test]
    fn what_is_missing_is_no_fault() {
        for cell in ["", "nan", "NaN", "--", "null", "N/A", "*******", "None"] {
            assert!(number(cell).unwrap().is_nan(), "{cell:?}");
        }
    }

    #[test]
    fn decimal_commas_are_named() {
        for cell in ["-50,4", "0,001", "1,5e-3", "\u{2212}1,0"] {
            assert!(number(cell).unwrap_err().contains("decimal comma"), "{cell:?}");
        }
        for (cell, shown) in [("9.0o", "\"9.0o\""), ("-,5-", "\"-,5-\""), ("dd", "\"dd\"")] {
            assert_eq!(number(cell).unwrap_err(), format!("{shown} is not a number"));
        }
    }
}
