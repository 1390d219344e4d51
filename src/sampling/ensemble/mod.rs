//! The affine-invariant ensemble: `sampler` makes a step by one of the `moves`, from the positions of `start`; `stop`
//! has the loop of steps.
//!
//! Source: Goodman & Weare 2010 (stretch move), ter Braak 2006 (differential evolution), Foreman-Mackey et al. 2013
//! (halves in turn, so that walkers can be evaluated in parallel). Several independent ensembles run side by side.

pub mod moves;
pub mod sampler;
pub mod settings;
pub mod start;
pub mod stop;
mod streams;

pub use moves::{Mix, Move, MoveWeights, Proposal};
pub use sampler::{Sampler, State, Walker};
pub use settings::{MOST_STEPS, SamplerSettings};
pub use start::{Positions, StartDraw, draw_start, start_numbers};
pub use stop::{OnStep, RunError, StopPolicy, StopReason, run, sample};

use crate::sampling::log_density::Status;

/// Errors of the settings or the start of an ensemble.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EnsembleError {
    /// A setting has an impossible value.
    #[error("{key}: {problem}")]
    Setting {
        /// The key in the config.
        key: &'static str,
        /// The error, with the value found.
        problem: String,
    },
    /// The start (or the chain to resume) does not have the ensembles, walkers or parameters of the settings.
    #[error("{what}: {expected} expected, {found} found")]
    Shape {
        /// The counted item.
        what: String,
        /// The number required by the settings.
        expected: usize,
        /// The number found.
        found: usize,
    },
    /// The chain to resume has other parameters.
    #[error("the chain holds the parameters {found:?}, but {expected:?} are sampled")]
    Names {
        /// Names of the density.
        expected: Vec<String>,
        /// Names in the chain.
        found: Vec<String>,
    },
    /// The chain to resume has other values in its records.
    #[error("the chain holds {found:?} beside each log-probability, but the density gives {expected:?}")]
    Numbers {
        /// Names of the density's.
        expected: Vec<String>,
        /// Names in the chain.
        found: Vec<String>,
    },
    /// The evaluator stopped before the start was evaluated.
    #[error("stopped before the first step")]
    Stopped,
    /// The chain to resume has no complete step.
    #[error("the chain has no complete step to go on from")]
    NothingToResume,
    /// A coordinate of a start position is not finite.
    #[error("start of ensemble {ensemble}, walker {walker}: `{name}` is {value}, not a finite number")]
    StartNotFinite {
        /// The ensemble.
        ensemble: usize,
        /// The walker.
        walker: usize,
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
    },
    /// All walkers of an ensemble start at one value of a parameter, which no move can change.
    #[error("start of ensemble {ensemble}: all walkers have the same `{name}`; no move could ever change it")]
    StartNoSpread {
        /// The ensemble.
        ensemble: usize,
        /// The parameter.
        name: String,
    },
    /// The walkers of an ensemble lie in a plane that they could hardly leave.
    #[error("start of ensemble {ensemble}: over all walkers, `{name}` depends linearly on {others:?}")]
    StartDependent {
        /// The ensemble.
        ensemble: usize,
        /// The parameter that depends on those before it.
        name: String,
        /// The parameters before it.
        others: Vec<String>,
    },
    /// A start position has no finite log-probability.
    #[error("start of ensemble {ensemble}, walker {walker}: no finite log-probability ({status:?}) at {position}")]
    StartForbidden {
        /// The ensemble.
        ensemble: usize,
        /// The walker.
        walker: usize,
        /// How the evaluation ended.
        status: Status,
        /// `name = value` of every parameter.
        position: String,
    },
    /// The covariance for drawing a start is not a covariance of the parameters.
    #[error("the covariance of the start is not a positive definite {dimension} x {dimension} matrix")]
    StartCovariance {
        /// Number of parameters.
        dimension: usize,
    },
    /// No allowed position was found for a walker.
    #[error(
        "start of ensemble {ensemble}, walker {walker}: none of {tries} draws around {centre} lies inside the priors; \
         move the centre, widen the priors or narrow the start"
    )]
    StartOutside {
        /// The ensemble.
        ensemble: usize,
        /// The walker.
        walker: usize,
        /// Number of draws.
        tries: usize,
        /// `name = value` of the centre.
        centre: String,
    },
}

/// `name = value, ...` for messages.
fn describe(names: &[String], theta: &[f64]) -> String {
    names.iter().zip(theta).map(|(name, value)| format!("{name} = {value}")).collect::<Vec<_>>().join(", ")
}
