//! Integrated autocorrelation time, `tau = 1 + 2 sum_l rho(l)`, with Sokal's window.
//!
//! Source: Goodman & Weare 2010, section 3 (definition); Foreman-Mackey et al. 2013, section 3 (use with ensembles);
//! the window is the smallest lag M with M >= c tau(M), c = 5 (Sokal). The autocovariance is that of every walker's
//! series *around the mean of its ensemble*, averaged over walkers: around its own mean a walker that is stuck has no
//! variance, and would lower tau where it should raise it. Sums are direct and stop at the window (n x lag operations).

use crate::sampling::chain::Series;

/// Window factor c of Sokal's rule.
pub const WINDOW: f64 = 5.0;

/// An integrated autocorrelation time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratedTime {
    /// tau, in steps.
    pub tau: f64,
    /// Variance of the series (lag 0 of the autocovariance).
    pub variance: f64,
    /// Whether the window closed within half the series; if not, `tau` is a lower limit.
    pub closed: bool,
}

/// Integrated autocorrelation time of a quantity over all walkers, around the mean of each ensemble.
///
/// `None` when there are fewer than 4 steps or the quantity does not vary.
pub fn autocorrelation_time(series: &Series) -> Option<IntegratedTime> {
    integrated_time(&centred(series))
}

/// Every walker around the mean of its ensemble.
fn centred(series: &Series) -> Vec<Vec<f64>> {
    let around = |walkers: &Vec<Vec<f64>>| -> Vec<Vec<f64>> {
        let centre = mean(walkers.iter().flatten());
        walkers.iter().map(|walker| walker.iter().map(|x| x - centre).collect()).collect()
    };
    series.iter().flat_map(around).collect()
}

/// Autocorrelation of a quantity over all walkers at lags from 0 to `lags`, around the mean of each ensemble; 1 at lag
/// 0, empty when the quantity does not vary.
pub fn autocorrelation_function(series: &Series, lags: usize) -> Vec<f64> {
    let centred = centred(series);
    let steps = centred.first().map_or(0, Vec::len);
    let covariance = |lag: usize| centred.iter().map(|x| dot(&x[lag..], &x[..steps - lag])).sum::<f64>();
    let variance = covariance(0);
    let lags = if variance > 0.0 { 0..(lags + 1).min(steps) } else { 0..0 };
    lags.map(|lag| covariance(lag) / variance).collect()
}

/// Integrated autocorrelation time of series from which the mean is already subtracted, averaging the autocovariances.
///
/// All series must have one length. `None` when it is under 4 or nothing varies.
pub fn integrated_time(centred: &[Vec<f64>]) -> Option<IntegratedTime> {
    let steps = centred.first()?.len();
    if steps < 4 {
        return None;
    }
    let scale = 1.0 / (steps * centred.len()) as f64;
    let covariance = |lag: usize| scale * centred.iter().map(|x| dot(&x[lag..], &x[..steps - lag])).sum::<f64>();
    let variance = covariance(0);
    if variance.is_nan() || variance <= 0.0 {
        return None;
    }
    let mut tau = 1.0;
    for lag in 1..=steps / 2 {
        tau += 2.0 * covariance(lag) / variance;
        if lag as f64 >= WINDOW * tau {
            return Some(IntegratedTime { tau, variance, closed: true });
        }
    }
    Some(IntegratedTime { tau, variance, closed: false })
}

/// Mean of the values; 0 for none.
pub(crate) fn mean<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), x| (sum + x, count + 1));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// Dot product in eight partial sums, in a fixed order.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut partial = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for lane in 0..8 {
            partial[lane] += x[lane] * y[lane];
        }
    }
    partial.iter().sum::<f64>() + rest
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Stationary AR(1) series of unit variance; tau = (1 + r) / (1 - r).
    pub(crate) fn ar1(coefficient: f64, shape: [usize; 3], seed: u64) -> Series {
        let [ensembles, walkers, steps] = shape;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut walker = || {
            let mut x: f64 = rng.sample(StandardNormal);
            let noise = (1.0 - coefficient * coefficient).sqrt();
            let mut next = || {
                let kick: f64 = rng.sample(StandardNormal);
                let now = x;
                x = coefficient * x + noise * kick;
                now
            };
            (0..steps).map(|_| next()).collect::<Vec<f64>>()
        };
        (0..ensembles).map(|_| (0..walkers).map(|_| walker()).collect()).collect()
    }

    #[test]
    fn ar1_of_known_time() {
        for coefficient in [0.0, 0.5, 0.9, 0.95] {
            let truth = (1.0 + coefficient) / (1.0 - coefficient);
            let found = autocorrelation_time(&ar1(coefficient, [2, 16, 4000], 3)).unwrap();
            // The window leaves out exp(-5/2) or less of the sum on each side: a few per cent, and noise of about 1 %.
            assert!((found.tau / truth - 1.0).abs() < 0.06, "r = {coefficient}: tau {} against {truth}", found.tau);
            assert!(found.closed && (found.variance - 1.0).abs() < 0.1);
        }
    }

    #[test]
    fn ar1_falls_by_its_coefficient() {
        let found = autocorrelation_function(&ar1(0.8, [2, 16, 4000], 3), 10);
        for (lag, r) in found.iter().enumerate() {
            // noise of the mean over 128,000 values, of which one in nine is independent
            assert!((r - 0.8f64.powi(lag as i32)).abs() < 0.03, "lag {lag}: {r}");
        }
        assert!(autocorrelation_function(&vec![vec![vec![1.0; 100]; 4]; 2], 5).is_empty());
    }

    #[test]
    fn a_stuck_walker_shows() {
        let mut series = ar1(0.5, [1, 16, 2000], 5);
        let free = autocorrelation_time(&series).unwrap().tau;
        series[0][7] = vec![3.0; 2000];
        let stuck = autocorrelation_time(&series).unwrap();
        assert!(stuck.tau > 10.0 * free, "stuck {} against free {free}", stuck.tau);
    }

    #[test]
    fn nothing_to_measure() {
        assert_eq!(autocorrelation_time(&vec![vec![vec![1.0; 100]; 4]; 2]), None);
        assert_eq!(autocorrelation_time(&vec![vec![vec![1.0, 2.0]]]), None);
        assert_eq!(autocorrelation_time(&Vec::new()), None);
    }
}
