//! What is done with a scene: chains and grids on disk that can be stopped and resumed, alone or many.
//!
//! [`origin`] and [`manifest`] are what a folder was begun with. [`run`] is a chain on disk, [`grid_scan`] a landscape,
//! [`optimum`] the highest point, [`blind_search`] and [`limits`] searches for orbits; [`merge`] and [`batch`] are runs
//! of one star joined and runs of many, [`comparison`] two of them side by side, [`export`] a chain for other programs,
//! [`experiments`] the rows of the paper. [`pool`] spreads work over threads, or over the ranks of a cluster.

pub mod batch;
pub mod blind_search;
#[cfg(feature = "mpi")]
pub mod cluster;
pub mod comparison;
pub mod experiments;
pub mod export;
pub mod grid_scan;
pub mod limits;
pub mod manifest;
pub mod merge;
pub mod optimum;
pub mod origin;
pub mod pool;
pub mod run;
