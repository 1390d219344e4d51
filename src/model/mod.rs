//! The parameters of a star, its planets and its spots: their table, priors and sampling coordinates, and what is
//! quoted of an orbit (`docs/method.md` sections 1 and 5).

pub mod coordinates;
pub mod elements;
pub mod orbital;
pub mod parameters;
pub mod prior;
mod quantile;
mod quoted;
pub mod table;
pub mod values;

pub use coordinates::{FreeParameter, ParameterSpace, for_blind_search, period_prior, turning};
pub use elements::{Clock, Elements};
pub use orbital::{Estimate, OrbitQuantities, OrbitQuantity, definition, in_earths, quoted_definition};
pub use parameters::Parameter;
pub use prior::{Prior, PriorKind};
pub use quoted::Quoted;
pub use values::{FieldValues, OrbitValues, ParameterValues, StarValues};
