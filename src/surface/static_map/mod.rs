//! The static map: the star's brightness does not change within a season, and the map of maximum entropy at the target
//! chi2 stands for all maps (`docs/method.md` sections 2 to 4; Petit et al. 2015).

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
