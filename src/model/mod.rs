//! The parameters of a star, its planets and its spots (`docs/method.md` sections 1 and 5).
//!
//! [`parameters`] is their table, where a new one is added, [`values`] their values for one star, [`prior`] their
//! priors. [`coordinates`] turns the free ones into the coordinates that samplers move in, [`elements`] ephemerides in
//! days into phases and periods. [`orbital`] has the quoted quantities of an orbit, `quoted` the same for draws of a
//! chain.

mod access;
pub mod coordinates;
pub mod elements;
mod ephemeris;
pub mod orbital;
pub mod parameters;
pub mod prior;
mod quantile;
mod quoted;
pub mod values;

pub use coordinates::{FreeParameter, ParameterSpace, for_blind_search, period_prior};
pub use elements::{Clock, Elements};
pub use ephemeris::Ephemeris;
pub use orbital::{Estimate, OrbitQuantities, OrbitQuantity, definition, in_earths};
pub use parameters::{PARAMETERS, Parameter, Spec, Step, turning};
pub use prior::{Prior, PriorKind};
pub use quoted::{Quoted, quoted_definition};
pub use values::{Element, FieldValues, OrbitValues, ParameterValues, StarValues};
