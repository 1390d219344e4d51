//! Files in and out: LSD profiles, the journals of chains and landscapes, maps, tables, Zarr stores. No decisions are
//! taken here.

pub mod atomic;
pub mod csv;
pub mod effort;
pub mod journal;
pub mod landscape;
pub mod lines;
pub mod lsd;
pub mod map;
pub mod paraboloid;
pub mod periodogram;
pub mod provenance;
pub mod truth;
pub mod zarr;
pub mod zdipy;
