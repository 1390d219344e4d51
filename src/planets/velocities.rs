//! The log-likelihood as a quadratic in the radial velocities of the profiles, with the star's own spots marginalised
//! out (`docs/method.md` section 4): `ln L(V) = ln L(0) + g V - V I V / 2`, one velocity V per profile.
//!
//! Everything linear in the velocities follows in closed form: radial velocities with their covariance here, orbits in
//! `periodogram`.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The quadratic.
#[derive(Clone, Debug, PartialEq)]
pub struct VelocityQuadratic {
    /// Rotation cycle of each profile.
    pub cycles: Vec<f64>,
    /// g: derivative of ln L with respect to the velocity of each profile, at velocities 0 (s/km).
    pub gradient: DVector<f64>,
    /// I: minus the second derivative (s^2/km^2), symmetric.
    pub information: DMatrix<f64>,
}

/// The information is not positive definite: to second order, some velocities are unbounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the likelihood has no maximum in the velocities of the profiles: its curvature is not negative definite")]
pub struct NotConcave;

impl VelocityQuadratic {
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

    /// Shifts the origin of velocities (km/s, as a function of the rotation cycle): the former ln L at 0 is now that at
    /// these velocities.
    pub fn count_in(&mut self, velocity_kms: impl Fn(f64) -> f64) {
        let v = DVector::from_iterator(self.len(), self.cycles.iter().map(|cycle| velocity_kms(*cycle)));
        self.gradient += &self.information * v;
    }

    /// The same with the amplitudes of the columns of `x` (profiles x amplitudes) marginalised: gradient `Q g`,
    /// information `Q I`, `Q = 1 - I X A^-1 X'` (Schur complement). `None` where they are not bounded.
    pub fn beside(&self, x: &DMatrix<f64>) -> Option<Self> {
        let ix = &self.information * x;
        let answer = x.tr_mul(&ix).cholesky()?.solve(&x.transpose());
        let keep = DMatrix::identity(self.len(), self.len()) - &ix * answer;
        let information = &keep * &self.information;
        Some(VelocityQuadratic {
            cycles: self.cycles.clone(),
            gradient: &keep * &self.gradient,
            information: 0.5 * (&information + information.transpose()),
        })
    }

    /// The most likely amplitude of the velocities `unit` and its standard error.
    pub fn amplitude(&self, unit: &DVector<f64>) -> [f64; 2] {
        let information = unit.dot(&(&self.information * unit));
        [self.gradient.dot(unit) / information, information.sqrt().recip()]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocities_are_where_the_likelihood_is_highest() {
        let quadratic = VelocityQuadratic {
            cycles: vec![0.0, 0.5],
            gradient: DVector::from_vec(vec![3.0, -1.0]),
            information: DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 2.0]),
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
