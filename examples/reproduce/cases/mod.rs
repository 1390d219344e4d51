//! Simulated stars and the ways to the orbit of each: grid and paraboloid, chain, periodogram. What is done is kept.

pub mod case;
mod laboratory;
mod outcome;
mod star;

pub use case::{Case, Nodes};
pub use laboratory::{Interrupted, Laboratory};
pub use outcome::{ENDS, Estimate, Outcome, Route, share};
pub use star::{paper, with};

/// Why an experiment has no result.
pub type Failure = Box<dyn std::error::Error>;
