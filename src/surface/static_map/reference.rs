//! The reference: the Doppler image at one point of parameter space that every evaluation starts from, with its
//! preconditioner and trade-off curve (`docs/method.md` sections 2 and 3).
//!
//! Built once, deterministically, before a chain begins; the chain never changes it.

use super::tradeoff::{Node, TradeOff};
use crate::maxent::{
    Best, Curvature, Goal, Preconditioner, Problem, Solution, Solver, SolverSettings, Start, Termination,
};
use crate::model::ParameterValues;
use crate::star::Response;
use crate::surface::imaging::Imager;
use crate::surface::objective::ObjectiveKind;
use std::sync::Arc;

/// Rank of the preconditioner of one map; directions beyond it have lambda x curvature below 1 on the setup of Petit et
/// al.
const PRECONDITIONER_RANK: usize = 112;

/// Directions with lambda x curvature below this need no preconditioning.
const SMALLEST_CURVATURE: f64 = 0.2;

/// Step in ln(lambda) between nodes of the trade-off curve.
const CURVE_STEP: f64 = 0.25;

/// Residual of the Newton systems on the path to a node: more steps, and fewer model applications. Slopes use one
/// precise solution.
const CURVE_CG_TOLERANCE: f64 = 0.05;

/// Reach of the trade-off curve in ln(lambda), to larger and to smaller lambda.
const CURVE_REACH: (f64, f64) = (1.1, 0.8);

/// Data become significant at lambda = this over their number, where the entropy of a spotted star equals that many
/// chi2. This and the lambdas below are in the entropy's unit.
const BLANK_LAMBDA: f64 = 3e-3;

/// A first preconditioner is built at this many times the target chi2, where images are cheap.
const FIRST_CHI2: f64 = 1.5;

/// chi2 per datum, all of them independent, that a map reaches: that of Petit et al.
const USUAL_CHI2: f64 = 0.97;

/// Tolerance of the image of a provisional reference: a worse one costs every evaluation that starts from it model
/// applications.
const PROVISIONAL_TOLERANCE: f64 = 1e-7;

/// A target is given up at lambda = this over the number of data, some twenty times that of the setup of Petit et al.
const HOPELESS_LAMBDA: f64 = 40.0;

/// chi2 per datum below that of any map of noisy data.
const OUT_OF_REACH: f64 = 1e-6;

/// A chi2 within this factor of the target is not the floor, wherever the solver stopped.
const ABOVE_TARGET: f64 = 1.001;

/// A provisional reference stops at lambda = this over the number of data: beyond, noise is turned into spots.
pub const PROVISIONAL_LAMBDA: f64 = 3.0;

/// The reference image with its preconditioner and curve.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The point of parameter space.
    pub values: ParameterValues,
    /// The response there.
    pub response: Response,
    /// The image at the target chi2.
    pub solution: Solution,
    /// Approximate inverse of the Newton systems around it.
    pub preconditioner: Arc<Preconditioner>,
    /// Trade-off between its chi2 and spottedness.
    pub tradeoff: TradeOff,
    /// Target of chi2.
    pub chi2_target: f64,
    /// Largest lambda of an evaluation: the end of the trade-off curve.
    pub largest_lambda: f64,
    /// Total number of applications of the response or its transpose.
    pub model_applications: u32,
}

/// Why there is no reference.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ReferenceError {
    /// No map fits the data that well.
    #[error(
        "the target chi2 of {target:.4} per datum is below the reachable floor: at these parameters the fit comes \
        down to \
         {floor:.5} per datum and no further"
    )]
    TargetBelowFloor {
        /// Target, per datum.
        target: f64,
        /// Smallest chi2 found, per datum.
        floor: f64,
    },
    /// The blank star already fits better than the target: data or uncertainties must be wrong.
    #[error(
        "a star without spots already fits with chi2 = {blank:.4} per datum, below the target of {target:.4}: the \
        errors \
         are too large (see observations.sigma_scale) or the target is too high"
    )]
    NothingToFit {
        /// Target, per datum.
        target: f64,
        /// chi2 of the unspotted star, per datum.
        blank: f64,
    },
    /// The solver failed.
    #[error("the maximum-entropy image did not converge: {}", why(*.0))]
    Solver(Termination),
}

