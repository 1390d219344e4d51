//! The quantity in a profile: the intensity I in units of the continuum, or the depth of the line, `1 - I` (as LSD
//! solves for it) or `I - 1`. It is recognised by the continuum at both ends, which is near 1 or near 0, and by the
//! sign of the line.

use std::ops::Range;

/// The quantity in the column of intensities.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Given {
    /// I.
    Intensity,
    /// 1 - I: the continuum is at 0, the line above it.
    Depth,
    /// I - 1: the continuum is at 0, the line below it.
    Excess,
}

/// A continuum within this of 0 is not that of I.
const NEAR_ZERO: f64 = 0.2;

/// Share of the bins at either end that count as continuum, and the width of a running mean.
const ENDS: f64 = 0.1;
const SMOOTHED: f64 = 0.05;

/// The signal on the opposite side of the continuum over that of the line: below this it is noise or blends, above this
/// the profile is a Stokes V or a null.
const ONE_SIDED: f64 = 0.5;

/// Which of these numbers are data: those between zeros, and numbers below, that fill the ends of a profile of I. A
/// profile of `1 - I` or `I - 1` ends at 0 by right: there the line, not the continuum, is away from it.
pub(super) fn filled(numbers: &[f64]) -> Range<usize> {
    let fill = |value: &&f64| **value <= 0.0;
    let first = numbers.iter().take_while(fill).count();
    let last = numbers.len() - numbers.iter().rev().take_while(fill).count();
    if last < first + FEWEST || last - first == numbers.len() {
        return 0..numbers.len();
    }
    let inner = &numbers[first..last];
    let (continuum, mean) = (at_the_ends(inner), inner.iter().sum::<f64>() / inner.len() as f64);
    if continuum > NEAR_ZERO && continuum >= mean { first..last } else { 0..numbers.len() }
}

/// Fewest numbers that are a profile with filled ends.
const FEWEST: usize = 5;

/// Median of the numbers at both ends.
pub(super) fn at_the_ends(numbers: &[f64]) -> f64 {
    let bins = numbers.len();
    let end = ((ENDS * bins as f64) as usize).max(2).min(bins);
    let mut ends: Vec<f64> = numbers[..end].iter().chain(&numbers[bins - end..]).copied().collect();
    ends.sort_by(f64::total_cmp);
    0.5 * (ends[(ends.len() - 1) / 2] + ends[ends.len() / 2])
}

/// The quantity given by these numbers.
///
/// # Errors
/// A continuum at 0 with as much above as below it.
pub(super) fn given_as(numbers: &[f64]) -> Result<Given, String> {
    let bins = numbers.len();
    let continuum = at_the_ends(numbers);
    if continuum.abs() > NEAR_ZERO {
        return match continuum > 0.0 {
            true => Ok(Given::Intensity),
            false => Err(format!("the continuum is at {continuum:.3}: I in units of the continuum is due")),
        };
    }
    let window = ((SMOOTHED * bins as f64) as usize).max(1);
    let means = numbers.windows(window).map(|w| w.iter().sum::<f64>() / window as f64 - continuum);
    let (below, above) = means.fold((0.0f64, 0.0f64), |(low, high), mean| (low.max(-mean), high.max(mean)));
    match (below < ONE_SIDED * above, above < ONE_SIDED * below) {
        (true, _) => Ok(Given::Depth),
        (_, true) => Ok(Given::Excess),
        _ => Err("the continuum is at 0, with as much above as below it: is it Stokes V or a null? I in units of the \
                  continuum is due"
            .into()),
    }
}

impl Given {
    /// I.
    pub fn intensity(self, value: f64) -> f64 {
        match self {
            Given::Intensity => value,
            Given::Depth => 1.0 - value,
            Given::Excess => 1.0 + value,
        }
    }

    /// The remark on it.
    pub fn remark(self) -> &'static str {
        match self {
            Given::Intensity => "given as I",
            Given::Depth => "given as 1 - I (continuum at 0, line above it), turned into I",
            Given::Excess => "given as I - 1 (continuum at 0, line below it), turned into I",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_data_of_depths_alone() {
        let line = |j: usize| 0.4 * (-((j as f64 - 20.0) / 6.0).powi(2)).exp();
        let with_zeros = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..41).map(|j| if (3..38).contains(&j) { value(j) } else { 0.0 }).collect()
        };
        assert_eq!(filled(&with_zeros(&|j| 1.0 - line(j))), 3..38);
        assert_eq!(filled(&with_zeros(&|j| 100.0 - 100.0 * line(j))), 3..38);
        assert_eq!(filled(&with_zeros(&line)), 0..41);
        assert_eq!(filled(&with_zeros(&|j| -line(j))), 0..41);
        assert_eq!(filled(&(0..41).map(|j| 1.0 - line(j)).collect::<Vec<_>>()), 0..41);
    }
}
