//! Light curves: measurements of the star's flux, averaged in few bins and divided into segments, each with its own
//! level and slope, in units of the mean flux of a segment (`docs/method.md` section 9).

mod outliers;

use crate::star::Band;

pub use outliers::{Outliers, outliers};

/// A measurement of the flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flux {
    /// Time (d).
    pub time_d: f64,
    /// Flux, in any units.
    pub flux: f64,
    /// Its standard error, in the same units.
    pub sigma: f64,
}

/// The mean of neighbouring measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluxBin {
    /// Mean time (d).
    pub time_d: f64,
    /// Standard deviation of the times (d).
    pub spread_d: f64,
    /// Mean flux, in units of the mean flux of the segment.
    pub flux: f64,
    /// Its standard error.
    pub sigma: f64,
    /// Number of the segment, from 0.
    pub segment: usize,
    /// Position in the segment: -1 at the start, 1 at the end.
    pub place: f64,
}

/// A light curve.
#[derive(Clone, Debug, PartialEq)]
pub struct LightCurve {
    /// Its name.
    pub name: String,
    /// The photometric band.
    pub band: Band,
    /// The bins, in the order of time.
    pub bins: Vec<FluxBin>,
    /// Number of segments.
    pub segments: usize,
}

/// Bins per rotation, from lossless to the minimum for spots of a quarter of the disc.
const BINS_OF_A_ROTATION: [f64; 5] = [50.0, 36.0, 25.0, 18.0, 12.0];

/// Largest number of bins of all light curves: each is a row of the covariance of the data. Profiles constrain the
/// positions of spots better; light curves constrain their change from rotation to rotation.
pub const MOST_BINS: usize = 200;

/// Width of the bins (d) of light curves, given the times (d) of each, of a star with this rotation period (d): a 1/50
/// of a rotation, or wider where there would be too many bins.
pub fn bin_width_d(times_d: &[Vec<f64>], rotation_period_d: f64) -> f64 {
    let widths = BINS_OF_A_ROTATION.map(|bins| rotation_period_d / bins);
    let count = |width: f64| times_d.iter().map(|times_d| filled(times_d, width)).sum::<usize>();
    widths.into_iter().find(|width| count(*width) <= MOST_BINS).unwrap_or(widths[widths.len() - 1])
}

/// Number of occupied cells of a width (d), counted from the first of these times (d).
fn filled(times_d: &[f64], width_d: f64) -> usize {
    times_d.chunk_by(|a, b| cell(*a, times_d[0], width_d) == cell(*b, times_d[0], width_d)).count()
}

fn cell(time_d: f64, first_d: f64, width_d: f64) -> f64 {
    ((time_d - first_d) / width_d).floor()
}

/// Measurements in the order of time, split where a gap is longer than `gap_d` (d).
fn segments(measured: &[Flux], gap_d: f64) -> impl Iterator<Item = &[Flux]> {
    measured.chunk_by(move |a, b| b.time_d - a.time_d <= gap_d)
}

/// The measurements of a segment in cells of a width (d), counted from the first.
fn cells(segment: &[Flux], width_d: f64) -> impl Iterator<Item = &[Flux]> {
    let of = move |one: &Flux| cell(one.time_d, segment[0].time_d, width_d);
    segment.chunk_by(move |a, b| of(a) == of(b))
}

