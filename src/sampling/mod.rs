//! Log-probabilities go in, chains come out. Nothing here knows what the parameters mean.
//!
//! 1. [`log_density`] is what is sampled: a vector of parameters to a log-probability with what it cost.
//! 2. [`optimise`] finds its maximum.
//! 3. [`ensemble`] walks over it: `start`, then steps of `sampler` by proposals of `moves`, until `stop`.
//! 4. [`chain`] keeps the walk and summarises it.
//!
//! [`landscape`] is the same density on a grid. A new move is a file of `ensemble/moves`, whose `mod.rs` lists what it
//! needs.

pub mod chain;
pub mod ensemble;
pub mod landscape;
pub mod log_density;
pub mod optimise;
