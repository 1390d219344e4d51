//! Numbers, without a star in sight: vector instructions chosen at run time, units, the normal
//! distribution, and text in columns.
//!
//! In: slices of numbers. Out: the same numbers on every machine ([`vector`]), radians and km/s from what people write
//! ([`units`]), tables for a terminal ([`text`]), numbers from files where some are none ([`json`]).

pub mod json;
pub mod normal;
pub mod text;
pub mod units;
pub mod vector;
