//! The program as users run it: one module for each command or task.

#[path = "../common/desk.rs"]
mod desk;
#[path = "../common/python.rs"]
mod python;
#[path = "../common/svg.rs"]
mod svg;

/// The program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_dimcmc");

mod batch;
mod bright_and_dark;
mod cli;
mod compare;
mod data_sets;
mod export;
mod exposures;
mod faults;
mod fuzzed;
mod grid;
mod import;
mod indicators;
mod init;
mod injection;
mod instruments;
mod known_planets;
mod light_curves;
mod limits;
mod maps;
mod marginal;
mod merge;
mod newcomer;
mod noise;
mod orbit_quantities;
mod periodogram;
mod plan;
mod plot;
mod profile_files;
mod regions;
mod report;
mod reread;
mod sample;
mod shared;
mod stopped;
mod story;
mod survey;
mod whole;
mod zero_points;
