//! Simulated stars with three methods for the orbit of each: grid and paraboloid, chain, periodogram. Results are
//! stored.

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
