//! What is done with a scene: chains and grids on disk that can be stopped and resumed, alone or many.
//!
//! In: a scene (`data::scene`), or a folder that an earlier command wrote. Out: files of a folder.
//!
//! 1. [`pool`] spreads evaluations over threads, or over the ranks of a `cluster`.
//! 2. [`mod@fitted`] is what the profiles say of the star, kept for the next command; [`origin`] and [`manifest`] are
//!    what a folder was begun with.
//! 3. [`run`] is a chain on disk, [`grid_scan`] a landscape, [`optimum`] the highest point, [`maps`] the star there,
//!    [`simulated`] what it was made with; [`blind_search`] and [`limits`] are searches for orbits,
//!    [`detection_limits`] carries out the latter, [`injected`] puts an orbit into profiles, [`plan`] is what profiles
//!    not yet taken would show. [`log_posterior`] is the density of a chain for other samplers.
//! 4. [`merge`] joins runs of one star, [`batch`] makes those of many, [`comparison`] compares a chain with a
//!    landscape. [`survey`] has the rate of planets in a sample.
//! 5. [`export`] writes a chain for other programs. A new format is a file of it, and a variant of `Format` in
//!    `export/mod.rs`.

pub mod batch;
pub mod blind_search;
#[cfg(feature = "mpi")]
pub mod cluster;
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