/// Why there is no image, and what to check.
fn why(termination: Termination) -> &'static str {
    match termination {
        Termination::StepLimit => {
            "its steps ran out, as they do where the star is not that of the profiles; star.vsini_kms, star.line or \
            star.vsys_kms may be wrong, or imaging.chi2_target too low"
        }
        Termination::Unreachable => "imaging.chi2_target is out of reach",
        Termination::Converged | Termination::NonFinite => {
            "a number in it is not finite; look for data or errors that are much too large or too small"
        }
    }
}

impl ReferenceError {
    /// Whether the solver needed more steps than allowed, as happens where the model is far from the profiles.
    pub fn ran_out_of_steps(&self) -> bool {
        matches!(self, ReferenceError::Solver(Termination::StepLimit))
    }
}

impl Reference {
    /// The reference at `values` for the target `chi2_per_datum`.
    ///
    /// # Errors
    /// If no map reaches the target, or a blank star is below it already.
    pub fn build(imager: &Imager, values: ParameterValues, chi2_per_datum: f64) -> Result<Self, ReferenceError> {
        let data = imager.data.depth.len() as f64;
        let mut reference = Reference::approach(imager, values, chi2_per_datum, HOPELESS_LAMBDA)?;
        match reference.solution.termination {
            Termination::Converged => {}
            // out of steps close to the target: the exact solution is a few more away
            Termination::StepLimit if reference.solution.chi2 <= ABOVE_TARGET * reference.chi2_target => {}
            // a search for the floor that runs out of steps far from the target has found it precisely enough for a
            // message
            Termination::Unreachable | Termination::StepLimit
                if reference.solution.chi2 > ABOVE_TARGET * reference.chi2_target =>
            {
                let floor = reference.solution.chi2 / data;
                return Err(ReferenceError::TargetBelowFloor { target: chi2_per_datum, floor });
            }
            other => return Err(ReferenceError::Solver(other)),
        }
        let mut problem = imager.problem(reference.response.clone());
        let solver = Solver {
            entropy: imager.entropy,
            preconditioner: &reference.preconditioner,
            settings: SolverSettings::exact(),
        };
        let goal = Goal::Chi2 { target: reference.chi2_target, largest_lambda: f64::INFINITY };
        let mut solution = solver.solve(&mut problem, goal, reference.start());
        if solution.termination != Termination::Converged {
            return Err(ReferenceError::Solver(solution.termination));
        }
        // where no step remained, the path is that of a rougher solution
        solver.find_path(&mut problem, &mut solution);
        reference.tradeoff = follow(&solver, &mut problem, &solution);
        reference.largest_lambda = reference.tradeoff.nodes().last().expect("the reference itself").lambda;
        reference.solution = solution;
        reference.model_applications += problem.model_applications();
        Ok(reference)
    }

