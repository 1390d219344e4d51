//! Newton's method with preconditioned conjugate gradients for `max S subject to chi2 = target`, or at a given lambda
//! (`docs/method.md` section 2).
//!
//! Minimises `-S + lambda/2 chi2`. With the constraint, lambda and the image move together: the linearised constraint
//! gives the change of lambda, by the path `ds / d ln(lambda)` of solutions, and a solve gives the Newton step to
//! there. The path requires a second solve unless a nearby solution has one. The steps end where a first-order forecast
//! of the remaining change (`convergence`) is small enough. Every call starts only from the given image, so the result
//! is a function of problem and start.

use super::cg::{self, CgLimits};
use super::convergence::{Convergence, Guide, Point, SMALLEST_LAMBDA};
use super::entropy::{Entropy, MetricStep, Worth};
use super::preconditioner::Preconditioner;
use super::problem::{Curvature, Problem};
use super::solution::{Goal, Image, Solution, SolverSettings, Start, Termination};
use crate::numerics::vector::Number;
use crate::numerics::vector::linear::{combine, combine_two, dot, norm, rounded, scale_by, widened};

/// Largest change of a coordinate in one step.
const STEP_CAP: f32 = 2.0;

/// Largest change of ln(lambda) before the first Newton step.
const RESTORE_REACH: f64 = 0.3;

/// Number of first steps that use the path of a nearby solution; problems that need more were not close to it.
const KNOWN_PATH_STEPS: usize = 6;

/// An error below this fraction of chi2 is rounding, which no step reduces.
const ROUNDING: f64 = 1.5e-12;

/// Systems that are solved to this residual or a larger one are solved in single precision.
const LOOSE: f64 = 3e-3;

/// The exact curvature is used once a step changes less than this in `S/lambda - chi2/2`.
const EXACT_BELOW: f64 = 100.0;

/// The solver: entropy, preconditioner and settings.
#[derive(Clone, Debug)]
pub struct Solver<'a> {
    /// Entropy of the image.
    pub entropy: Entropy,
    /// Approximate inverse of the Newton systems.
    pub preconditioner: &'a Preconditioner,
    /// Precision and effort.
    pub settings: SolverSettings,
}

/// A Newton system in the entropy's metric.
#[derive(Clone, Copy)]
struct System<'a, N = f32> {
    lambda: f64,
    scale: &'a [N],
    curvature: Curvature,
}

/// A Newton step.
struct Newton {
    /// Change of the image, in the metric.
    step: Vec<f32>,
    /// Change of ln(lambda).
    move_lambda: f64,
    /// Newton decrement squared.
    decrement: f64,
}

