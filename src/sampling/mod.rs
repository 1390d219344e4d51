//! Log-probabilities go in, chains come out. Nothing here knows what the parameters mean.
//!
//! [`log_density`] is the seam: a vector of parameters to a log-probability with what it cost. [`optimise`] climbs it,
//! [`ensemble`] walks it (start, moves, stop), [`chain`] keeps the walk and summarises it, [`landscape`] is the same
//! density on a grid.

pub mod chain;
pub mod ensemble;
pub mod landscape;
pub mod log_density;
pub mod optimise;
