//! Convergence of an image: an estimate of its remaining error from the gradient, without a Newton step.
//!
//! With H the Newton system, g the gradient of chi2/2 and r minus the gradient of the merit, the path of solutions
//! obeys `H path = -lambda g`, so that a step `H step = r` changes chi2 by `-2 path r / lambda`; and by the adjoint of
//! spottedness at fixed chi2 the step changes spottedness by `adjoint r`. Path and adjoint of a nearby solution are
//! accurate to first order in the distance. Where data constrain little, an adjoint is proportional to the scale of the
//! metric, and is stored relative to it: a pixel that has become spotted since then has its present weight.

use super::entropy::Entropy;
use super::preconditioner::Preconditioner;
use super::problem::Problem;
use super::solution::{Best, Goal};
use crate::numerics::vector::linear::{combine, combined, dot, weighted_dots};
use crate::numerics::vector::{self, Instructions, Task};

/// Largest change of ln(lambda) in one step.
const LN_LAMBDA_CAP: f64 = 1.5;

/// Bound of lambda: far beyond useful values, it keeps a bad start finite.
pub(super) const SMALLEST_LAMBDA: f64 = 1e-12;

/// A lambda this close to its bound, in logarithm, counts as at the bound.
const AT_BOUND: f64 = 1e-12;

/// Relative error of a first-order forecast of the remaining change of spottedness, for a good forecast. Forecasts of
/// small changes are often worse, so that errors can be several times the tolerance.
const FORECAST_ERROR: f64 = 0.03;

/// Relative error of the change of chi2/2 by a step along the path of a nearby solution.
const PATH_ERROR: f64 = 0.01;

/// Remaining error at the bound of lambda, over the forecast of the remaining change of chi2/2, which is not applied
/// there.
const BOUND_ERROR: f64 = 0.3;

/// Error of the forecast of spottedness, which is of second order in a step, over the merit of the part of the step
/// spanned by the preconditioner's eigenvectors, ...
const SPANNED_ERROR: f64 = 8.0;

/// ... and over that of the rest: pixels that become spotted, where spottedness is far from linear. Like those above,
/// these constants were measured against exact solutions on the paper's setup, in three and seven dimensions.
const REST_ERROR: f64 = 40.0;

/// An image with the quantities computed there.
pub(super) struct Point {
    /// Coordinates of the image.
    pub u: Vec<f64>,
    /// The image.
    pub s: Vec<f64>,
    pub lambda: f64,
    pub chi2: f64,
    pub entropy: f64,
    pub spottedness: f64,
}

/// Estimates from the gradient at a point.
pub(super) struct Convergence {
    /// Scale of the entropy's metric.
    pub scale: Vec<f32>,
    /// Gradient of chi2 / 2, in the metric.
    pub chi2_gradient: Vec<f32>,
    /// Minus the gradient of the merit `-S + lambda/2 chi2`, in the metric.
    pub right: Vec<f32>,
    /// Slopes of chi2 and of spottedness along the path (0 without one).
    pub chi2_path: f64,
    pub spottedness_path: f64,
    /// Forecast of the remaining change of spottedness at this chi2.
    pub spottedness_left: f64,
    /// Required change of ln(lambda) to reach the target (0 without a path).
    pub move_lambda: f64,
    /// Remaining error without the part that requires the preconditioner.
    known_error: f64,
    /// Error of the part spanned by the preconditioner's eigenvectors, and of the rest, over the merit of each.
    merit_errors: [f64; 2],
    /// Whether lambda is at its bound and chi2 stays above the target.
    pub at_bound: bool,
}

/// Quantities known from nearby solutions.
#[derive(Clone, Copy)]
pub(super) struct Guide<'a> {
    /// `dz / d ln(lambda)` in the metric; empty for unknown.
    pub path: &'a [f32],
    /// Adjoint of spottedness at fixed chi2, in the metric, over the scale of the metric; empty for unknown.
    pub adjoint: &'a [f32],
}

