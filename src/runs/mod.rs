//! Operations on a scene: chains and grids on disk that can be stopped and resumed, alone or many.
//!
//! In: a scene (`data::scene`), or the folder of an earlier command. Out: files of a folder.
//!
//! 1. [`pool`] distributes evaluations over threads, or over the ranks of a cluster.
//! 2. [`mod@fitted`] is the fit of the star to the profiles, cached for the next command; [`origin`] and [`manifest`]
//!    record how the results of a folder were begun.
//! 3. [`run`] is a chain on disk, [`grid_scan`] a likelihood grid, [`optimum`] the maximum, [`maps`] the star there,
//!    [`simulated`] a simulation; [`blind_search`] and [`limits`] are searches for orbits, [`detection_limits`] runs
//!    the latter, [`injected`] injects an orbit into profiles, [`plan`] forecasts the constraints of planned profiles.
//!    [`log_posterior`] is the density of a chain for other samplers.
//! 4. [`merge`] joins runs of one star, [`batch`] samples many stars, [`comparison`] compares a chain with a likelihood
//!    grid. [`survey`] computes the rate of planets in a sample.
//! 5. [`export`] writes a chain for other programs. A new format is another file there, and a variant of `Format` in
//!    `export/mod.rs`.

pub mod batch;
pub mod blind_search;
pub mod comparison;
pub mod detection_limits;
pub mod export;
pub mod fitted;
pub mod grid_scan;
pub mod injected;
pub mod limits;
pub mod log_posterior;
pub mod manifest;
pub mod maps;
pub mod merge;
pub mod optimum;
pub mod origin;
pub mod plan;
pub mod pool;
pub mod run;
pub mod simulated;
pub mod survey;
