//! The noise of the profiles: by their quoted uncertainties, and by the continuum beside the line.

use crate::numerics::quantile::middle;
use crate::star::observation::{Observations, Profile};
use nalgebra::{DMatrix, DVector};
use std::cmp::Ordering;

/// Fewest bins of continuum, in all profiles together, for a meaningful scatter.
const FEWEST_BINS: usize = 30;

/// Fewest bins of continuum for a profile to count.
const FEWEST_IN_PROFILE: usize = 4;

/// Only continuum nearer to the centre than this is used, in units of the distance at which the line ends: LSD profiles
/// ripple farther out.
const OUTER: f64 = 2.0;

/// Uncertainties of a bin in units of the continuum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// As quoted, median over all bins.
    pub quoted: f64,
    /// Scatter of the continuum about the mean of its profile; `None` where there is too little of it.
    pub scatter: Option<f64>,
}

/// Largest distance in bins at which noise may be correlated.
const LAGS: usize = 8;

/// Scatter of the continuum of one or several profiles about straight lines.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scatter {
    /// Sum of the squares, in units of the quoted uncertainties.
    pub chi2: f64,
    /// Number of bins, less two per line.
    pub freedom: usize,
    /// Sum of the products of bins 0, 1, 2, ... apart.
    products: [f64; LAGS + 1],
    /// Numbers of bins of the lines.
    lengths: Vec<usize>,
}

impl std::iter::Sum for Scatter {
    fn sum<I: Iterator<Item = Scatter>>(all: I) -> Self {
        all.fold(Scatter::default(), |sum, one| Scatter {
            chi2: sum.chi2 + one.chi2,
            freedom: sum.freedom + one.freedom,
            products: std::array::from_fn(|lag| sum.products[lag] + one.products[lag]),
            lengths: [sum.lengths, one.lengths].concat(),
        })
    }
}

impl Scatter {
    /// The continuum of `profile` beside a line that extends `reach_kms` to either side of `centre_kms`, over as much
    /// again, about a straight line on each side: neither level nor slope counts.
    pub fn of(profile: &Profile, centre_kms: f64, reach_kms: f64) -> Self {
        let side = |sign: f64| {
            let distance = move |j: usize| sign * (profile.velocity_kms(j) - centre_kms);
            let inside = move |j: &usize| (reach_kms..=OUTER * reach_kms).contains(&distance(*j));
            let bins: Vec<usize> = (0..profile.intensity.len()).filter(inside).collect();
            about_a_line(bins.iter().map(|&j| (j as f64, profile.intensity[j], profile.sigma[j].powi(-2))))
        };
        [side(-1.0), side(1.0)].into_iter().sum()
    }

    /// Number of bins over which noise is correlated for features with a width (standard deviation) of `sigma_bins`:
    /// `1 + 2 sum rho a`, with rho the correlation at each distance in bins, up to where it no longer exceeds that of
    /// white noise by chance, and `a` that of the features. Uncertainties derived from a profile are larger by its
    /// square root.
    pub fn correlated_bins(&self, sigma_bins: f64) -> f64 {
        let overlap = |lag: usize| (-0.25 * (lag as f64 / sigma_bins).powi(2)).exp();
        const CHANCE: f64 = 2.5;
        let mut bins = 1.0;
        for lags in 1..=LAGS {
            let Some((correlation, sd)) = self.correlation(lags) else { break };
            // lines through a few bins leave little information at such distances: NaN ends the loop, too
            if !matches!(correlation[lags - 1].partial_cmp(&(CHANCE * sd)), Some(Ordering::Greater)) {
                break;
            }
            bins = 1.0 + 2.0 * correlation.iter().enumerate().map(|(k, rho)| rho * overlap(k + 1)).sum::<f64>();
        }
        bins
    }

