//! General numerics, independent of stars.
//!
//! In: slices of numbers. Out: the same numbers on every machine by vector instructions chosen at run time
//! ([`vector`]), radians and km/s from other units ([`units`]), probabilities ([`normal`]), tables for a terminal
//! ([`text`]), numbers from files with missing values ([`json`]), sums in logarithms ([`logarithms`]), lazy values
//! ([`once`]), [`quantile`]s.

pub mod json;
pub mod logarithms;
pub mod normal;
pub mod once;
pub mod quantile;
pub mod text;
pub mod units;
pub mod vector;
