//! Chains: samples, their convergence, and their summary.
//!
//! [`Record`] is one line, [`Chain`] holds whole steps; `autocorrelation` and `convergence` give the effective sample
//! size, `summary` and `table` the results, `derived` those for derived quantities. All are functions of the chain's
//! content only.

pub mod advice;
pub mod autocorrelation;
pub mod convergence;
pub mod derived;
pub mod moves;
pub mod parameter;
pub mod record;
pub mod statistics;
pub mod store;
pub mod summary;
pub mod table;

pub use convergence::{Convergence, Diagnostic, Goals, ParameterKind};
pub use derived::{Derived, Settled};
pub use moves::MoveSummary;
pub use parameter::ParameterSummary;
pub use record::{MoveKind, Record, Shape};
pub use store::{Chain, Series};
pub use summary::{Summary, summarise};
pub use table::table;

/// Errors of a chain.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChainError {
    /// A line is not the next one.
    #[error(
        "expected step {}, ensemble {}, walker {} but found step {}, ensemble {}, walker {}",
        expected[0], expected[1], expected[2], found[0], found[1], found[2]
    )]
    Order {
        /// Step, ensemble and walker expected.
        expected: [usize; 3],
        /// Step, ensemble and walker found.
        found: [usize; 3],
    },
    /// A record has the wrong number of parameters, or of other values.
    #[error("expected {expected} values but found {found}")]
    Dimension {
        /// As many as there are names.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// A value is not finite.
    #[error("`{name}` is not finite at step {step}, ensemble {ensemble}, walker {walker}")]
    NotFinite {
        /// The quantity.
        name: String,
        /// The step.
        step: usize,
        /// The ensemble.
        ensemble: usize,
        /// The walker.
        walker: usize,
    },
    /// A step has the wrong number of lines.
    #[error("a step has {expected} lines (ensembles x walkers), not {found}")]
    StepSize {
        /// Ensembles x walkers.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// The chain is empty.
    #[error("the chain has no complete step")]
    Empty,
    /// A parameter kind is needed for every parameter.
    #[error("the chain has {expected} parameters but {found} parameter kinds were given")]
    Kinds {
        /// Number of parameters of the chain.
        expected: usize,
        /// Number of kinds given.
        found: usize,
    },
}
