//! Consistency of the source tree, configs, examples and documents.

#[path = "../common/desk.rs"]
mod desk;

/// The program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_dimcmc");

mod architecture;
mod config;
mod docs;
mod examples;
mod reference;
mod release;
mod schema;
mod small;
mod words;