    /// A reference to begin a search with: without a trade-off curve (the regularised likelihood needs none), and with
    /// the final lambda where the target cannot be reached.
    ///
    /// # Errors
    /// If a blank star is below the target already, or the solver fails.
    pub fn provisional(imager: &Imager, values: ParameterValues, chi2_per_datum: f64) -> Result<Self, ReferenceError> {
        // a lower target belongs to data of which fewer are independent, which allow the larger weight
        let largest_lambda = PROVISIONAL_LAMBDA / (chi2_per_datum / USUAL_CHI2).min(1.0);
        let mut reference = Reference::approach(imager, values, chi2_per_datum, largest_lambda)?;
        if reference.solution.termination == Termination::NonFinite {
            return Err(ReferenceError::Solver(Termination::NonFinite));
        }
        let mut problem = imager.problem(reference.response.clone());
        let settings = SolverSettings { tolerance: PROVISIONAL_TOLERANCE, ..SolverSettings::patient() };
        let solver = Solver { entropy: imager.entropy, preconditioner: &reference.preconditioner, settings };
        let goal = Goal::Chi2 { target: reference.chi2_target, largest_lambda: reference.largest_lambda };
        let precise = solver.solve(&mut problem, goal, reference.start());
        if matches!(precise.termination, Termination::Converged | Termination::Unreachable) {
            reference.solution = precise;
        }
        // evaluations nearby use its path, which the last step has not updated
        Solver { settings: SolverSettings::exact(), ..solver }.find_path(&mut problem, &mut reference.solution);
        reference.tradeoff = TradeOff::new(vec![node(&reference.solution)], 0);
        reference.model_applications += problem.model_applications();
        Ok(reference)
    }

    /// The image at `lambda` over the number of data, whatever its chi2.
    ///
    /// # Errors
    /// If the solver fails.
    pub fn at_lambda(imager: &Imager, values: ParameterValues, lambda: f64) -> Result<Self, ReferenceError> {
        let reference = Reference::approach(imager, values, OUT_OF_REACH, lambda)?;
        match reference.solution.termination {
            Termination::Unreachable => Ok(reference),
            other => Err(ReferenceError::Solver(other)),
        }
    }

    /// The image at the target, or at `largest_lambda` over the number of data, from a blank star.
    fn approach(
        imager: &Imager,
        values: ParameterValues,
        chi2_per_datum: f64,
        largest_lambda: f64,
    ) -> Result<Self, ReferenceError> {
        let data = imager.data.depth.len() as f64;
        let (unit, over) = (imager.entropy.lambda_unit(), imager.data_as_of_one_map());
        let (chi2_target, largest_lambda) = (chi2_per_datum * data, unit * largest_lambda / over);
        let response = imager.response(&values.state());
        let mut problem = imager.problem(response.clone());
        let none = Preconditioner::identity();
        let coarse = Solver {
            entropy: imager.entropy,
            preconditioner: &none,
            settings: SolverSettings { tolerance: 5.0, cg_tolerance: 0.1, ..SolverSettings::patient() },
        };
        let blank = Start::blank(&imager.entropy, imager.areas.len(), unit * BLANK_LAMBDA / over);
        let blank_chi2 = problem.linearise(&imager.entropy.image(&blank.image.coordinates));
        if blank_chi2 <= chi2_target {
            return Err(ReferenceError::NothingToFit { target: chi2_per_datum, blank: blank_chi2 / data });
        }
        let goal = |target| Goal::Chi2 { target, largest_lambda };
        let easy = coarse.solve(&mut problem, goal((FIRST_CHI2 * chi2_target).min(blank_chi2)), blank);
        let preconditioner = precondition(imager, &mut problem, &easy);
        let fine =
            Solver { preconditioner: &preconditioner, settings: SolverSettings::patient(), entropy: imager.entropy };
        let solution = fine.solve(&mut problem, goal(chi2_target), start(&easy));
        let preconditioner = Arc::new(precondition(imager, &mut problem, &solution));
        let tradeoff = TradeOff::new(vec![node(&solution)], 0);
        let model_applications = problem.model_applications();
        Ok(Reference {
            values,
            response,
            largest_lambda,
            solution,
            preconditioner,
            tradeoff,
            chi2_target,
            model_applications,
        })
    }

    /// The goal of every evaluation by `kind`.
    pub fn goal(&self, kind: ObjectiveKind) -> Goal {
        match kind {
            ObjectiveKind::RegularisedLikelihood | ObjectiveKind::MarginalLikelihood => {
                Goal::Lambda(self.solution.image.lambda)
            }
            ObjectiveKind::Spottedness | ObjectiveKind::Entropy => {
                Goal::Chi2 { target: self.chi2_target, largest_lambda: self.largest_lambda }
            }
        }
    }