impl Convergence {
    /// Takes the gradient at a point (one pass) and judges it by the guide. `gradient` is memory for it.
    pub fn of(
        problem: &mut impl Problem,
        entropy: Entropy,
        at: &Point,
        goal: Goal,
        guide: Guide,
        gradient: &mut [f64],
    ) -> Self {
        let n = at.u.len();
        let (mut chi2_gradient, mut right) = (vec![0.0; n], vec![0.0; n]);
        problem.gradient(gradient);
        let (area, scale) = (problem.area(), entropy.metric(&at.s, problem.area()));
        vector::run(IntoMetric {
            at,
            area,
            default: entropy.default_coordinate(),
            scale: &scale,
            gradient,
            chi2_gradient: &mut chi2_gradient,
            right: &mut right,
        });
        let (chi2_path, spottedness_path, spottedness_left) = (0.0, 0.0, 0.0);
        let (move_lambda, known_error, merit_errors, at_bound) = (0.0, 0.0, [1.0; 2], false);
        let mut convergence = Convergence {
            scale,
            chi2_gradient,
            right,
            chi2_path,
            spottedness_path,
            spottedness_left,
            move_lambda,
            known_error,
            merit_errors,
            at_bound,
        };
        match goal {
            Goal::Lambda(_) => {}
            Goal::Chi2 { .. } if guide.path.len() == n => {
                let weights = entropy.spottedness_gradient(&at.s, problem.area());
                convergence.forecast(&weights, at, goal, guide);
            }
            // without a path the distance of chi2 from its target is unknown
            Goal::Chi2 { .. } => convergence.known_error = f64::INFINITY,
        }
        convergence
    }

    /// `weights` is the gradient of spottedness with respect to the image.
    fn forecast(&mut self, weights: &[f64], at: &Point, goal: Goal, guide: Guide) {
        let Guide { path, adjoint } = guide;
        let (chi2_path, chi2_step) = self.slopes(path, at);
        let move_lambda = lambda_step(at, chi2_path, chi2_step, goal);
        (self.chi2_path, self.move_lambda) = (chi2_path, move_lambda);
        [self.spottedness_path] = weighted_dots(path, &self.scale, [weights]);
        if let Goal::Chi2 { target, largest_lambda } = goal {
            let to_bound = (largest_lambda / at.lambda).ln();
            self.at_bound = to_bound < AT_BOUND && move_lambda.abs() < AT_BOUND && at.chi2 + chi2_step > target;
        }
        if self.at_bound {
            self.known_error = BOUND_ERROR * 0.5 * chi2_step.abs();
            return;
        }
        // remaining distance to the target where the change of lambda is limited
        if let Goal::Chi2 { target, .. } = goal {
            self.known_error += 0.5 * (target - at.chi2 - chi2_step - chi2_path * move_lambda).abs();
            self.known_error += 0.5 * PATH_ERROR * (target - at.chi2).abs();
        }
        // of second order in the move along the path
        self.known_error += 0.5 * (chi2_path * move_lambda * move_lambda).abs();
        if adjoint.len() == path.len() {
            let [of_step, of_chi2] = weighted_dots(adjoint, &self.scale, [&self.right, &self.chi2_gradient]);
            // no component along the path: the change of lambda is included in chi2
            self.spottedness_left = of_step + of_chi2 * at.lambda * chi2_step / chi2_path;
            self.known_error += FORECAST_ERROR * (self.spottedness_left * self.worth()).abs();
            self.merit_errors = [SPANNED_ERROR, REST_ERROR];
        }
    }

    /// Change of chi2 by the path, and by the Newton step at fixed lambda.
    fn slopes(&self, path: &[f32], at: &Point) -> (f64, f64) {
        (2.0 * dot(&self.chi2_gradient, path), -2.0 * dot(path, &self.right) / at.lambda)
    }

    /// Required change of ln(lambda) to reach the target along another path than that of the guide.
    pub fn move_lambda_by(&self, path: &[f32], at: &Point, goal: Goal) -> f64 {
        let (chi2_path, chi2_step) = self.slopes(path, at);
        lambda_step(at, chi2_path, chi2_step, goal)
    }

    /// Minus the gradient of the merit after this change of ln(lambda), in the metric.
    pub fn right_after(&self, move_lambda: f64, at: &Point) -> Vec<f32> {
        let change = (move_lambda * at.lambda) as f32;
        combined(&self.right, &self.chi2_gradient, |right, g| right - change * g)
    }