    /// Correlations at 1, ..., `lags` bins, no farther, and the standard deviation of the last in white noise. The
    /// lines absorb part of the correlation; the expected products of their residuals are linear in the covariances,
    /// and are solved for these.
    fn correlation(&self, lags: usize) -> Option<(Vec<f64>, f64)> {
        let mut lengths = self.lengths.clone();
        lengths.sort_unstable();
        let (mut mean, mut scatter) = (DMatrix::zeros(lags + 1, lags + 1), DMatrix::zeros(lags + 1, lags + 1));
        for same in lengths.chunk_by(|a, b| a == b) {
            let [mean_of_one, scatter_of_one] = products(same[0], lags);
            mean += same.len() as f64 * mean_of_one;
            scatter += same.len() as f64 * scatter_of_one;
        }
        let inverse = mean.try_inverse()?;
        let covariance = &inverse * DVector::from_column_slice(&self.products[..=lags]);
        let correlation: Vec<f64> = covariance.iter().skip(1).map(|c| c / covariance[0]).collect();
        let sd = (&inverse * scatter * inverse.transpose())[(lags, lags)].sqrt();
        (covariance[0] > 0.0 && correlation.iter().all(|rho| rho.is_finite())).then_some((correlation, sd))
    }

    /// Scatter over quoted uncertainties; `None` below `least` degrees of freedom, and for none at all.
    pub fn ratio(&self, least: usize) -> Option<f64> {
        (self.freedom >= least && self.chi2 > 0.0).then(|| (self.chi2 / self.freedom as f64).sqrt())
    }
}