    /// A blank star, the start of an evaluation far from the reference.
    pub fn blank(&self, imager: &Imager) -> Start {
        let lambda = imager.entropy.lambda_unit() * BLANK_LAMBDA / imager.data_as_of_one_map();
        Start { best: Some(self.best()), ..Start::blank(&imager.entropy, imager.areas.len(), lambda) }
    }

    /// The start of an evaluation at the reference.
    pub fn start(&self) -> Start {
        Start { best: Some(self.best()), ..start(&self.solution) }
    }

    /// The solution with which evaluations elsewhere are compared.
    pub fn best(&self) -> Best {
        let Solution { spottedness, entropy, chi2, image, .. } = &self.solution;
        Best { spottedness: *spottedness, merit: entropy / image.lambda - 0.5 * chi2 }
    }
}

/// The start of the next solution from this one.
pub(super) fn start(solution: &Solution) -> Start {
    let Solution { image, path, chi2_slope, .. } = solution;
    Start { image: image.clone(), path: path.clone(), chi2_slope: *chi2_slope, adjoint: Vec::new(), best: None }
}

/// Eigenbasis of the curvature at a solution, in the entropy's metric.
pub(super) fn precondition(imager: &Imager, problem: &mut impl Problem, at: &Solution) -> Preconditioner {
    let s = imager.entropy.image(&at.image.coordinates);
    let scale = imager.entropy.metric(&s, problem.area());
    let (mut scaled, mut curved) = (vec![0.0f32; s.len()], vec![0.0f32; s.len()]);
    problem.linearise(&s);
    let (maps, pixels) = (imager.maps(), imager.grid.len());
    let smallest = SMALLEST_CURVATURE / at.image.lambda;
    Preconditioner::build(maps, pixels, PRECONDITIONER_RANK, smallest, |v, out| {
        scaled.iter_mut().zip(v).zip(&scale).for_each(|((x, v), d)| *x = *v as f32 * d);
        problem.curvature(Curvature::Exact, &scaled, &mut curved);
        out.iter_mut().zip(&curved).zip(&scale).for_each(|((out, x), d)| *out = f64::from(*x * d));
    })
}

/// Nodes of the trade-off curve, from small lambda to large, through `reference`.
fn follow(solver: &Solver, problem: &mut impl Problem, reference: &Solution) -> TradeOff {
    let settings = SolverSettings { cg_tolerance: CURVE_CG_TOLERANCE, ..solver.settings };
    let rough = Solver { settings, ..solver.clone() };
    let mut walk = |direction: f64, reach: f64| {
        let mut nodes = Vec::new();
        let mut at = reference.clone();
        while (at.image.lambda / reference.image.lambda).ln() * direction < reach {
            let target = at.chi2 + direction * CURVE_STEP * at.chi2_slope;
            let goal = Goal::Chi2 { target, largest_lambda: f64::INFINITY };
            let mut next = rough.solve(problem, goal, start(&at));
            if next.termination != Termination::Converged {
                break;
            }
            solver.find_path(problem, &mut next);
            nodes.push(node(&next));
            at = next;
        }
        nodes
    };
    let up = walk(1.0, CURVE_REACH.0);
    let mut nodes = walk(-1.0, CURVE_REACH.1);
    nodes.reverse();
    let here = nodes.len();
    nodes.push(node(reference));
    nodes.extend(up);
    TradeOff::new(nodes, here)
}

fn node(solution: &Solution) -> Node {
    Node {
        chi2: solution.chi2,
        spottedness: solution.spottedness,
        entropy: solution.entropy,
        lambda: solution.image.lambda,
        chi2_per_spottedness: solution.chi2_slope / solution.spottedness_slope,
    }
}
