//! From log-probabilities to chains, independent of the meaning of the parameters.
//!
//! 1. [`log_density`] is the sampled function: from a vector of parameters to a log-probability with its cost.
//! 2. [`optimise`] finds its maximum.
//! 3. [`ensemble`] samples it: `start`, then steps of `sampler` by proposals of `moves`, until `stop`.
//! 4. [`chain`] stores and summarises the samples.
//!
//! [`landscape`] is the same density on a grid. A new move is a file of `ensemble/moves`, whose `mod.rs` lists what it
//! needs.

pub mod chain;
pub mod ensemble;
pub mod landscape;
pub mod log_density;
pub mod optimise;
