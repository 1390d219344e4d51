//! Rounded numbers with few significant digits.

/// Rounded to this many decimals.
pub(super) fn rounded(value: f64, decimals: usize) -> f64 {
    // a formatted number parses
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

/// Two digits of a positive number, the last by `round`; a deviation by double rounding is not rounded up or down.
pub(super) fn significant(value: f64, round: impl Fn(f64) -> f64) -> f64 {
    let exponent = value.log10().floor() as i32 - 1;
    let digits = round(rounded(value / 10f64.powi(exponent), 9));
    format!("{digits}e{exponent}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::{rounded, significant};

    #[test]
    fn numbers_are_short() {
        assert_eq!(significant(4.512, f64::ceil), 4.6);
        assert_eq!(significant(0.03, f64::ceil), 0.03);
        assert_eq!(significant(0.1 + 0.2, f64::ceil), 0.3);
        assert_eq!(significant(0.29, f64::floor), 0.29);
        assert_eq!(significant(35.95, f64::floor), 35.0);
        assert_eq!(significant(0.2049, f64::round), 0.2);
        assert_eq!(significant(1.0, f64::ceil), 1.0);
        assert_eq!(rounded(2456894.0001, 3), 2456894.0);
        assert_eq!(rounded(-0.328, 2), -0.33);
    }
}
