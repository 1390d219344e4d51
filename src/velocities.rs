//! The log-likelihood as a quadratic in the radial velocities of the profiles, with the star's own spots marginalised out
//! (method section 4): `ln L(V) = ln L(0) + g V - V I V / 2`, one velocity V a profile.
//!
//! Everything linear in the velocities follows in closed form: radial velocities with their covariance here, orbits in
//! `periodogram`.
//!
//! # Spots that the map leaves over
//!
//! The information counts spots as the entropy sees them: many small and independent ones. Real spots have edges, and what a
//! map of the highest entropy misses of them is larger (25 times in variance for discs at a signal-to-noise ratio of 1000) and
//! goes with the star: most of it looks like an orbit at the rotation period or its fractions. Its covariance has the shape of
//! what spots add to noise, `information - noise`; its size is fitted, one number, as that of a jitter would be, to the
//! gradient itself: [`VelocityQuadratic::with_spots_left`]. Without it, half of all stars without a planet show one
//! (`results/calibration.md`).
//!
//! Left out: where gradient and information come from (`expansion`).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};

/// The quadratic, with what is known of the scatter of its gradient.
#[derive(Clone, Debug, PartialEq)]
pub struct VelocityQuadratic {
    /// Rotation cycle of each profile.
    pub cycles: Vec<f64>,
    /// g: derivative of ln L with respect to the velocity of each profile, at velocities 0 (s/km).
    pub gradient: DVector<f64>,
    /// I: minus the second derivative (s^2/km^2), symmetric.
    pub information: DMatrix<f64>,
    /// Covariance of the gradient that photon noise makes. It is smaller than the information, which counts spots that
    /// might be there as well.
    pub noise: DMatrix<f64>,
}

/// The information is not positive definite: to second order, some velocities are not bounded by the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the likelihood has no maximum in the velocities of the profiles: its curvature is not negative definite")]
pub struct NotConcave;

/// Range of the factor on the variance of what spots add.
const SPOTS_LEFT: (f64, f64) = (1.0, 1e6);

impl VelocityQuadratic {
    /// The same velocities with the covariance that they have when spots are left over, and how many times larger than the
    /// entropy expects these are in variance. Their size is the most likely one for stars whose orbital velocities are
    /// `orbit` (km/s).
    ///
    /// With `S = noise + factor (information - noise)` the covariance of the gradient, the velocities `I^-1 g` have the
    /// covariance `I^-1 S I^-1`: the new information is `I S^-1 I`, the new gradient `I S^-1 g`.
    ///
    /// # Errors
    /// [`NotConcave`].
    pub fn with_spots_left(&self, orbit: &DVector<f64>) -> Result<(Self, f64), NotConcave> {
        let spots = positive_part(&self.information - &self.noise);
        let covariance = |factor: f64| (&self.noise + factor * &spots).cholesky().ok_or(NotConcave);
        let left = &self.gradient - &self.information * orbit;
        // -2 ln of the probability density of the gradient
        let misfit = |ln_factor: f64| {
            covariance(ln_factor.exp()).map_or(f64::INFINITY, |factor| {
                let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>();
                log_determinant + left.dot(&factor.solve(&left))
            })
        };
        let factor = minimum(misfit, (SPOTS_LEFT.0.ln(), SPOTS_LEFT.1.ln())).exp();
        let covariance = covariance(factor)?;
        let answer = covariance.solve(&self.information);
        let information = symmetric(self.information.tr_mul(&answer));
        let quadratic = VelocityQuadratic {
            cycles: self.cycles.clone(),
            gradient: answer.tr_mul(&self.gradient),
            noise: information.clone(),
            information,
        };
        Ok((quadratic, factor))
    }

    /// Number of profiles.
    pub fn len(&self) -> usize {
        self.cycles.len()
    }

    /// Whether there is no profile.
    pub fn is_empty(&self) -> bool {
        self.cycles.is_empty()
    }

    /// `ln L(V) - ln L(0)` of the velocities `v` (km/s).
    pub fn log_likelihood(&self, v: &DVector<f64>) -> f64 {
        self.gradient.dot(v) - 0.5 * v.dot(&(&self.information * v))
    }

    /// The most likely velocities (km/s), and their covariance (km^2/s^2), the inverse of the information.
    ///
    /// # Errors
    /// [`NotConcave`].
    pub fn radial_velocities(&self) -> Result<(DVector<f64>, DMatrix<f64>), NotConcave> {
        let factor: Cholesky<f64, Dyn> = self.information.clone().cholesky().ok_or(NotConcave)?;
        Ok((factor.solve(&self.gradient), factor.inverse()))
    }
}

fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    0.5 * (&matrix + matrix.transpose())
}

/// A symmetric matrix without its negative eigenvalues.
fn positive_part(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let mut eigen = SymmetricEigen::new(symmetric(matrix));
    eigen.eigenvalues.apply(|e| *e = e.max(0.0));
    eigen.recompose()
}

/// Where a function of one valley or more is lowest: the lowest of many places, and the golden section around it.
fn minimum(f: impl Fn(f64) -> f64, (low, high): (f64, f64)) -> f64 {
    const PLACES: usize = 40;
    let step = (high - low) / PLACES as f64;
    let place = |i: usize| low + i as f64 * step;
    let lowest = (0..=PLACES).min_by(|&a, &b| f(place(a)).total_cmp(&f(place(b)))).expect("there are places");
    let (mut a, mut b) = ((place(lowest) - step).max(low), (place(lowest) + step).min(high));
    let section = 0.5 * (5f64.sqrt() - 1.0);
    while b - a > 1e-3 {
        let (left, right) = (b - section * (b - a), a + section * (b - a));
        if f(left) < f(right) { b = right } else { a = left }
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;

    /// Gradients drawn with spots 30 times what the information says: the factor comes back, the velocities stay, and their
    /// covariance is the one that they have.
    #[test]
    fn the_size_of_spots_left_over_is_found() {
        let n = 60;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal =
            |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| rng.sample::<f64, _>(StandardNormal));
        let waves = normal(n, 12);
        let spots = 0.05 * &waves * waves.transpose();
        let noise = DMatrix::identity(n, n) * 4.0;
        let (mut factors, mut scatter, mut claimed) = (Vec::new(), 0.0, 0.0);
        for _ in 0..40 {
            let gradient = 2.0 * normal(n, 1) + (30.0f64 * 0.05).sqrt() * &waves * normal(12, 1);
            let quadratic = VelocityQuadratic {
                cycles: (0..n).map(|k| k as f64).collect(),
                gradient: gradient.column(0).into_owned(),
                information: &noise + &spots,
                noise: noise.clone(),
            };
            let (honest, factor) = quadratic.with_spots_left(&DVector::zeros(n)).unwrap();
            let (before, _) = quadratic.radial_velocities().unwrap();
            let (after, covariance) = honest.radial_velocities().unwrap();
            assert!((&before - &after).amax() < 1e-9);
            factors.push(factor.ln());
            scatter += after.norm_squared();
            claimed += covariance.trace();
        }
        let mean = factors.iter().sum::<f64>() / factors.len() as f64;
        // each factor comes from 12 waves, with an error of sqrt(2/12) in its logarithm
        assert!((mean - 30f64.ln()).abs() < 0.25, "{}", mean.exp());
        assert!((scatter / claimed - 1.0).abs() < 0.1, "{}", scatter / claimed);
    }

    #[test]
    fn a_minimum_is_found() {
        assert!((minimum(|x| (x - 1.234).powi(2), (-3.0, 9.0)) - 1.234).abs() < 1e-3);
        assert!((minimum(|x| x, (2.0, 3.0)) - 2.0).abs() < 1e-3);
    }

    #[test]
    fn velocities_are_where_the_likelihood_is_highest() {
        let quadratic = VelocityQuadratic {
            cycles: vec![0.0, 0.5],
            gradient: DVector::from_vec(vec![3.0, -1.0]),
            information: DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 2.0]),
            noise: DMatrix::identity(2, 2),
        };
        let (v, covariance) = quadratic.radial_velocities().unwrap();
        assert!((&v - DVector::from_vec(vec![1.0, -1.0])).norm() < 1e-12);
        assert!((&covariance * &quadratic.information - DMatrix::identity(2, 2)).norm() < 1e-12);
        let best = quadratic.log_likelihood(&v);
        assert!((best - 2.0).abs() < 1e-12);
        for step in [[1e-3, 0.0], [0.0, 1e-3], [-1e-3, 1e-3]] {
            assert!(quadratic.log_likelihood(&(&v + DVector::from_row_slice(&step))) < best);
        }
        let open = VelocityQuadratic { information: -quadratic.information.clone(), ..quadratic };
        assert_eq!(open.radial_velocities(), Err(NotConcave));
    }
}
