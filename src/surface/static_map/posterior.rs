//! The log-probability of a parameter vector: one maximum-entropy reconstruction, evaluated by one of three objectives
//! (`docs/method.md` section 3), times the prior; and its gradient.

use super::prediction::{Prediction, Solved};
use super::reference::{Reference, precondition, start};
use super::warm_start::{WarmStart, nearest, place, sampled, worthwhile};
use crate::maxent::{Goal, Preconditioner, Problem, Solution, Solver, SolverSettings, Start, Termination};
use crate::model::ParameterSpace;
use crate::model::{Parameter, ParameterValues};
use crate::sampling::log_density::{Evaluation, Gradient, LogDensity, Status};
use crate::star::response::{MOST_NODES, MOST_STEPS_PER_BIN, velocity_grid};
use crate::star::{Nearby, Response, Seen};
use crate::surface::imaging::{Imager, ImagingProblem};
use crate::surface::objective::ObjectiveKind;
use rayon::prelude::*;
use std::sync::Arc;

/// The posterior of the free parameters.
#[derive(Clone, Debug)]
pub struct Posterior {
    imager: Imager,
    space: ParameterSpace,
    kind: ObjectiveKind,
    reference: Reference,
    settings: SolverSettings,
    /// Starts of evaluations: the reference, and others.
    warm_starts: Vec<WarmStart>,
    /// The common part of responses of stars close to the reference; only if orbit and systemic velocity alone are
    /// free, so that pixels are computed once for all evaluations.
    nearby: Option<Arc<Nearby>>,
}

/// Name of the spottedness of the image, such as its fractional spot coverage. Where the target chi2 is reached, it is
/// a first-order forecast for the target, from which the log-probability follows.
pub const SPOTTEDNESS: &str = "spottedness";

/// Name of the chi2 of the image: near the target, where that is reached, within the accuracy of the forecast.
pub const CHI2: &str = "chi2";

/// Largest velocity of any latitude (km/s, projected); beyond it a parameter vector is unphysical.
const LARGEST_VSINI_KMS: f64 = 2000.0;

/// Newton steps from a warm start before an evaluation restarts from a blank star; in the vicinity it takes 2 to 5.
const NEWTON_STEPS: usize = 25;

/// Step of numerical derivatives of forward models, as a fraction of a coordinate's natural scale.
const DERIVATIVE_STEP: f64 = 0.05;

/// Precision of images for a second order.
const BEND_TOLERANCE: f64 = 1e-6;

impl Posterior {
    /// The posterior of `space` under `imager`'s data, by the objective `kind` relative to `reference`.
    #[doc(hidden)]
    pub fn new(imager: Imager, space: ParameterSpace, kind: ObjectiveKind, reference: Reference) -> Self {
        // the reference's pixels are valid only if its fixed parameters are those of the space
        let here = space.values_at(&space.theta_of(&reference.values));
        let velocities_only = Parameter::ALL.iter().all(|&p| p.only_shifts() || here.get(p) == reference.values.get(p))
            && space.free().iter().all(|f| f.parameter.only_shifts());
        let settings = SolverSettings::default();
        let nearby = (!velocities_only).then(|| Arc::new(imager.nearby(&here.state())));
        let warm_starts = Vec::new();
        let mut posterior = Posterior { imager, space, kind, reference, settings, warm_starts, nearby };
        let Posterior { space, reference, .. } = &posterior;
        let (theta, solution) = (space.theta_of(&reference.values), &reference.solution);
        let (response, preconditioner) = (&reference.response, reference.preconditioner.clone());
        let mut warm_start = posterior.warm_start(theta, response, solution, preconditioner);
        if velocities_only && kind != ObjectiveKind::RegularisedLikelihood {
            warm_start.prediction = posterior.second_order(&warm_start);
        }
        posterior.warm_starts = vec![warm_start];
        posterior
    }

    /// The same posterior with warm starts at `thetas` (physical coordinates) besides the reference, and no others:
    /// evaluations start from the nearest. Points without an image get none.
    #[doc(hidden)]
    pub fn with_warm_starts(mut self, thetas: &[Vec<f64>]) -> Self {
        self.warm_starts.truncate(1);
        let more = thetas.par_iter().with_max_len(1).filter_map(|theta| self.another_warm_start(theta));
        let more: Vec<WarmStart> = more.collect();
        self.warm_starts.extend(more);
        self
    }

    /// Positions of its warm starts, except the reference (physical coordinates).
    #[doc(hidden)]
    pub fn warm_starts(&self) -> impl Iterator<Item = &[f64]> {
        self.warm_starts[1..].iter().map(|warm_start| warm_start.theta.as_slice())
    }

