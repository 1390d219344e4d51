//! The highest ln L of velocities that depend on a few parameters: Gauss-Newton steps, damped (Levenberg 1944,
//! Marquardt 1963).
//!
//! ln L is a quadratic in the velocities, so its gradient is `J' (g - I V)`, J the derivative of the velocities by
//! differences.

use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};

/// The search ends when the predicted gain of a step in ln L is less than this.
const SMALLEST_GAIN: f64 = 1e-11;

/// Largest number of steps, accepted or not.
const MOST_STEPS: usize = 200;

/// A maximum of ln L.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Maximum {
    /// The parameters.
    pub theta: DVector<f64>,
    /// ln L relative to no planet.
    pub delta_ln_l: f64,
    /// Inverse of minus the second derivative; `None` where that is not positive definite.
    pub covariance: Option<DMatrix<f64>>,
}

/// Velocities (km/s) that depend on parameters, with steps for numerical derivatives.
pub(super) struct Model<'a> {
    /// The velocities, `None` for invalid parameters.
    pub velocities: &'a dyn Fn(&DVector<f64>) -> Option<DVector<f64>>,
    /// A step in each parameter that changes the velocities only slightly.
    pub steps: DVector<f64>,
}

impl Model<'_> {
    fn jacobian(&self, theta: &DVector<f64>) -> Option<DMatrix<f64>> {
        let column = |i: usize| {
            let [plus, minus] = [1.0, -1.0].map(|sign| {
                let mut at = theta.clone();
                at[i] += sign * self.steps[i];
                (self.velocities)(&at)
            });
            Some((plus? - minus?) / (2.0 * self.steps[i]))
        };
        let columns: Option<Vec<_>> = (0..theta.len()).map(column).collect();
        Some(DMatrix::from_columns(&columns?))
    }

    /// Derivative of ln L, and the derivative of the velocities.
    fn slope(&self, quadratic: &VelocityQuadratic, theta: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let jacobian = self.jacobian(theta)?;
        let pull = &quadratic.gradient - &quadratic.information * (self.velocities)(theta)?;
        Some((jacobian.tr_mul(&pull), jacobian))
    }

    /// Minus the second derivative of ln L, by differences of the first.
    fn curvature(&self, quadratic: &VelocityQuadratic, theta: &DVector<f64>) -> Option<DMatrix<f64>> {
        let column = |i: usize| {
            let [plus, minus] = [1.0, -1.0].map(|sign| {
                let mut at = theta.clone();
                at[i] += sign * self.steps[i];
                self.slope(quadratic, &at)
            });
            Some((minus?.0 - plus?.0) / (2.0 * self.steps[i]))
        };
        let columns: Option<Vec<_>> = (0..theta.len()).map(column).collect();
        let half = 0.5 * DMatrix::from_columns(&columns?);
        Some(&half + half.transpose())
    }

    /// Climbs from `start` to the next maximum. `None` if the start is invalid.
    pub fn climb(&self, quadratic: &VelocityQuadratic, start: DVector<f64>) -> Option<Maximum> {
        let ln_l = |theta: &DVector<f64>| (self.velocities)(theta).map(|v| quadratic.log_likelihood(&v));
        let (mut theta, mut height, mut damping) = (start.clone(), ln_l(&start)?, 1e-3);
        for _ in 0..MOST_STEPS {
            let Some((slope, jacobian)) = self.slope(quadratic, &theta) else { break };
            let mut system = jacobian.tr_mul(&(&quadratic.information * &jacobian));
            for i in 0..theta.len() {
                system[(i, i)] *= 1.0 + damping;
            }
            let step = system.cholesky().map(|factor| factor.solve(&slope));
            let tried = step.as_ref().and_then(|step| {
                let there = &theta + step;
                ln_l(&there).map(|height| (there, height))
            });
            let promise = step.map_or(f64::INFINITY, |step| step.dot(&slope));
            match tried {
                Some((there, higher)) if higher > height => {
                    (theta, height) = (there, higher);
                    damping = (0.1 * damping).max(1e-9);
                }
                _ => damping *= 10.0,
            }
            if promise < SMALLEST_GAIN || damping > 1e12 {
                break;
            }
        }
        let curvature = self.curvature(quadratic, &theta);
        let covariance = curvature.and_then(|c| c.cholesky()).map(|factor| factor.inverse());
        Some(Maximum { theta, delta_ln_l: height, covariance })
    }
}
