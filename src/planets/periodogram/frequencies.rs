//! The trial periods of a blind search: uniform in frequency, several per peak.
//!
//! A peak is about `1/T` wide, T the time base; ten frequencies per peak lose less than 1 % of its height. The longest
//! period is 2 T, of which the data show half an orbit. Unevenly spaced data have no Nyquist frequency, but searches
//! usually end at a multiple of the average Nyquist frequency `N / (2 T)`: here 5, the custom of Lomb-Scargle codes
//! (VanderPlas 2018, ApJS 236, 16, section 7.1). A gap between seasons counts as at most 60 d in that T. Where profiles
//! are about evenly spaced, the periods shorter than twice the median spacing are mere reflections: the search ends
//! there.

use crate::numerics::quantile::middle;
use serde::{Deserialize, Serialize};

/// The highest frequency, in average Nyquist frequencies.
const NYQUIST_FACTOR: f64 = 5.0;

/// A gap between seasons counts as at most this long (d) in that average: two short seasons far apart constrain short
/// periods no better than each of them.
const LONGEST_GAP_D: f64 = 60.0;

/// Trial frequencies per `1/T`.
const OVERSAMPLING: f64 = 10.0;

/// The longest period, in time bases.
const LONGEST_PERIOD: f64 = 2.0;

/// Upper bound on the number of frequencies.
const MOST_FREQUENCIES: f64 = 1e6;

/// The range to search; `None` follows from the sampling.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrequencySettings {
    /// Shortest period (d).
    pub min_period_d: Option<f64>,
    /// Longest period (d).
    pub max_period_d: Option<f64>,
    /// Frequencies per inverse time base.
    pub oversampling: Option<f64>,
}

/// Trial frequencies, in orbits a rotation cycle, from low to high.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frequencies {
    /// The frequencies, `1 / (Porb/Prot)`.
    pub per_cycle: Vec<f64>,
    /// Time base in rotation cycles.
    pub time_base_cycles: f64,
    /// The rotation period (d).
    pub rotation_period_d: f64,
}

/// Invalid periods, or a sampling that constrains none.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FrequencyError {
    /// Fewer than three different times.
    #[error("an orbit needs profiles at three different times at least, there are {0}")]
    TooFewTimes(usize),
    /// Not a positive number.
    #[error("{name}: must be a positive number, not {value}")]
    NotPositive {
        /// The option.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The shortest is not below the longest.
    #[error("{name}: the shortest period ({min_d} d) must be below the longest ({max_d} d)")]
    Order {
        /// The option at fault.
        name: &'static str,
        /// Shortest period (d).
        min_d: f64,
        /// Longest period (d).
        max_d: f64,
    },
    /// Too many frequencies.
    #[error("{name}: {count:.2e} trial periods, more than a million; search fewer")]
    TooMany {
        /// The option at fault.
        name: &'static str,
        /// Their number.
        count: f64,
    },
}

const MIN: &str = "--min-period-d";
const MAX: &str = "--max-period-d";
const OVER: &str = "--oversampling";

impl Frequencies {
    /// The trial frequencies for profiles at `cycles`, of a star with that rotation period (d).
    ///
    /// # Errors
    /// [`FrequencyError`].
    pub fn new(cycles: &[f64], rotation_period_d: f64, settings: FrequencySettings) -> Result<Self, FrequencyError> {
        let FrequencySettings { min_period_d, max_period_d, oversampling } = settings;
        for (name, value) in [(MIN, min_period_d), (MAX, max_period_d), (OVER, oversampling)] {
            if let Some(value) = value.filter(|x| !(x.is_finite() && *x > 0.0)) {
                return Err(FrequencyError::NotPositive { name, value });
            }
        }
        let longest_gap = LONGEST_GAP_D / rotation_period_d;
        let Sampling { time_base, without_gaps, median_spacing, profiles } = Sampling::of(cycles, longest_gap)?;
        let nyquist = NYQUIST_FACTOR * profiles / (2.0 * without_gaps);
        let shortest = (1.0 / nyquist).max(2.0 * median_spacing);
        let min_d = min_period_d.unwrap_or(shortest * rotation_period_d);
        let max_d = max_period_d.unwrap_or(LONGEST_PERIOD * time_base * rotation_period_d);
        if min_d >= max_d {
            let name = if min_period_d.is_some() { MIN } else { MAX };
            return Err(FrequencyError::Order { name, min_d, max_d });
        }
        let (lo, hi) = (rotation_period_d / max_d, rotation_period_d / min_d);
        let intervals = ((hi - lo) * time_base * oversampling.unwrap_or(OVERSAMPLING)).ceil().max(2.0);
        if intervals >= MOST_FREQUENCIES {
            let name = if min_period_d.is_some() || oversampling.is_none() { MIN } else { OVER };
            return Err(FrequencyError::TooMany { name, count: intervals + 1.0 });
        }
        let frequency = |k| lo + (hi - lo) * k as f64 / intervals;
        let per_cycle = (0..=intervals as usize).map(frequency).collect();
        Ok(Frequencies { per_cycle, time_base_cycles: time_base, rotation_period_d })
    }