    /// The same posterior with the warm starts that pay off for so many `evaluations`, spread like `thetas`.
    #[doc(hidden)]
    pub fn with_warm_starts_for(self, thetas: &[Vec<f64>], evaluations: usize) -> Self {
        let thetas: Vec<&Vec<f64>> = sampled(thetas).into_iter().filter(|theta| self.is_physical(theta)).collect();
        let places: Vec<Vec<f64>> = thetas.iter().map(|theta| place(&self.imager, &self.space, theta)).collect();
        let chosen = worthwhile(&self.warm_starts[0], &places, evaluations);
        let chosen: Vec<Vec<f64>> = chosen.into_iter().map(|i| thetas[i].clone()).collect();
        self.with_warm_starts(&chosen)
    }

    fn another_warm_start(&self, theta: &[f64]) -> Option<WarmStart> {
        if !self.is_physical(theta) {
            return None;
        }
        let (solution, mut problem) = self.reconstruct(theta);
        if solution.termination == Termination::NonFinite {
            return None;
        }
        let preconditioner = precondition(&self.imager, &mut problem, &solution);
        // precise, even far below the best
        let settings = SolverSettings { leniency: 0.0, ..SolverSettings::patient() };
        let solver = Solver { entropy: self.imager.entropy, preconditioner: &preconditioner, settings };
        let mut solution = solver.solve(&mut problem, self.goal(), start(&solution));
        match solution.termination {
            // evaluations nearby start from here, whether this one reaches the target or not
            Termination::Converged | Termination::Unreachable => {
                Solver { settings: SolverSettings::exact(), ..solver }.find_path(&mut problem, &mut solution);
            }
            Termination::StepLimit | Termination::NonFinite => return None,
        }
        let warm_start = self.warm_start(theta.to_vec(), problem.response(), &solution, Arc::new(preconditioner));
        warm_start.prediction.is_finite().then_some(warm_start)
    }

    /// The warm start of a solution.
    fn warm_start(
        &self,
        theta: Vec<f64>,
        response: &Response,
        solution: &Solution,
        preconditioner: Arc<Preconditioner>,
    ) -> WarmStart {
        let Posterior { imager, space, kind, reference, .. } = self;
        // at the bound of lambda the image moves at that lambda
        let goal = match solution.termination {
            Termination::Unreachable => Goal::Lambda(solution.image.lambda),
            _ => self.goal(),
        };
        let solved = Solved { theta: &theta, response, goal, solution, preconditioner: &preconditioner };
        let prediction = Prediction::new(imager, space, solved, *kind, |theta| self.response(theta));
        let start = Start { best: Some(reference.best()), ..start(solution) };
        WarmStart { place: place(imager, space, &theta), theta, start, preconditioner, prediction }
    }

    /// A warm start's prediction to second order. For orbits around the reference it saves more model applications than
    /// it costs (a quarter of those of an evaluation). Rotation, inclination and vsini change maps too much within
    /// their uncertainties: in 7-D it saves none; nor does it at a fixed lambda, where the residual of the first order
    /// is small.
    fn second_order(&self, warm_start: &WarmStart) -> Prediction {
        let settings = SolverSettings { tolerance: BEND_TOLERANCE, leniency: 0.0, ..SolverSettings::patient() };
        let solve = |x: &[f64]| {
            let theta = Some(self.space.to_physical(x)).filter(|theta| self.is_physical(theta))?;
            let solution =
                self.solve_near(warm_start, &theta, settings, &mut self.imager.problem(self.response(&theta)));
            (solution.termination == Termination::Converged).then_some(solution.image)
        };
        warm_start.prediction.clone().with_second_order(&self.imager, &warm_start.start, solve)
    }

    /// The same posterior with other solver settings than those of a chain.
    #[doc(hidden)]
    pub fn with_settings(self, settings: SolverSettings) -> Self {
        Posterior { settings, ..self }
    }

    /// The reference.
    #[doc(hidden)]
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The objective.
    #[doc(hidden)]
    pub fn kind(&self) -> ObjectiveKind {
        self.kind
    }

    /// The parameter space.
    #[doc(hidden)]
    pub fn space(&self) -> &ParameterSpace {
        &self.space
    }

    /// Star and data.
    #[doc(hidden)]
    pub fn imager(&self) -> &Imager {
        &self.imager
    }

