//! The loss where velocities are assumed independent: uncertainties of K and chi2 of generalised and of weighted least
//! squares.

use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// A circular orbit of one period, with a constant velocity, by the diagonal of the covariance alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Loss {
    /// sigma_K according to the diagonal, over that with the full covariance; both the roots of the variance averaged
    /// over phases.
    pub quoted: f64,
    /// Actual sigma_K with weights by the diagonal, over the same.
    pub achieved: f64,
    /// Mean chi2 of the best orbit by the diagonal, per degree of freedom.
    pub reduced_chi2: f64,
}

impl Loss {
    /// For velocities with this covariance; `None` where they do not bound the orbit or are too few.
    pub(super) fn new(times_d: &[f64], covariance: &DMatrix<f64>, period_d: f64) -> Option<Self> {
        const FITTED: usize = 3;
        let n = times_d.len();
        if n <= FITTED {
            return None;
        }
        let angle = |k: usize| TAU * (times_d[k] - times_d[0]) / period_d;
        let design = DMatrix::from_fn(n, FITTED, |k, column| match column {
            0 => angle(k).cos(),
            1 => angle(k).sin(),
            _ => 1.0,
        });
        let weights = DVector::from_fn(n, |k, _| 1.0 / covariance[(k, k)]);
        let weighted = DMatrix::from_fn(n, FITTED, |k, column| weights[k] * design[(k, column)]);
        let best = design.tr_mul(&covariance.clone().cholesky()?.solve(&design)).try_inverse()?;
        let quoted = design.tr_mul(&weighted).try_inverse()?;
        // from velocities to fitted parameters
        let fit = &quoted * weighted.transpose();
        let achieved = &fit * covariance * fit.transpose();
        let rest = DMatrix::identity(n, n) - &design * &fit;
        let left = &rest * covariance * rest.transpose();
        let chi2 = left.diagonal().component_mul(&weights).sum();
        let k = |of: &DMatrix<f64>| (of[(0, 0)] + of[(1, 1)]).sqrt();
        let loss = Loss {
            quoted: k(&quoted) / k(&best),
            achieved: k(&achieved) / k(&best),
            reduced_chi2: chi2 / (n - FITTED) as f64,
        };
        [loss.quoted, loss.achieved, loss.reduced_chi2].iter().all(|x| x.is_finite()).then_some(loss)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    fn times() -> Vec<f64> {
        (0..25).map(|k| k as f64 + 0.3 * (1.7 * k as f64).sin()).collect()
    }

    #[test]
    fn of_independent_velocities_nothing_is_lost() {
        let covariance = DMatrix::from_fn(25, 25, |j, k| if j == k { 1.0 + 0.1 * j as f64 } else { 0.0 });
        let Loss { quoted, achieved, reduced_chi2 } = Loss::new(&times(), &covariance, 4.4).unwrap();
        assert!((quoted - 1.0).abs() < 1e-9 && (achieved - 1.0).abs() < 1e-9 && (reduced_chi2 - 1.0).abs() < 1e-9);
        assert_eq!(Loss::new(&times()[..3], &DMatrix::identity(3, 3), 4.4), None);
    }

    /// Compared with weighted least squares of simulated velocities.
    #[test]
    fn of_correlated_velocities_it_is_what_simulations_lose() {
        let times = times();
        let covariance = DMatrix::from_fn(25, 25, |j, k| {
            let near = (-(times[j] - times[k]).abs() / 3.0).exp();
            0.8 * near + if j == k { 0.2 + 0.02 * j as f64 } else { 0.0 }
        });
        let loss = Loss::new(&times, &covariance, 4.4).unwrap();
        let factor = covariance.clone().cholesky().unwrap().l();
        let design = DMatrix::from_fn(25, 3, |k, c| {
            let angle = TAU * (times[k] - times[0]) / 4.4;
            [angle.cos(), angle.sin(), 1.0][c] / covariance[(k, k)].sqrt()
        });
        let svd = design.clone().svd(true, true);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (n, mut variance, mut chi2) = (4000, 0.0, 0.0);
        for _ in 0..n {
            let v = &factor * DVector::from_fn(25, |_, _| rng.sample::<f64, _>(StandardNormal));
            let v = DVector::from_fn(25, |k, _| v[k] / covariance[(k, k)].sqrt());
            let found = svd.solve(&v, 1e-12).unwrap();
            variance += (found[0].powi(2) + found[1].powi(2)) / f64::from(n);
            chi2 += (v - &design * &found).norm_squared() / 22.0 / f64::from(n);
        }
        let quoted = (&design.transpose() * &design).try_inverse().unwrap();
        let ratio = (variance / (quoted[(0, 0)] + quoted[(1, 1)])).sqrt();
        // uncertainties of 4000 draws: 1 %
        assert!((loss.achieved / loss.quoted / ratio - 1.0).abs() < 0.04, "{loss:?} {ratio}");
        assert!((loss.reduced_chi2 / chi2 - 1.0).abs() < 0.04, "{loss:?} {chi2}");
        assert!(loss.achieved > 1.0);
    }
}