    /// Lowest and highest frequency.
    pub fn range(&self) -> (f64, f64) {
        (self.per_cycle[0], self.per_cycle[self.per_cycle.len() - 1])
    }

    /// Distance between neighbours.
    pub fn step(&self) -> f64 {
        let (lo, hi) = self.range();
        (hi - lo) / (self.per_cycle.len() - 1) as f64
    }
}

/// The sampling in time.
struct Sampling {
    time_base: f64,
    without_gaps: f64,
    median_spacing: f64,
    profiles: f64,
}

impl Sampling {
    fn of(cycles: &[f64], longest_gap: f64) -> Result<Self, FrequencyError> {
        let mut times = cycles.to_vec();
        times.sort_by(f64::total_cmp);
        times.dedup();
        if times.len() < 3 {
            return Err(FrequencyError::TooFewTimes(times.len()));
        }
        let spacings: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let time_base = times[times.len() - 1] - times[0];
        let beyond: f64 = spacings.iter().map(|spacing| (spacing - longest_gap).max(0.0)).sum();
        let without_gaps = time_base - beyond;
        let median_spacing = middle(spacings);
        Ok(Sampling { time_base, without_gaps, median_spacing, profiles: times.len() as f64 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn even(n: usize, spacing: f64) -> Vec<f64> {
        (0..n).map(|k| 100.0 + k as f64 * spacing).collect()
    }

    #[test]
    fn even_sampling_ends_at_its_nyquist_frequency() {
        let found = Frequencies::new(&even(31, 0.1), 2.0, FrequencySettings::default()).unwrap();
        let (lo, hi) = found.range();
        assert!((lo - 1.0 / 6.0).abs() < 1e-9 && (hi - 5.0).abs() < 1e-9, "{lo} {hi}");
        assert!(found.step() <= 1.0 / (10.0 * 3.0) && found.step() > 0.99 / (10.0 * 3.0));
        assert!(found.per_cycle.windows(2).all(|f| (f[1] - f[0] - found.step()).abs() < 1e-12));
    }

    /// Nights of many profiles each: the spacing within a night does not set the shortest period, the number of
    /// profiles does.
    #[test]
    fn clumps_are_searched_to_some_average_nyquist_frequencies() {
        let cycles: Vec<f64> = (0..60).map(|k| (k / 10) as f64 + 0.01 * (k % 10) as f64).collect();
        let (_, hi) = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap().range();
        assert!((hi - 5.0 * 60.0 / (2.0 * 5.09)).abs() < 1e-9, "{hi}");
    }

    /// Half a year between two seasons is 60 d, and the time base is unchanged.
    #[test]
    fn seasons_far_apart_are_searched_as_far_as_near_ones() {
        let seasons = |apart: f64| [even(20, 0.5), even(20, 0.5).iter().map(|x| x + apart).collect()].concat();
        let of = |apart| Frequencies::new(&seasons(apart), 3.0, FrequencySettings::default()).unwrap();
        let (near, far) = (of(9.5 + 20.0), of(9.5 + 60.0));
        assert!((near.range().1 - far.range().1).abs() < 1e-9 && far.range().0 < 0.5 * near.range().0);
    }

    #[test]
    fn absurd_values_are_refused_by_name() {
        let fault = |min_period_d, max_period_d, oversampling| {
            let settings = FrequencySettings { min_period_d, max_period_d, oversampling };
            Frequencies::new(&even(31, 0.1), 2.0, settings).unwrap_err().to_string()
        };
        for (text, name) in [
            (fault(Some(f64::NAN), None, None), MIN),
            (fault(Some(0.0), None, None), MIN),
            (fault(None, Some(-1.0), None), MAX),
            (fault(None, None, Some(f64::INFINITY)), OVER),
            (fault(Some(3.0), Some(3.0), None), MIN),
            (fault(None, Some(0.1), None), MAX),
            (fault(Some(1e-6), None, None), MIN),
            (fault(None, None, Some(1e6)), OVER),
        ] {
            assert!(text.starts_with(name), "{text}");
        }
        let few = Frequencies::new(&[1.0, 1.0, 2.0], 1.0, FrequencySettings::default());
        assert_eq!(few, Err(FrequencyError::TooFewTimes(2)));
        assert!(Frequencies::new(&[1.0; 9], 1.0, FrequencySettings::default()).is_err());
    }
}
