//! The blind search for a planet, the basis of every statement on one: how often do stars without a planet show an
//! equally high peak?
//!
//! In: a scene and [`BlindSearchOptions`]. Out: a [`BlindSearch`]. `periodogram` writes all of it ([`PeriodogramFile`]
//! with its tables); an optimum or a chain assumes a planet, so that `optimise`, `sample` and `batch` include its
//! [`SearchSummary`], whose verdict precedes their results.
//!
//! `priors` handles orbits that a config does not allow.

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
