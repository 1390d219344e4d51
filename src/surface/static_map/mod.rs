//! The static map: the star's brightness does not change within a season, and the map of maximum entropy at the target
//! chi2 represents all maps (`docs/method.md` sections 2 to 4; Petit et al. 2015).
//!
//! `reference` is the map at one vector of parameters, with its trade-off curve (`tradeoff`). `posterior` reconstructs
//! one map for each vector, starting from `prediction` and `warm_start`; `likelihood` is its ln L. `density` is sampled
//! by chains, in `counted` with unresolved spots as noise; `optimum` finds its maximum. `maps` compares maps with the
//! data, and `surface` is the interface.

mod counted;
mod density;
mod likelihood;
mod maps;
mod model;
mod optimum;
pub mod posterior;
mod prediction;
pub mod reference;
mod spots;
mod surface;
pub mod tradeoff;
mod warm_start;

pub use counted::SpotsCounted;
pub use likelihood::NUMBERS as LIKELIHOOD_NUMBERS;
pub use model::StaticMap;
pub use posterior::{CHI2, Posterior, SPOTTEDNESS, is_physical};
pub use reference::{Reference, ReferenceError};
pub use spots::UNRESOLVED_SPOTS;
