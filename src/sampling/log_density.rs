//! The interface between sampler and star: a vector of parameters in, a log-probability and a few named numbers out.
//!
//! The ensemble, the optimiser and the likelihood grid depend only on this file; the density of a surface model
//! implements it. Batches are evaluated by an [`Evaluator`], on the threads of one machine or the ranks of a cluster.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How one evaluation ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The reconstruction met its tolerances.
    Converged,
    /// The target chi2 cannot be reached at these parameters; the log-probability is the monotone continuation.
    Unreachable,
    /// Outside the prior: nothing was reconstructed and the log-probability is minus infinity.
    OutsidePrior,
    /// The reconstruction stopped short of its tolerances; rejected and counted as a failure.
    StoppedShort,
    /// A non-finite number appeared; rejected and counted as a failure.
    NonFinite,
}

impl Status {
    /// Whether the evaluation failed (as opposed to having given a log-probability, or being outside the prior).
    pub fn is_failure(self) -> bool {
        matches!(self, Status::StoppedShort | Status::NonFinite)
    }
}

/// The result of one evaluation.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// ln(likelihood) + ln(prior) in the coordinates of the parameters as named, in a likelihood grid ln(likelihood)
    /// only; minus infinity where not allowed, or failed.
    pub log_prob: f64,
    /// Other values, in the order of their names ([`LogDensity::number_names`]); none where it is minus infinity.
    pub numbers: Vec<f64>,
    /// Applications of the model or its transpose in this evaluation.
    pub model_applications: u32,
    /// How it ended.
    pub status: Status,
}

impl Evaluation {
    /// A log-probability without other values.
    pub fn of(log_prob: f64) -> Self {
        let status = if log_prob.is_nan() { Status::NonFinite } else { Status::Converged };
        Evaluation { log_prob, ..Evaluation::rejected(status) }
    }

    /// A failed evaluation: log-probability minus infinity, no numbers.
    pub fn rejected(status: Status) -> Self {
        Evaluation { log_prob: f64::NEG_INFINITY, numbers: Vec::new(), model_applications: 0, status }
    }

    /// Whether log-probability and numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.log_prob.is_finite() && self.numbers.iter().all(|x| x.is_finite())
    }
}

/// A posterior density over named parameters.
///
/// `theta` is always in the coordinates of [`LogDensity::names`] (the *written* coordinates). Samplers may move in
/// *internal* coordinates, a one-to-one map of the written ones given by `to_sampling` and `to_physical`.
pub trait LogDensity: Sync {
    /// Names of the parameters, in the order of every vector.
    fn names(&self) -> &[String];

    /// Names of the other values of an evaluation, in order. They are kept with every draw of a chain.
    fn number_names(&self) -> &[&str] {
        &[]
    }

    /// The log-posterior at `theta`. A pure function: the same bytes for the same `theta`, whatever was evaluated
    /// before.
    fn evaluate(&self, theta: &[f64]) -> Evaluation;

    /// Sampling coordinates of `theta`.
    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        theta.to_vec()
    }

    /// Physical coordinates of a point `x` in sampling ones, periodic ones wrapped into their range.
    fn to_physical(&self, x: &[f64]) -> Vec<f64> {
        x.to_vec()
    }

    /// ln |d(physical) / d(sampling)| at `theta`: the factor from a density in physical coordinates to one in sampling
    /// ones.
    fn log_jacobian(&self, _theta: &[f64]) -> f64 {
        0.0
    }
}

/// A density whose gradient costs only a few forward models.
pub trait Gradient: LogDensity {
    /// The evaluation at `theta`, and the gradient of its log-probability with respect to the sampling coordinates
    /// (empty where the log-probability is minus infinity).
    fn evaluate_with_gradient(&self, theta: &[f64]) -> (Evaluation, Vec<f64>);

    /// Natural steps of the sampling coordinates: the scale of a search.
    fn scales(&self) -> Vec<f64>;

    /// Bounds of the density in each sampling coordinate, in those coordinates; infinite where unbounded.
    fn bounds(&self) -> Vec<(f64, f64)>;
}

/// Evaluates a batch of parameter vectors; results are in the order of the vectors.
pub trait Evaluator {
    /// One evaluation per vector; or fewer, those of the first vectors, if a stop was requested meanwhile.
    fn evaluate(&self, batch: &[Vec<f64>]) -> Vec<Evaluation>;

    /// Counts evaluations made elsewhere; asked before each whether to continue.
    fn goes_on(&self, _evaluations: usize) -> bool {
        true
    }
}

/// Threads of this machine: one reconstruction is serial, a batch is spread over rayon's current pool.
pub struct Threads<'a, D: LogDensity + ?Sized>(pub &'a D);

impl<D: LogDensity + ?Sized> Evaluator for Threads<'_, D> {
    fn evaluate(&self, batch: &[Vec<f64>]) -> Vec<Evaluation> {
        batch.par_iter().with_max_len(1).map(|theta| self.0.evaluate(theta)).collect()
    }
}
