//! Common parts of the benches: the paper's setup, a stopwatch, tables.
//!
//! Every bench prints Markdown tables for `results/performance.md`.
#![allow(dead_code)]

pub mod paper;
pub mod stopwatch;
pub mod table;

/// Whether this is `cargo bench`; `cargo test --benches` runs the benches as well, to check that they build.
pub fn wanted() -> bool {
    std::env::args().any(|argument| argument == "--bench")
}
