//! Statistics of one parameter's draws: shortest intervals, mode, and the unwrapping of a periodic one.
//!
//! The mode is that of a kernel density estimate: a histogram smoothed by a Gaussian of Silverman's width for the
//! *effective* number of draws (equal neighbours, which rejections leave, rule out methods on spacings), mirrored at
//! the ends so that a density that is cut off (an amplitude at 0) keeps its height there.

use crate::numerics::quantile::quantile;
use std::f64::consts::TAU;

/// Bins of the histogram under the mode.
const BINS: usize = 1024;

/// The shortest interval that contains a fraction of the sorted values.
pub fn shortest_interval(sorted: &[f64], share: f64) -> [f64; 2] {
    let width = ((share * sorted.len() as f64).ceil() as usize).clamp(1, sorted.len()) - 1;
    let first = (0..sorted.len() - width)
        .min_by(|&a, &b| (sorted[a + width] - sorted[a]).total_cmp(&(sorted[b + width] - sorted[b])))
        .unwrap_or(0);
    [sorted[first], sorted[first + width]]
}

/// Mode of sorted values of which `effective` are independent.
pub fn mode(sorted: &[f64], effective: f64) -> f64 {
    let (q25, q75) = (quantile(sorted, 0.25), quantile(sorted, 0.75));
    let low = sorted[0].max(q25 - 4.0 * (q75 - q25));
    let high = sorted[sorted.len() - 1].min(q75 + 4.0 * (q75 - q25));
    if high <= low {
        return quantile(sorted, 0.5);
    }
    let width = (high - low) / BINS as f64;
    let mut histogram = vec![0.0; BINS];
    for x in sorted.iter().filter(|x| (low..=high).contains(*x)) {
        histogram[(((x - low) / width) as usize).min(BINS - 1)] += 1.0;
    }
    let bandwidth = silverman((q75 - q25) / 1.349, effective) / width;
    let last = 2 * BINS as isize - 1;
    let mirrored = |i: isize| {
        let i = i.rem_euclid(2 * BINS as isize);
        histogram[i.min(last - i) as usize]
    };
    low + width * (peak(&smoothed(&mirrored, bandwidth), false) + 0.5)
}

/// Mode of periodic values (period 1), in [0, 1).
pub fn periodic_mode(values: &[f64], effective: f64) -> f64 {
    let mut histogram = vec![0.0; BINS];
    let (mut cosine, mut sine) = (0.0, 0.0);
    for x in values {
        histogram[((wrap(*x) * BINS as f64) as usize).min(BINS - 1)] += 1.0;
        cosine += (TAU * x).cos();
        sine += (TAU * x).sin();
    }
    // Circular standard deviation; that of a flat distribution, 0.29, at most.
    let length = (cosine.hypot(sine) / values.len() as f64).min(1.0);
    let spread = ((-2.0 * length.ln()).max(0.0).sqrt() / TAU).min(0.29);
    let around = |i: isize| histogram[i.rem_euclid(BINS as isize) as usize];
    wrap((peak(&smoothed(&around, silverman(spread, effective) * BINS as f64), true) + 0.5) / BINS as f64)
}

/// Brings periodic values within half a period of `centre`: cut opposite it.
pub fn unwrap_around(values: &mut [f64], centre: f64) {
    values.iter_mut().for_each(|x| *x = centre - 0.5 + wrap(*x - centre + 0.5));
}

/// `x` modulo 1, in [0, 1).
pub fn wrap(x: f64) -> f64 {
    let wrapped = x.rem_euclid(1.0);
    // A tiny negative number comes out as 1.
    if wrapped >= 1.0 { 0.0 } else { wrapped }
}

/// Silverman's width of the kernel.
fn silverman(spread: f64, effective: f64) -> f64 {
    0.9 * spread * effective.max(10.0).powf(-0.2)
}

/// The histogram under a Gaussian of `bandwidth` bins.
fn smoothed(histogram: &dyn Fn(isize) -> f64, bandwidth: f64) -> Vec<f64> {
    let bandwidth = bandwidth.clamp(1.0, BINS as f64 / 4.0);
    let reach = (4.0 * bandwidth) as isize;
    let kernel: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / bandwidth).powi(2)).exp()).collect();
    let at = |bin: isize| (-reach..=reach).zip(&kernel).map(|(i, weight)| weight * histogram(bin + i)).sum();
    (0..BINS as isize).map(at).collect()
}

/// Where the highest bin peaks (in bins), by the parabola through it and its neighbours.
fn peak(density: &[f64], periodic: bool) -> f64 {
    let top = (0..density.len()).fold(0, |top, i| if density[i] > density[top] { i } else { top });
    let (left, right) = match (top, periodic) {
        (0, false) => return -0.5,
        (0, true) => (density.len() - 1, 1),
        (i, periodic) if i == density.len() - 1 => {
            if !periodic {
                return i as f64 + 0.5;
            }
            (i - 1, 0)
        }
        (i, _) => (i - 1, i + 1),
    };
    let curvature = density[left] - 2.0 * density[top] + density[right];
    if curvature < 0.0 { top as f64 + 0.5 * (density[left] - density[right]) / curvature } else { top as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of an exponential distribution at even quantiles.
    fn exponential(count: usize) -> Vec<f64> {
        (0..count).map(|i| -(1.0 - (i as f64 + 0.5) / count as f64).ln()).collect()
    }

    /// Values of a logistic distribution, sorted: symmetric, mode = median = 3, scale 0.1.
    fn logistic(count: usize) -> Vec<f64> {
        let p = |i: usize| (i as f64 + 0.5) / count as f64;
        (0..count).map(|i| 3.0 + 0.1 * (p(i) / (1.0 - p(i))).ln()).collect()
    }

    #[test]
    fn shortest_interval_of_a_falling_density_starts_at_its_wall() {
        let [low, high] = shortest_interval(&exponential(20_000), 0.95);
        assert!(low < 1e-3 && (high - 20f64.ln()).abs() < 0.01, "{low} {high}");
        let [low, high] = shortest_interval(&logistic(20_000), 0.68);
        assert!((low + high - 6.0).abs() < 0.01, "{low} {high}");
    }

    #[test]
    fn modes() {
        // Half a bandwidth is 0.01.
        assert!((mode(&logistic(5000), 5000.0) - 3.0).abs() < 0.01);
        assert!(mode(&exponential(5000), 5000.0) < 0.05, "{}", mode(&exponential(5000), 5000.0));
        assert_eq!(mode(&[2.0; 50], 50.0), 2.0);
        let repeated: Vec<f64> = logistic(5000).into_iter().flat_map(|x| [x; 3]).collect();
        assert!((mode(&repeated, 5000.0) - 3.0).abs() < 0.01);
    }

    #[test]
    fn the_wrap_is_no_special_case() {
        for centre in [0.0, 0.02, 0.5, 0.99] {
            let mut values: Vec<f64> = logistic(5000).iter().map(|x| wrap(0.2 * (x - 3.0) + centre)).collect();
            let found = periodic_mode(&values, 5000.0);
            assert!(wrap(found - centre + 0.5) - 0.5 < 3e-3, "{found} against {centre}");
            unwrap_around(&mut values, found);
            values.sort_by(f64::total_cmp);
            assert!((wrap(quantile(&values, 0.5) - centre + 0.5) - 0.5).abs() < 1e-3);
            assert!(values[4999] - values[0] < 1.0);
        }
        assert_eq!(wrap(-1e-20), 0.0);
    }
}
