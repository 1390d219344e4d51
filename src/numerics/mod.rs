//! Numbers, without a star in sight.
//!
//! In: slices of numbers. Out: the same numbers on every machine by vector instructions chosen at run time
//! ([`vector`]), radians and km/s from what people write ([`units`]), probabilities ([`normal`]), tables for a terminal
//! ([`text`]), numbers from files where some are none ([`json`]), sums of what only its logarithm can hold
//! ([`logarithms`]), what is found when it is first asked for ([`once`]), [`quantile`]s.

pub mod json;
pub mod logarithms;
pub mod normal;
pub mod once;
pub mod quantile;
pub mod text;
pub mod units;
pub mod vector;