/// The scatter of points (x, y, weight) about the straight line that fits them best; zero for fewer than three.
fn about_a_line(points: impl Iterator<Item = (f64, f64, f64)> + Clone) -> Scatter {
    let count = points.clone().count();
    if count < 3 {
        return Scatter::default();
    }
    let sum = |f: &dyn Fn(f64, f64) -> f64| points.clone().map(|(x, y, w)| w * f(x, y)).sum::<f64>();
    let weight = sum(&|_, _| 1.0);
    let (x0, y0) = (sum(&|x, _| x) / weight, sum(&|_, y| y) / weight);
    let slope = sum(&|x, y| (x - x0) * (y - y0)) / sum(&|x, _| (x - x0).powi(2));
    let left: Vec<f64> = points.map(|(x, y, w)| w.sqrt() * (y - y0 - slope * (x - x0))).collect();
    let products = |lag: usize| left.iter().zip(left.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
    Scatter { chi2: products(0), freedom: count - 2, products: std::array::from_fn(products), lengths: vec![count] }
}

/// Of the sums of products of residuals at each distance in bins (row) from a straight line through `bins`: their mean
/// for noise with a covariance of 1 at one distance (column), and their covariance in white noise.
fn products(bins: usize, lags: usize) -> [DMatrix<f64>; 2] {
    let line = DMatrix::from_fn(bins, 2, |j, power| (j as f64 - 0.5 * (bins - 1) as f64).powi(power as i32));
    let unit = DMatrix::from_fn(bins, 2, |j, k| line[(j, k)] / line.column(k).norm());
    let left = DMatrix::identity(bins, bins) - &unit * unit.transpose();
    let apart = |lag: usize| DMatrix::from_fn(bins, bins, |a, b| f64::from(u8::from(a.abs_diff(b) == lag)));
    let residuals: Vec<DMatrix<f64>> = (0..=lags).map(|lag| &left * apart(lag) * &left).collect();
    let mean = |row: usize, column: usize| (row..bins).map(|j| residuals[column][(j, j - row)]).sum();
    // a product counts each pair once
    let share = |lag: usize| if lag == 0 { 1.0 } else { 0.5 };
    let covariance =
        |row: usize, column: usize| 2.0 * share(row) * share(column) * residuals[row].dot(&residuals[column]);
    [DMatrix::from_fn(lags + 1, lags + 1, mean), DMatrix::from_fn(lags + 1, lags + 1, covariance)]
}

impl Noise {
    /// Uncertainties of profiles whose line extends `reach_kms` to either side of `centre_kms`.
    pub fn of(observations: &Observations, centre_kms: f64, reach_kms: f64) -> Self {
        let beside = |profile: &Profile| -> Vec<f64> {
            let distance = |j: usize| (profile.velocity_kms(j) - centre_kms).abs();
            let bins = profile.intensity.iter().enumerate();
            bins.filter(|(j, _)| (reach_kms..=OUTER * reach_kms).contains(&distance(*j))).map(|(_, i)| *i).collect()
        };
        let (mut bins, mut freedom, mut square) = (0, 0, 0.0);
        for continuum in observations.profiles.iter().map(beside).filter(|c| c.len() >= FEWEST_IN_PROFILE) {
            let mean = continuum.iter().sum::<f64>() / continuum.len() as f64;
            square += continuum.iter().map(|i| (i - mean).powi(2)).sum::<f64>();
            bins += continuum.len();
            freedom += continuum.len() - 1;
        }
        let sigmas = observations.profiles.iter().flat_map(|p| p.sigma.iter().copied()).collect();
        Noise {
            quoted: middle(sigmas),
            scatter: (bins >= FEWEST_BINS && square > 0.0).then(|| (square / freedom as f64).sqrt()),
        }
    }

    /// Scatter over quoted uncertainties; `None` without continuum.
    pub fn ratio(&self) -> Option<f64> {
        self.scatter.map(|scatter| scatter / self.quoted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Level and slope do not contribute, and the scatter about a line equals that of a fit by hand: y = 1, 0, 1 about
    /// 2/3.
    #[test]
    fn slopes_do_not_count() {
        let line = |j: usize| 1.3 - 0.01 * j as f64;
        let even = about_a_line((0..10).map(|j| (j as f64, line(j), 4.0)));
        assert!(even.chi2 < 1e-20 && even.freedom == 8, "{even:?}");
        let bent = about_a_line([(0.0, 1.0, 2.0), (1.0, 0.0, 2.0), (2.0, 1.0, 2.0)].into_iter());
        assert!((bent.chi2 - 2.0 * 2.0 / 3.0).abs() < 1e-12 && bent.freedom == 1, "{bent:?}");
        assert_eq!(about_a_line([(0.0, 1.0, 1.0); 2].into_iter()), Scatter::default());
    }

    /// White noise, and AR(1) noise x_k = rho x_(k-1) + n_k, whose correlations rho^k add up to (1 + rho) / (1 - rho).
    #[test]
    fn noise_that_goes_together_is_seen() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut side = |rho: f64, bins: usize| {
            let mut x = 0.0;
            let noise: Vec<f64> = (0..bins)
                .map(|_| {
                    x = rho * x + (1.0 - rho * rho).sqrt() * rng.sample::<f64, _>(StandardNormal);
                    x
                })
                .collect();
            about_a_line(noise.into_iter().enumerate().map(|(j, y)| (j as f64, y, 1.0)))
        };
        let white: Scatter = (0..100).map(|_| side(0.0, 40)).sum();
        assert_eq!(white.correlated_bins(9.0), 1.0);
        let together: Scatter = (0..100).map(|_| side(0.5, 40)).sum();
        // the truncated tail is small
        assert!(
            (together.correlated_bins(f64::INFINITY) / 3.0 - 1.0).abs() < 0.15,
            "{}",
            together.correlated_bins(f64::INFINITY)
        );
        // a few bins of continuum beside the line show no correlation, and chance exceeds 2.5 standard deviations once
        // in 160 times
        let mut few = |bins: usize| -> Scatter { (0..80).map(|_| side(0.0, bins)).sum() };
        let seen = (0..100).map(|k| few(3 + k % 4).correlated_bins(9.0)).filter(|bins| *bins > 1.0).count();
        assert!(seen <= 5, "{seen}");
    }
}
