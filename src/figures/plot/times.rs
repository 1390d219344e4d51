//! Time axes: days minus a constant, and stretches of time between long gaps, each with a part of the width.

use crate::figures::drawing::Axis;

/// Times below this (d) are written without subtracting a constant.
const SMALL_D: f64 = 1000.0;

/// Julian dates are above this (d).
const JULIAN_D: f64 = 2_400_000.0;

/// The time scale of labels: days minus a constant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clock {
    /// The constant (d).
    pub zero_d: f64,
    /// Label of an axis.
    pub label: String,
}

impl Clock {
    /// The scale for some times (d).
    pub fn of(times_d: impl Iterator<Item = f64>) -> Self {
        let first = times_d.filter(|time| time.is_finite()).fold(f64::INFINITY, f64::min);
        if !first.is_finite() || first < SMALL_D {
            return Clock { zero_d: 0.0, label: "time (d)".into() };
        }
        let zero_d = (first / SMALL_D).floor() * SMALL_D;
        let count = if first > JULIAN_D { "BJD" } else { "time" };
        Clock { zero_d, label: format!("{count} − {zero_d:.0} (d)") }
    }
}

/// Smallest gap (d) that divides an axis, and as a fraction of the total time.
const GAP_D: f64 = 15.0;
const GAP_SHARE: f64 = 0.1;

/// Smallest width of a stretch as a fraction of all of them.
const LEAST: f64 = 0.15;

/// Between stretches on the page (pt).
const BETWEEN: f64 = 9.0;

/// Margin before the first and after the last time of a stretch, as a fraction of its length.
const MARGIN: f64 = 0.04;

/// A stretch of time without a long gap, and its position on the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// First and last time (d), with a margin.
    pub range_d: [f64; 2],
    /// Its left side (pt).
    pub left: f64,
    /// Its width (pt).
    pub width: f64,
}

impl Stretch {
    /// Whether a time is in it.
    pub fn holds(&self, time_d: f64) -> bool {
        (self.range_d[0]..=self.range_d[1]).contains(&time_d)
    }

    /// Its axis with a time scale.
    pub fn axis(&self, clock: &Clock) -> Axis {
        Axis::linear("", self.range_d.map(|time| time - clock.zero_d))
    }
}

/// The stretches of some times, side by side from `left`.
pub(super) fn stretches(times_d: impl Iterator<Item = f64>, left: f64, width: f64) -> Vec<Stretch> {
    let mut times: Vec<f64> = times_d.filter(|time| time.is_finite()).collect();
    times.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return vec![Stretch { range_d: [0.0, 1.0], left, width }];
    };
    let gap = GAP_D.max(GAP_SHARE * (last - first));
    let parts: Vec<[f64; 2]> = times.chunk_by(|a, b| b - a < gap).map(|part| [part[0], part[part.len() - 1]]).collect();
    let longest = parts.iter().map(|[from, to]| to - from).fold(0.0, f64::max);
    // a single night has some length, too
    let room = if longest > 0.0 { MARGIN * longest } else { 0.5 };
    let parts: Vec<[f64; 2]> = parts.into_iter().map(|[from, to]| [from - room, to + room]).collect();
    let free = width - BETWEEN * (parts.len() - 1) as f64;
    let total: f64 = parts.iter().map(|[from, to]| to - from).sum();
    let shares: Vec<f64> =
        parts.iter().map(|[from, to]| ((to - from) / total).max(LEAST.min(0.5 / parts.len() as f64))).collect();
    let sum: f64 = shares.iter().sum();
    let mut at = left;
    let place = |(range_d, share): ([f64; 2], f64)| {
        let stretch = Stretch { range_d, left: at, width: free * share / sum };
        at += stretch.width + BETWEEN;
        stretch
    };
    parts.into_iter().zip(shares).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn julian_dates_are_written_less_a_constant() {
        let label = |time: f64| Clock::of([time + 3.0, time].into_iter()).label;
        assert_eq!(label(2_459_010.2), "BJD − 2459000 (d)");
        assert_eq!(label(59_010.2), "time − 59000 (d)");
        assert_eq!(label(-2.0), "time (d)");
        assert_eq!(Clock::of(std::iter::empty()).zero_d, 0.0);
    }

    #[test]
    fn a_season_is_a_stretch_and_nights_are_not() {
        let nights = (0..15).map(f64::from);
        let one = stretches(nights.clone(), 10.0, 100.0);
        assert_eq!((one.len(), one[0].left, one[0].width), (1, 10.0, 100.0));
        let two = stretches(nights.clone().chain(nights.map(|night| 0.2 * night + 300.0)), 10.0, 100.0);
        assert_eq!(two.len(), 2);
        assert!(two[0].width > 2.0 * two[1].width && two[1].width > 10.0, "{two:?}");
        assert!((two[1].left + two[1].width - 110.0).abs() < 1e-9);
        assert!(two[0].holds(14.0) && !two[0].holds(300.0) && two[1].holds(302.8));
        assert_eq!(stretches([5.0].into_iter(), 0.0, 50.0)[0].range_d, [4.5, 5.5]);
    }
}