    fn response(&self, theta: &[f64]) -> Response {
        let state = self.space.values_at(theta).state();
        match &self.nearby {
            Some(nearby) => self.imager.response_near(nearby, &state),
            None => self.imager.with_velocities(&self.reference.response, &state),
        }
    }

    /// Whether profiles can be computed at `theta`.
    pub(super) fn is_physical(&self, theta: &[f64]) -> bool {
        is_physical(&self.imager, &self.space.values_at(theta), theta)
    }

    fn nearest(&self, theta: &[f64]) -> &WarmStart {
        nearest(&self.warm_starts, &self.imager, &self.space, theta)
    }

    pub(super) fn goal(&self) -> Goal {
        self.reference.goal(self.kind)
    }

    /// The reconstruction at `theta`, without the prior.
    #[doc(hidden)]
    pub fn reconstruct(&self, theta: &[f64]) -> (Solution, ImagingProblem<'_>) {
        let mut problem = self.imager.problem(self.response(theta));
        let solution = self.solve_near(self.nearest(theta), theta, self.settings, &mut problem);
        if solution.termination != Termination::StepLimit {
            return (solution, problem);
        }
        // so far from all warm starts that a blank star is the better start
        let none = Preconditioner::identity();
        let settings = SolverSettings { cg_iterations: SolverSettings::patient().cg_iterations, ..self.settings };
        let far = Solver { preconditioner: &none, settings, entropy: self.imager.entropy };
        let solution = far.solve(&mut problem, self.goal(), self.reference.blank(&self.imager));
        (solution, problem)
    }

    /// The solution of the problem at `theta` from a warm start, in a few steps or not at all.
    fn solve_near(
        &self,
        warm_start: &WarmStart,
        theta: &[f64],
        settings: SolverSettings,
        problem: &mut ImagingProblem,
    ) -> Solution {
        let settings = SolverSettings { newton_steps: NEWTON_STEPS, ..settings };
        let near = Solver { preconditioner: &warm_start.preconditioner, settings, entropy: self.imager.entropy };
        let internal = self.space.to_sampling(theta);
        let start = warm_start.prediction.start(&self.imager, &warm_start.start, &internal);
        near.solve(problem, self.goal(), start)
    }

    /// The evaluation from a reconstruction with so many model applications, including the prior.
    fn evaluation(&self, solution: &Solution, model_applications: u32, log_prior: f64) -> Evaluation {
        let numbers = vec![self.spottedness(solution), solution.chi2];
        let likelihood = self.judged(solution, numbers, model_applications);
        Evaluation { log_prob: likelihood.log_prob + log_prior, ..likelihood }
    }

    /// Prior and physics, before any reconstruction: the prior's log-density, or why `theta` is refused.
    fn admit(&self, theta: &[f64]) -> Result<f64, Evaluation> {
        let log_prior = self.space.log_prior(theta);
        if log_prior == f64::NEG_INFINITY {
            return Err(Evaluation::rejected(Status::OutsidePrior));
        }
        if !(log_prior.is_finite() && self.is_physical(theta)) {
            return Err(Evaluation::rejected(Status::NonFinite));
        }
        Ok(log_prior)
    }

    /// Derivatives of ln L with the forward model at a fixed map: `weight_chi2 * chi2 + slope along direction`.
    ///
    /// Regularised likelihood and entropy are extrema over maps, so that only chi2 counts (envelope theorem).
    /// Spottedness is not: with `A'` the gradient of spottedness and the constraint chi2 = target, the adjoint system
    /// `H y = A' - 2 mu g`, `g y = 0` (g the gradient of chi2/2) gives `dA = -lambda d(g y) - mu d(chi2)`. The
    /// solution's path is recomputed: the solver is satisfied with that of a neighbouring solution.
    fn sensitivity(
        &self,
        theta: &[f64],
        mut solution: Solution,
        problem: &mut ImagingProblem,
    ) -> (f64, Option<Vec<f64>>) {
        let curve_slope = self.log_likelihood(&solution).1;
        let lambda = solution.image.lambda;
        let unreachable = solution.termination != Termination::Converged;
        match self.kind {
            ObjectiveKind::RegularisedLikelihood | ObjectiveKind::MarginalLikelihood => (-0.5, None),
            // ln L = (chi2_curve(-S) - target)/2 and dS = -(lambda/2) dchi2
            ObjectiveKind::Entropy if !unreachable => (0.25 * curve_slope * lambda, None),
            // beyond the reach of the target: the leading term of its misfit
            _ if unreachable => (-0.5, None),
            _ => {
                let (entropy, area) = (self.imager.entropy, &self.imager.areas);
                let image = entropy.image(&solution.image.coordinates);
                let scale = entropy.metric(&image, area);
                let preconditioner = &self.nearest(theta).preconditioner;
                let exact = Solver { entropy, preconditioner, settings: SolverSettings::exact() };
                exact.find_path(problem, &mut solution);
                let inverse =
                    exact.apply_inverse(problem, &solution.image, &entropy.spottedness_gradient(&image, area));
                let mu = solution.spottedness_slope / solution.chi2_slope;
                let weight = -0.5 * curve_slope * lambda;
                let adjoint = |(p, h): (usize, &f64)| -> f64 {
                    weight * (h + 2.0 * mu / lambda * f64::from(solution.path[p]) * f64::from(scale[p]))
                };
                let direction = inverse.iter().enumerate().map(adjoint).collect();
                (-0.5 * curve_slope * mu, Some(direction))
            }
        }
    }
}