impl Solver<'_> {
    /// Solves `problem` for `goal` from `start`.
    pub fn solve(&self, problem: &mut impl Problem, goal: Goal, start: Start) -> Solution {
        let Start { image, mut path, chi2_slope, adjoint, best } = start;
        let mut at = self.arrive(problem, image.coordinates, image.lambda);
        if let Goal::Lambda(lambda) = goal {
            at.lambda = lambda;
        }
        let mut at = self.restore(problem, at, goal, &path, chi2_slope);
        if let Goal::Chi2 { largest_lambda, .. } = goal {
            at.lambda = at.lambda.min(largest_lambda);
        }
        let (mut curvature, mut gradient) = (Curvature::GaussNewton, vec![0.0; at.u.len()]);
        for newton_steps in 0.. {
            if !(at.chi2.is_finite() && at.entropy.is_finite()) {
                return self.finish(at, None, Vec::new(), Termination::NonFinite, newton_steps);
            }
            let guide = Guide { path: &path, adjoint: &adjoint };
            let convergence = Convergence::of(problem, self.entropy, &at, goal, guide, &mut gradient);
            let drop = best.map_or(0.0, |best| convergence.below(&best, &at, goal));
            let tolerance = self.settings.tolerance_at(drop).max(ROUNDING * at.chi2);
            if convergence.is_within(tolerance, &at, goal, self.preconditioner, self.entropy, problem.area()) {
                let why = if convergence.at_bound { Termination::Unreachable } else { Termination::Converged };
                return self.finish(at, Some(convergence), path, why, newton_steps);
            }
            if newton_steps == self.settings.newton_steps {
                return self.finish(at, Some(convergence), path, Termination::StepLimit, newton_steps);
            }
            // at the bound of lambda there is no step along the path, whose last estimate is kept for later; and the
            // path of a nearby solution is good enough: its error in lambda is corrected by the next step
            let near_by = !adjoint.is_empty() && newton_steps < KNOWN_PATH_STEPS && convergence.chi2_path < 0.0;
            let mut move_lambda = convergence.move_lambda;
            if matches!(goal, Goal::Chi2 { .. }) && !convergence.at_bound && !near_by {
                self.solve_path(problem, &at, &convergence, curvature, &mut path);
                move_lambda = convergence.move_lambda_by(&path, &at, goal);
            }
            let newton = self.newton(problem, &at, &convergence, move_lambda, curvature);
            let decrement = newton.decrement;
            at = self.advance(problem, &at, &convergence.scale, newton);
            // far from the solution the curvature of the model may make the system indefinite, close to it the steps
            // become exact
            let near = 0.5 * decrement < EXACT_BELOW * at.lambda;
            curvature = if near { Curvature::Exact } else { Curvature::GaussNewton };
        }
        unreachable!("the loop returns")
    }

    /// The inverse of the Newton system at `image`, applied to the image-space vector `right`; the problem must be
    /// linearised there. For derivatives of solutions by adjoints.
    pub fn apply_inverse(&self, problem: &mut impl Problem, image: &Image, right: &[f64]) -> Vec<f64> {
        let scale = self.entropy.metric(&self.entropy.image(&image.coordinates), problem.area());
        let mut scaled = right.to_vec();
        combine(&mut scaled, &scale, |right, scale| right * f64::from(scale));
        let (norm, per_norm) = norm_of(&scaled);
        let (mut of_unit, mut z) = (rounded(&scaled, per_norm), vec![0.0; right.len()]);
        let system = System { lambda: image.lambda, scale: &scale, curvature: Curvature::Exact };
        self.solve_system(problem, system, &mut of_unit, &mut z);
        combine_two(&mut scaled, &z, &scale, |_, z, scale| norm * f64::from(z) * f64::from(scale));
        scaled
    }

    /// The path along lambda from a solution, and the slopes along it: at the bound of lambda, where the solver needs
    /// none, or to the precision of this solver's systems.
    pub fn find_path(&self, problem: &mut impl Problem, solution: &mut Solution) {
        let s = self.entropy.image(&solution.image.coordinates);
        let scale = self.entropy.metric(&s, problem.area());
        let mut gradient = vec![0.0; s.len()];
        problem.linearise(&s);
        problem.gradient(&mut gradient);
        let pull: Vec<f64> = gradient.iter().map(|g| -solution.image.lambda * g).collect();
        let step = self.apply_inverse(problem, &solution.image, &pull);
        solution.path = rounded(&step, 1.0);
        combine(&mut solution.path, &scale, |step, scale| step / scale);
        solution.chi2_slope = 2.0 * dot(&gradient, &step);
        solution.spottedness_slope = dot(&self.entropy.spottedness_gradient(&s, problem.area()), &step);
    }

    fn arrive(&self, problem: &mut impl Problem, u: Vec<f64>, lambda: f64) -> Point {
        let mut s = vec![0.0; u.len()];
        let worth = self.entropy.value(&u, problem.area(), &mut s);
        stand(problem, u, s, lambda, worth)
    }

    /// Moves by the step `length * z` in the metric of `scale`.
    fn step(
        &self,
        problem: &mut impl Problem,
        at: &Point,
        (z, scale): (&[f32], &[f32]),
        length: f64,
        lambda: f64,
    ) -> Point {
        let (mut u, mut s) = (vec![0.0; at.u.len()], vec![0.0; at.u.len()]);
        let step = MetricStep { u: &at.u, image: &at.s, z, scale, length: length as f32, cap: STEP_CAP };
        let worth = self.entropy.advance(step, problem.area(), &mut u, &mut s);
        stand(problem, u, s, lambda, worth)
    }

    /// Moves along the path to where chi2 meets the goal by its slope: one pass that saves a Newton step.
    fn restore(&self, problem: &mut impl Problem, at: Point, goal: Goal, path: &[f32], chi2_slope: f64) -> Point {
        let Goal::Chi2 { target, .. } = goal else { return at };
        let move_lambda = (target - at.chi2) / chi2_slope;
        let worth_it = 0.5 * (target - at.chi2).abs() * self.settings.cg_tolerance > self.settings.tolerance;
        if path.len() != at.u.len() || !worth_it || move_lambda.is_nan() || move_lambda.abs() > RESTORE_REACH {
            return at;
        }
        let scale = self.entropy.metric(&at.s, problem.area());
        self.step(problem, &at, (path, &scale), move_lambda, at.lambda * move_lambda.exp())
    }

    /// The path along lambda, from a guess or from zero.
    fn solve_path(
        &self,
        problem: &mut impl Problem,
        at: &Point,
        convergence: &Convergence,
        curvature: Curvature,
        path: &mut Vec<f32>,
    ) {
        path.resize(at.u.len(), 0.0);
        let mut pull: Vec<f32> = convergence.chi2_gradient.iter().map(|g| -at.lambda as f32 * g).collect();
        self.solve_system(problem, System { lambda: at.lambda, scale: &convergence.scale, curvature }, &mut pull, path);
    }

    /// The Newton step with the given change of lambda.
    fn newton(
        &self,
        problem: &mut impl Problem,
        at: &Point,
        convergence: &Convergence,
        move_lambda: f64,
        curvature: Curvature,
    ) -> Newton {
        let (mut right, mut step) = (convergence.right_after(move_lambda, at), vec![0.0; at.u.len()]);
        let system = System { lambda: at.lambda, scale: &convergence.scale, curvature };
        let norm = self.solve_system(problem, system, &mut right, &mut step);
        // the right-hand side has unit length now
        Newton { decrement: (norm * dot(&step, &right)).max(0.0), step, move_lambda }
    }

    /// Solves a system from the start `z`. The right-hand side is scaled to unit length, to stay within the range of
    /// single precision; returns its former length. High precision uses double precision, but right-hand side and
    /// solution are in single precision even then, which later steps correct.
    fn solve_system(&self, problem: &mut impl Problem, system: System, right: &mut [f32], z: &mut [f32]) -> f64 {
        let (norm, per_norm) = norm_of(right);
        scale_by(per_norm, right);
        let System { lambda, scale, curvature } = system;
        if self.settings.cg_tolerance < LOOSE {
            let (mut double, scale) = (widened(z), widened(scale));
            scale_by(per_norm, &mut double);
            self.solve_with(problem, System { lambda, scale: &scale, curvature }, &widened(right), &mut double);
            combine(z, &double, |_, double| (norm * double) as f32);
        } else {
            scale_by(per_norm, z);
            self.solve_with(problem, system, right, z);
            scale_by(norm, z);
        }
        norm
    }

    /// The same in the precision of its arguments.
    fn solve_with<N: Number>(&self, problem: &mut impl Problem, system: System<N>, right: &[N], z: &mut [N]) {
        let System { lambda, scale, curvature } = system;
        let mut scaled = vec![N::default(); right.len()];
        let factor = N::of(lambda);
        let apply = |v: &[N], out: &mut [N]| {
            combine_two(&mut scaled, v, scale, |_, v, scale| v * scale);
            problem.curvature(curvature, &scaled, out);
            combine_two(out, v, scale, |out, v, scale| v + factor * scale * out);
        };
        let precondition = |r: &[N], out: &mut [N]| self.preconditioner.apply(lambda, r, out);
        let limits = CgLimits { tolerance: self.settings.cg_tolerance, iterations: self.settings.cg_iterations };
        cg::solve(apply, precondition, right, z, limits);
    }

    /// Takes the step, halved until the merit function at the new lambda does not grow.
    fn advance(&self, problem: &mut impl Problem, at: &Point, scale: &[f32], newton: Newton) -> Point {
        let lambda = at.lambda * newton.move_lambda.exp();
        let merit = |p: &Point| -p.entropy + 0.5 * lambda * p.chi2;
        let before = merit(at);
        let mut length = 1.0;
        loop {
            let next = self.step(problem, at, (&newton.step, scale), length, lambda);
            let small = 1e-9 * before.abs() + self.settings.tolerance * lambda;
            if merit(&next) <= before + small || length < 1e-4 {
                return next;
            }
            length *= 0.5;
        }
    }

    fn finish(
        &self,
        at: Point,
        convergence: Option<Convergence>,
        path: Vec<f32>,
        termination: Termination,
        newton_steps: usize,
    ) -> Solution {
        let finite = at.chi2.is_finite() && at.entropy.is_finite() && at.lambda.is_finite();
        let (chi2_slope, spottedness_slope, spottedness_left) =
            convergence.map_or((0.0, 0.0, 0.0), |s| (s.chi2_path, s.spottedness_path, s.spottedness_left));
        Solution {
            termination: if finite { termination } else { Termination::NonFinite },
            chi2: at.chi2,
            entropy: at.entropy,
            spottedness: at.spottedness,
            spottedness_left,
            image: Image { coordinates: at.u, lambda: at.lambda },
            chi2_slope,
            spottedness_slope,
            path,
            newton_steps,
        }
    }
}

fn stand(problem: &mut impl Problem, u: Vec<f64>, s: Vec<f64>, lambda: f64, worth: Worth) -> Point {
    let (chi2, Worth { entropy, spottedness }) = (problem.linearise(&s), worth);
    Point { u, s, lambda: lambda.max(SMALLEST_LAMBDA), chi2, entropy, spottedness }
}

/// The norm and its inverse, 0 for the inverse of 0.
fn norm_of<N: Number>(right: &[N]) -> (f64, f64) {
    let norm = norm(right);
    (norm, if norm == 0.0 { 0.0 } else { norm.recip() })
}
