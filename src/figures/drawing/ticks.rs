//! Positions and labels of ticks: steps of 1, 2 or 5 times a power of ten, or decades.

use super::Scale;

/// Ticks of an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Ticks {
    /// Values with their labels.
    pub major: Vec<(f64, String)>,
    /// Values without a label, for lack of space.
    pub silent: Vec<f64>,
    /// Values between them.
    pub minor: Vec<f64>,
}

impl Ticks {
    /// The same with only those labels that have space according to `has_room`.
    pub fn with(self, has_room: impl Fn(f64, &str) -> bool) -> Self {
        let (major, left): (Vec<_>, Vec<_>) = self.major.into_iter().partition(|(value, text)| has_room(*value, text));
        let silent = self.silent.into_iter().chain(left.into_iter().map(|(value, _)| value)).collect();
        Ticks { major, silent, minor: self.minor }
    }
}

/// Ticks between the ends of `range`, about `most` of them with a number.
pub(super) fn ticks(range: [f64; 2], scale: Scale, most: usize) -> Ticks {
    if range.iter().any(|end| end.is_nan()) {
        return Ticks::default();
    }
    let (low, high) = (range[0].min(range[1]), range[0].max(range[1]));
    match scale {
        Scale::Linear => linear(low, high, most),
        Scale::Log => logarithmic(low, high, most),
    }
}

/// The smallest step of 1, 2 or 5 times a power of ten of which no more than `most` fit.
fn step(extent: f64, most: usize) -> (f64, i32) {
    let least = extent / most.max(1) as f64;
    let power = least.log10().floor() as i32;
    let unit = 10f64.powi(power);
    let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * unit >= least * (1.0 - 1e-9)).unwrap_or(10.0);
    (factor * unit, if factor == 10.0 { power + 1 } else { power })
}

fn linear(low: f64, high: f64, most: usize) -> Ticks {
    if !(high > low && (high - low).is_finite()) {
        return Ticks { major: vec![(low, format!("{low}"))], ..Ticks::default() };
    }
    let (step, power) = step(high - low, most);
    let decimals = (-power).max(0) as usize;
    let within = |step: f64| {
        // a rounding error must not remove the tick at an end
        let slack = 1e-9 * (high - low);
        let (first, last) = (((low - slack) / step).ceil() as i64, ((high + slack) / step).floor() as i64);
        (first..=last).map(move |k| (k, k as f64 * step))
    };
    let text = |value: f64| {
        // no negative zero
        let value = if value.abs() < 1e-9 * step { 0.0 } else { value };
        format!("{value:.decimals$}")
    };
    let parts = if (step / 10f64.powi(power)).round() == 2.0 { 4 } else { 5 };
    let minor = within(step / f64::from(parts)).filter(|(k, _)| k % i64::from(parts) != 0);
    Ticks {
        major: within(step).map(|(_, value)| (value, text(value))).collect(),
        silent: Vec::new(),
        minor: minor.map(|(_, x)| x).collect(),
    }
}

fn logarithmic(low: f64, high: f64, most: usize) -> Ticks {
    // avoids an infinite number of decades
    if !(low > 0.0 && high.is_finite()) {
        return Ticks::default();
    }
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let inside = |value: &f64| (low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(value);
    let multiples = |factors: &'static [f64]| {
        (first..=last).flat_map(move |power| factors.iter().map(move |f| f * 10f64.powi(power))).filter(inside)
    };
    // the densest of these that is not too dense
    const DENSITIES: [&[f64]; 4] = [&[1.0, 2.0, 3.0, 5.0, 7.0], &[1.0, 2.0, 5.0], &[1.0, 3.0], &[1.0]];
    let factors = DENSITIES.into_iter().find(|factors| multiples(factors).count() <= most).unwrap_or(&[1.0]);
    let major: Vec<f64> = multiples(factors).collect();
    // within less than a decade there may be hardly any of these: then round numbers at equal steps
    if major.len() < 2 && high > low && high < 10.0 * low {
        return linear(low, high, most);
    }
    let all = multiples(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
    let minor = all.filter(|x| major.iter().all(|m| (m / x - 1.0).abs() > 1e-6)).collect();
    let text = |value: f64| match value {
        value if (1e-3..1e5).contains(&value) => {
            let decimals = (-value.log10().floor()).max(0.0) as usize;
            format!("{value:.decimals$}")
        }
        value => {
            let power = value.log10().floor();
            let factor = (value / 10f64.powf(power)).round();
            if factor == 1.0 { format!("10^{{{power}}}") } else { format!("{factor}·10^{{{power}}}") }
        }
    };
    Ticks { major: major.into_iter().map(|value| (value, text(value))).collect(), silent: Vec::new(), minor }
}

/// A range that contains all finite `values` with a margin of `share` of their extent to either side; for a logarithmic
/// scale of positive values only, with the margin in the logarithm.
pub fn range_of(values: impl Iterator<Item = f64>, scale: Scale, share: f64) -> [f64; 2] {
    let log = scale == Scale::Log;
    let values = values.filter(|x| x.is_finite() && (!log || *x > 0.0)).map(|x| if log { x.ln() } else { x });
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
    let [low, high] = match high - low {
        extent if extent > 0.0 => [low - share * extent, high + share * extent],
        0.0 if log => [low - 1.0, high + 1.0],
        0.0 => {
            let margin = if low == 0.0 { 1.0 } else { 0.1 * low.abs() };
            [low - margin, high + margin]
        }
        // no values
        _ => [0.0, 1.0],
    };
    if log { [low.exp(), high.exp()] } else { [low, high] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(range: [f64; 2], scale: Scale, most: usize) -> Vec<String> {
        ticks(range, scale, most).major.into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn steps_are_round_and_ends_are_kept() {
        assert_eq!(texts([0.0, 0.3], Scale::Linear, 4), ["0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(texts([-0.05, 0.05], Scale::Linear, 5), ["-0.04", "-0.02", "0.00", "0.02", "0.04"]);
        assert_eq!(texts([1.0, 0.0], Scale::Linear, 2), ["0.0", "0.5", "1.0"]);
        assert_eq!(texts([980.0, 1020.0], Scale::Linear, 4), ["980", "990", "1000", "1010", "1020"]);
        assert_eq!(texts([1.0, 1000.0], Scale::Log, 4), ["1", "10", "100", "1000"]);
        assert_eq!(texts([0.4, 12.0], Scale::Log, 6), ["0.5", "1", "2", "5", "10"]);
        assert_eq!(texts([1.6, 1.9], Scale::Log, 4), ["1.6", "1.7", "1.8", "1.9"]);
        for range in [[0.0, 1.0], [1.0, f64::INFINITY], [-1.0, 1.0], [f64::NAN, 1.0]] {
            assert!(texts(range, Scale::Log, 4).is_empty(), "{range:?}");
        }
        assert_eq!(texts([1e-8, 1e-6], Scale::Log, 3), ["10^{-8}", "10^{-7}", "10^{-6}"]);
    }

    #[test]
    fn a_range_holds_what_is_there() {
        assert_eq!(range_of([1.0, f64::NAN, 3.0].into_iter(), Scale::Linear, 0.5), [0.0, 4.0]);
        assert_eq!(range_of([2.0, 2.0].into_iter(), Scale::Linear, 0.1), [1.8, 2.2]);
        assert_eq!(range_of(std::iter::empty(), Scale::Linear, 0.1), [0.0, 1.0]);
        let [low, high] = range_of([0.0, 1.0, 100.0].into_iter(), Scale::Log, 0.0);
        assert!((low - 1.0).abs() < 1e-12 && (high - 100.0).abs() < 1e-9);
    }
}
