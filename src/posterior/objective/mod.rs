//! What a point of parameter space is worth: parameters, priors, trade-off curve, objectives (`docs/method.md` section
//! 3).

pub mod coordinates;
pub mod elements;
pub mod kind;
mod likelihood;
pub mod orbital;
pub mod parameters;
pub mod posterior;
mod prediction;
pub mod prior;
mod quantile;
mod quoted;
pub mod reference;
pub mod target;
pub mod tradeoff;
mod warm_start;

pub use coordinates::{FreeParameter, ParameterSpace, for_blind_search, period_prior};
pub use elements::{Clock, Elements};
pub use kind::{ObjectiveKind, UnresolvedSpots};
pub use likelihood::NUMBERS as LIKELIHOOD_NUMBERS;
pub use orbital::{Estimate, OrbitQuantities, OrbitQuantity, definition, in_earths, quoted_definition};
pub use parameters::{Parameter, ParameterValues};
pub use posterior::{CHI2, Posterior, SPOTTEDNESS, is_physical};
pub use prior::Prior;
pub use quoted::Quoted;
pub use reference::{Reference, ReferenceError};