    /// Whether the estimated remaining error, in `S/lambda - chi2/2` or in the chi2/2 equivalent of spottedness, is
    /// below `tolerance`.
    pub fn is_within(
        &self,
        tolerance: f64,
        at: &Point,
        goal: Goal,
        preconditioner: &Preconditioner,
        entropy: Entropy,
        area: &[f64],
    ) -> bool {
        // for most steps this is known without the preconditioner
        if self.known_error >= tolerance {
            return false;
        }
        let mut left = self.right_after(self.move_lambda, at);
        if matches!(goal, Goal::Chi2 { .. }) {
            // a pixel held at its bound is not an error that steps could reduce
            let lowest = entropy.lowest_coordinate();
            combine(&mut left, &at.u, |left, u| if u <= lowest && left < 0.0 { 0.0 } else { left });
        }
        let (spanned, rest) = preconditioner.norms(at.lambda, &left);
        let [of_spanned, of_rest] = self.merit_errors;
        let faint = self.faint(&left, at, entropy, area);
        self.known_error + 0.5 * (of_spanned * (spanned + faint) + of_rest * rest) / at.lambda < tolerance
    }

    /// Difference between twice the merit to be gained by pixels that return to the default and the squared norm of
    /// `left`. The metric is of second order, and negligible where a pixel has been pushed far into the dark.
    fn faint(&self, left: &[f32], at: &Point, entropy: Entropy, area: &[f64]) -> f64 {
        let (mut lacking, default) = (0.0, entropy.default_coordinate());
        for (((left, scale), area), u) in left.iter().zip(&self.scale).zip(area).zip(&at.u) {
            let (left, per_change) = (f64::from(*left), f64::from(*scale) * area);
            if left > per_change && *u < default {
                // beyond the default the gain of a pixel depends on the data
                let change = (left / per_change).min(default - u);
                lacking += (2.0 * area * entropy.gain(*u, change) - left * left).max(0.0);
            }
        }
        lacking
    }

    /// Change of chi2/2 per change of spottedness along the path (negative).
    fn worth(&self) -> f64 {
        0.5 * self.chi2_path / self.spottedness_path
    }

    /// Approximate log-likelihood of this solution below `best`.
    pub fn below(&self, best: &Best, at: &Point, goal: Goal) -> f64 {
        match goal {
            Goal::Lambda(lambda) => best.merit - (at.entropy / lambda - 0.5 * at.chi2),
            Goal::Chi2 { target, .. } => {
                let misfit = 0.5 * (at.chi2 - target);
                let more = at.spottedness - best.spottedness;
                // along the path a misfit of chi2 is equivalent to spottedness
                misfit - more * self.worth()
            }
        }
    }
}

/// The gradients of chi2 / 2 and of the merit in the metric, computed in double precision.
struct IntoMetric<'a> {
    at: &'a Point,
    area: &'a [f64],
    /// Coordinate of the default.
    default: f64,
    scale: &'a [f32],
    /// Of chi2 / 2, with respect to the image.
    gradient: &'a [f64],
    /// The same in the metric.
    chi2_gradient: &'a mut [f32],
    /// Minus the gradient of the merit.
    right: &'a mut [f32],
}

impl Task for IntoMetric<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) {
        let IntoMetric { at: Point { u, lambda, .. }, area, default, scale, gradient, chi2_gradient, right } = self;
        let given = u.iter().zip(area).zip(scale.iter().zip(gradient));
        for ((g, right), ((u, area), (scale, gradient))) in chi2_gradient.iter_mut().zip(right).zip(given) {
            let scale = f64::from(*scale);
            *g = (scale * gradient) as f32;
            *right = (-scale * (area * (u - default) + lambda * gradient)) as f32;
        }
    }
}

/// Change of ln(lambda) for which the linearised chi2 meets the target; 0 if chi2 is not the goal.
pub(super) fn lambda_step(at: &Point, chi2_path: f64, chi2_step: f64, goal: Goal) -> f64 {
    let Goal::Chi2 { target, largest_lambda } = goal else { return 0.0 };
    let wanted = if chi2_path < 0.0 {
        ((target - at.chi2 - chi2_step) / chi2_path).clamp(-LN_LAMBDA_CAP, LN_LAMBDA_CAP)
    } else {
        LN_LAMBDA_CAP * (at.chi2 + chi2_step - target).signum()
    };
    wanted.min((largest_lambda / at.lambda).ln().max(0.0)).max((SMALLEST_LAMBDA / at.lambda).ln())
}
