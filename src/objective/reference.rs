//! The reference: the Doppler image at one point of parameter space that every evaluation starts from, with the
//! preconditioner and the trade-off curve that belong to it (method sections 2 and 3).
//!
//! Built once, deterministically, before a chain begins; never changed by it. Left out: how the point was found.

use super::parameters::ParameterValues;
use super::tradeoff::{Node, TradeOff};
use crate::imaging::Imager;
use crate::maxent::{Curvature, Goal, Preconditioner, Problem, Solution, Solver, SolverSettings, Start, Termination};
use crate::star::Response;

/// Rank of the preconditioner; directions beyond it have lambda x curvature below 1 on the paper's setup.
const PRECONDITIONER_RANK: usize = 120;

/// Directions with lambda x curvature below this need no preconditioning.
const SMALLEST_CURVATURE: f64 = 0.2;

/// Step in ln(lambda) between nodes of the trade-off curve.
const CURVE_STEP: f64 = 0.2;

/// Reach of the trade-off curve in ln(lambda), to larger and to smaller lambda.
const CURVE_REACH: (f64, f64) = (1.8, 4.0);

/// Lambda at which a target is given up, over the smallest lambda for which data begin to matter (1e-6).
const HOPELESS_LAMBDA: f64 = 1e4;

/// The reference image and what belongs to it.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The point of parameter space.
    pub values: ParameterValues,
    /// The response there.
    pub response: Response,
    /// The image at the target chi2.
    pub solution: Solution,
    /// Approximate inverse of the Newton systems around it.
    pub preconditioner: Preconditioner,
    /// How much chi2 its spottedness is worth.
    pub tradeoff: TradeOff,
    /// Target of chi2.
    pub chi2_target: f64,
    /// Largest lambda of an evaluation: the end of the trade-off curve.
    pub largest_lambda: f64,
}

/// Why there is no reference.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ReferenceError {
    /// No map fits the data that well.
    #[error(
        "the target chi2 of {target:.4} per datum is below the reachable floor: no map at these parameters gets below \
         {floor:.4} per datum"
    )]
    TargetBelowFloor {
        /// Target, per datum.
        target: f64,
        /// Smallest chi2 found, per datum.
        floor: f64,
    },
    /// The blank star already fits better than the target: data or errors cannot be right.
    #[error(
        "a star without spots already fits with chi2 = {blank:.4} per datum, below the target of {target:.4}: the errors \
         are too large (see observations.sigma_scale) or the target is too high"
    )]
    NothingToFit {
        /// Target, per datum.
        target: f64,
        /// chi2 of the unspotted star, per datum.
        blank: f64,
    },
    /// The solver failed.
    #[error("the maximum-entropy image did not converge ({0:?})")]
    Solver(Termination),
}

impl Reference {
    /// The reference at `values` for the target `chi2_per_datum`.
    pub fn build(imager: &Imager, values: ParameterValues, chi2_per_datum: f64) -> Result<Self, ReferenceError> {
        let data = imager.data.depth.len() as f64;
        let chi2_target = chi2_per_datum * data;
        let response = imager.response(&values.state());
        let mut problem = imager.problem(response.clone());
        let none = Preconditioner::identity();
        let coarse = Solver {
            entropy: imager.entropy,
            preconditioner: &none,
            settings: SolverSettings { cg_tolerance: 0.1, ..SolverSettings::default() },
        };
        let blank = coarse.blank(imager.grid.len());
        let mut unspotted = vec![0.0; imager.grid.len()];
        imager.entropy.image(&blank.image.logit, &mut unspotted);
        let blank_chi2 = problem.linearise(&unspotted);
        if blank_chi2 <= chi2_target {
            return Err(ReferenceError::NothingToFit { target: chi2_per_datum, blank: blank_chi2 / data });
        }
        let goal = |largest_lambda| Goal::Chi2 { target: chi2_target, largest_lambda };
        let first = coarse.solve(&mut problem, goal(HOPELESS_LAMBDA * blank.image.lambda), &blank);
        match first.termination {
            Termination::Converged => {}
            Termination::Unreachable => {
                return Err(ReferenceError::TargetBelowFloor { target: chi2_per_datum, floor: first.chi2 / data });
            }
            other => return Err(ReferenceError::Solver(other)),
        }
        let preconditioner = precondition(imager, &mut problem, &first);
        let exact = Solver { preconditioner: &preconditioner, settings: SolverSettings::exact(), ..coarse };
        let solution = exact.solve(&mut problem, goal(f64::INFINITY), &start(&first));
        if solution.termination != Termination::Converged {
            return Err(ReferenceError::Solver(solution.termination));
        }
        let preconditioner = precondition(imager, &mut problem, &solution);
        let solver = Solver {
            preconditioner: &preconditioner,
            settings: SolverSettings { tolerance: 1e-5, ..SolverSettings::default() },
            ..exact
        };
        let tradeoff = follow(&solver, &mut problem, &solution);
        let end = tradeoff.nodes().last().expect("the reference itself").lambda;
        Ok(Reference { values, response, largest_lambda: end, solution, preconditioner, tradeoff, chi2_target })
    }

    /// Where every evaluation starts.
    pub fn start(&self) -> Start {
        start(&self.solution)
    }
}

fn start(solution: &Solution) -> Start {
    Start { image: solution.image.clone(), path: solution.path.clone() }
}

/// Eigenbasis of the curvature at a solution, in the entropy's metric.
fn precondition(imager: &Imager, problem: &mut impl Problem, at: &Solution) -> Preconditioner {
    let n = at.image.logit.len();
    let (mut s, mut scale, mut scaled) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    imager.entropy.image(&at.image.logit, &mut s);
    imager.entropy.metric(&s, problem.area(), &mut scale);
    problem.linearise(&s);
    Preconditioner::build(n, PRECONDITIONER_RANK, SMALLEST_CURVATURE / at.image.lambda, |v, out| {
        scaled.iter_mut().zip(v).zip(&scale).for_each(|((x, v), d)| *x = v * d);
        problem.curvature(Curvature::Exact, &scaled, out);
        out.iter_mut().zip(&scale).for_each(|(x, d)| *x *= d);
    })
}

/// Nodes of the trade-off curve, from small lambda to large, through `reference`.
fn follow(solver: &Solver, problem: &mut impl Problem, reference: &Solution) -> TradeOff {
    let mut walk = |direction: f64, reach: f64| {
        let mut nodes = Vec::new();
        let mut at = reference.clone();
        while (at.image.lambda / reference.image.lambda).ln() * direction < reach {
            let target = at.chi2 + direction * CURVE_STEP * at.chi2_slope;
            let goal = Goal::Chi2 { target, largest_lambda: f64::INFINITY };
            let next = solver.solve(problem, goal, &start(&at));
            if next.termination != Termination::Converged {
                break;
            }
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
