//! The blind search for a planet that every statement on one rests on: how often do stars without a planet show as
//! much?
//!
//! In: a scene and [`BlindSearchOptions`]. Out: a [`BlindSearch`]. `periodogram` writes all of it ([`PeriodogramFile`]
//! with its tables); an optimum or a chain takes a planet for granted, so that `optimise`, `sample` and `batch` hold
//! its [`SearchSummary`], whose verdict heads theirs.
//!
//! `priors` is on orbits that a config does not allow.

mod files;
mod options;
mod priors;
mod quantities;
mod record;
mod search;
mod summary;
mod table;

pub use files::FILES;
pub use options::{BlindSearchError, BlindSearchOptions, RobustnessOf};
pub use quantities::QuantitiesRecord;
pub use record::{FILE, KnownPlanetRecord, LevelRecord, OrbitRecord, PeakRecord, PeriodogramFile};
pub use search::BlindSearch;
pub use summary::SearchSummary;