/// Whether profiles can be computed at `values`, whose free ones are `theta`.
pub fn is_physical(imager: &Imager, values: &ParameterValues, theta: &[f64]) -> bool {
    let pole_over_equator = 1.0 - values[Parameter::DOmega] / values[Parameter::OmegaEq];
    let fastest = values[Parameter::Vsini] * pole_over_equator.abs().max(1.0);
    if !Parameter::ALL.iter().filter_map(|&p| values.get(p)).chain(theta.iter().copied()).all(f64::is_finite) {
        return false;
    }
    let state = values.state();
    let is_seen = |set: &Seen| {
        let star = set.star(&imager.star, &state.surface);
        let (steps, nodes) = velocity_grid(&star, &state, set.sampling.step_kms);
        nodes <= MOST_NODES && steps <= MOST_STEPS_PER_BIN && star.is_possible()
    };
    imager.sets.iter().all(is_seen)
        && fastest.is_finite()
        && fastest <= LARGEST_VSINI_KMS
        && values[Parameter::Vsini] > 0.0
        && state.motion.orbits().all(|planet| planet.orbit.porb_over_prot > 0.0 && planet.shape.eccentricity() < 1.0)
}

impl LogDensity for Posterior {
    fn names(&self) -> &[String] {
        self.space.names()
    }

    fn number_names(&self) -> &[&str] {
        &[SPOTTEDNESS, CHI2]
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        match self.admit(theta) {
            Err(refused) => refused,
            Ok(log_prior) => {
                let (solution, problem) = self.reconstruct(theta);
                self.evaluation(&solution, problem.model_applications(), log_prior)
            }
        }
    }

    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        self.space.to_sampling(theta)
    }

    fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        self.space.to_physical(internal)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.space.log_jacobian(theta)
    }
}

impl Gradient for Posterior {
    fn evaluate_with_gradient(&self, theta: &[f64]) -> (Evaluation, Vec<f64>) {
        let log_prior = match self.admit(theta) {
            Ok(log_prior) => log_prior,
            Err(refused) => return (refused, Vec::new()),
        };
        let (solution, mut problem) = self.reconstruct(theta);
        let evaluation = self.evaluation(&solution, problem.model_applications(), log_prior);
        if evaluation.log_prob == f64::NEG_INFINITY {
            return (evaluation, Vec::new());
        }
        let image = self.imager.entropy.image(&solution.image.coordinates);
        let (weight, direction) = self.sensitivity(theta, solution, &mut problem);
        let internal = self.space.to_sampling(theta);
        let response = problem.response().clone();
        let at_fixed_map = |i: usize, h: f64| {
            let mut shifted = internal.clone();
            shifted[i] += h;
            let shifted = self.space.to_physical(&shifted);
            let response = if self.space.free()[i].parameter.only_shifts() {
                let state = self.space.values_at(&shifted).state();
                self.imager.with_velocities(&response, &state)
            } else {
                self.response(&shifted)
            };
            let mut problem = self.imager.problem(response);
            let chi2 = problem.linearise(&image);
            let prior = Some(self.space.log_prior(&shifted)).filter(|p| p.is_finite()).unwrap_or(log_prior);
            prior + weight * chi2 + direction.as_ref().map_or(0.0, |y| problem.slope(y))
        };
        let scales = self.space.scales();
        let derivative = |i: usize| {
            let h = DERIVATIVE_STEP * scales[i];
            (at_fixed_map(i, h) - at_fixed_map(i, -h)) / (2.0 * h)
        };
        let gradient = (0..scales.len()).map(derivative).collect();
        (evaluation, gradient)
    }

    fn scales(&self) -> Vec<f64> {
        self.space.scales()
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.space.sampling_bounds()
    }
}