impl LightCurve {
    /// From measurements in the order of time, in bins of a width (d), with a new segment after each gap that is longer
    /// than `gap_d` (d). Errors of neighbouring measurements are assumed independent.
    pub fn new(name: &str, band: Band, measured: &[Flux], width_d: f64, gap_d: f64) -> Self {
        let mut bins = Vec::new();
        let mut segments = 0;
        for segment in self::segments(measured, gap_d) {
            let mut own: Vec<FluxBin> = cells(segment, width_d).map(|measured| mean(measured, segments)).collect();
            let total: f64 = own.iter().map(|bin| bin.sigma.powi(-2)).sum();
            let level = own.iter().map(|bin| bin.flux * bin.sigma.powi(-2)).sum::<f64>() / total;
            let (first, last) = (own[0].time_d, own[own.len() - 1].time_d);
            let (middle, half) = (0.5 * (first + last), 0.5 * (last - first));
            for bin in &mut own {
                (bin.flux, bin.sigma) = (bin.flux / level, bin.sigma / level);
                bin.place = if half > 0.0 { (bin.time_d - middle) / half } else { 0.0 };
            }
            bins.extend(own);
            segments += 1;
        }
        LightCurve { name: name.into(), band, bins, segments }
    }
}

/// Weighted means, in the order of time, of the measurements in cells of a width (d).
pub fn in_bins(measured: &[Flux], width_d: f64) -> Vec<Flux> {
    let bin = |measured: &[Flux]| {
        let FluxBin { time_d, flux, sigma, .. } = mean(measured, 0);
        Flux { time_d, flux, sigma }
    };
    cells(measured, width_d).map(bin).collect()
}

/// The weighted mean of measurements.
fn mean(measured: &[Flux], segment: usize) -> FluxBin {
    let total: f64 = measured.iter().map(|one| one.sigma.powi(-2)).sum();
    let of = |number: &dyn Fn(&Flux) -> f64| {
        measured.iter().map(|one| number(one) * one.sigma.powi(-2)).sum::<f64>() / total
    };
    // relative to the first, because times are far from 0
    let first = measured[0].time_d;
    let since = of(&|one| one.time_d - first);
    let spread_d = of(&|one| (one.time_d - first - since).powi(2)).sqrt();
    FluxBin {
        time_d: first + since,
        spread_d,
        flux: of(&|one| one.flux),
        sigma: total.sqrt().recip(),
        segment,
        place: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_weighted_means_and_gaps_part_segments() {
        let flux = |time_d: f64, flux: f64, sigma: f64| Flux { time_d, flux, sigma };
        let measured = [
            flux(100.00, 1000.0, 1.0),
            flux(100.02, 1003.0, 2.0),
            flux(100.11, 990.0, 1.0),
            flux(105.00, 500.0, 1.0),
            flux(105.50, 510.0, 1.0),
        ];
        let curve = LightCurve::new("tess", Band::default(), &measured, 0.1, 3.0);
        assert_eq!((curve.segments, curve.bins.len()), (2, 4));
        let first = curve.bins[0];
        // weights 1 and 1/4
        assert!((first.time_d - 100.004).abs() < 1e-9 && (first.spread_d - 0.008).abs() < 1e-9, "{first:?}");
        let mean = (1000.6 * 1.25 + 990.0) / 2.25;
        assert!((first.flux - 1000.6 / mean).abs() < 1e-12);
        assert!((first.sigma - 0.8f64.sqrt() / mean).abs() < 1e-12);
        assert_eq!(curve.bins.iter().map(|bin| bin.segment).collect::<Vec<_>>(), [0, 0, 1, 1]);
        assert_eq!(curve.bins.iter().map(|bin| bin.place).collect::<Vec<_>>(), [-1.0, 1.0, -1.0, 1.0]);
        assert!((curve.bins[2].flux - 500.0 / 505.0).abs() < 1e-12);
    }

    #[test]
    fn bins_are_as_wide_as_their_number_asks_for() {
        let times = |days: f64| (0..(days * 48.0) as usize).map(|k| k as f64 / 48.0).collect::<Vec<f64>>();
        assert_eq!(bin_width_d(&[times(4.0)], 3.0), 3.0 / 50.0);
        assert_eq!(bin_width_d(&[times(20.0)], 3.0), 3.0 / 25.0);
        assert_eq!(bin_width_d(&[times(20.0), times(20.0)], 3.0), 3.0 / 12.0);
        assert_eq!(bin_width_d(&[times(400.0)], 3.0), 3.0 / 12.0);
    }
}
