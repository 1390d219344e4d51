//! The window function of the sampling, and peaks that it makes aliases of the highest.
//!
//! `W(f) = |sum_k exp(2 pi i f E_k)|^2 / N^2` is 1 where all profiles sample an orbit of that frequency at the same
//! phase. A strong peak of it at F makes orbits of frequency f and of `F - f`, `F + f` or `f - F` look alike (Dawson &
//! Fabrycky 2010).

use super::frequencies::Frequencies;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A window peak of at least this height makes aliases.
const STRONG: f64 = 0.25;

/// Samples of the window per inverse time base.
const SAMPLES: f64 = 10.0;

/// Frequencies closer than this many inverse time bases are the same.
pub(super) const SAME: f64 = 0.5;

/// Whether two frequencies are unresolved by a time base.
pub fn is_same_frequency(one: f64, other: f64, time_base_cycles: f64) -> bool {
    (one - other).abs() * time_base_cycles < SAME
}

/// A peak of the window function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowPeak {
    /// Frequency (inverse rotation cycles).
    pub frequency: f64,
    /// Height, 1 at most.
    pub height: f64,
}

/// How a frequency is the alias of another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alias {
    /// The peak of the window function that joins them.
    pub window: WindowPeak,
    /// Whether the two frequencies add up to that of the window; otherwise they differ by it.
    pub mirrored: bool,
}

/// The window function at `frequency` (inverse rotation cycles).
pub fn window(cycles: &[f64], frequency: f64) -> f64 {
    let angle = |cycle: &f64| (TAU * frequency * cycle).sin_cos();
    let (sin, cos) = cycles.iter().map(angle).fold((0.0, 0.0), |(s, c), (ds, dc)| (s + ds, c + dc));
    (sin * sin + cos * cos) / (cycles.len() as f64).powi(2)
}

/// Strong peaks of the window function up to the sum of any two of the `frequencies`, except at frequencies so low that
/// they join unresolved ones.
pub fn window_peaks(cycles: &[f64], frequencies: &Frequencies) -> Vec<WindowPeak> {
    let base = frequencies.time_base_cycles;
    let last = 2.0 * frequencies.range().1 + SAME / base;
    let step = 1.0 / (SAMPLES * base);
    let samples = (last / step).ceil() as usize + 1;
    let heights: Vec<f64> = (0..samples).into_par_iter().map(|k| window(cycles, k as f64 * step)).collect();
    let is_peak = |k: &usize| heights[*k] >= heights[k - 1] && heights[*k] > heights[k + 1];
    (1..samples - 1)
        .filter(is_peak)
        .map(|k| WindowPeak { frequency: k as f64 * step, height: heights[k] })
        .filter(|peak| peak.height >= STRONG && peak.frequency > SAME / base)
        .collect()
}

/// How `frequency` is an alias of `of`, within `within`, if it is; by the strongest window peak that joins them.
pub fn alias(frequency: f64, of: f64, peaks: &[WindowPeak], within: f64) -> Option<Alias> {
    let joins = |peak: &WindowPeak| {
        let fits = |f: f64| (f - peak.frequency).abs() < within;
        match (fits((frequency - of).abs()), fits(frequency + of)) {
            (true, _) => Some(Alias { window: *peak, mirrored: false }),
            (false, true) => Some(Alias { window: *peak, mirrored: true }),
            (false, false) => None,
        }
    };
    peaks.iter().filter_map(joins).max_by(|a, b| a.window.height.total_cmp(&b.window.height))
}

#[cfg(test)]
mod tests {
    use super::super::frequencies::FrequencySettings;
    use super::*;

    #[test]
    fn one_observation_a_day_reflects_frequencies_at_one_a_day() {
        let cycles: Vec<f64> = (0..25).map(|k| k as f64 + 0.02 * (k as f64 * 1.7).sin()).collect();
        let settings = FrequencySettings { min_period_d: Some(0.8), ..FrequencySettings::default() };
        let frequencies = Frequencies::new(&cycles, 1.0, settings).unwrap();
        let peaks = window_peaks(&cycles, &frequencies);
        assert!(peaks.iter().all(|p| (p.frequency - p.frequency.round()).abs() < 0.01), "{peaks:?}");
        assert_eq!(peaks.len(), 2, "once and twice a day: {peaks:?}");
        let mirrored = |f: f64| alias(f, 0.3, &peaks, SAME / 24.0).map(|alias| alias.mirrored);
        assert_eq!(mirrored(0.7), Some(true));
        assert_eq!(mirrored(1.3), Some(false));
        assert_eq!(mirrored(0.5), None);
        assert_eq!(mirrored(0.31), None);
    }
}
