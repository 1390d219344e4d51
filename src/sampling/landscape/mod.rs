//! The likelihood grid: ln L of the reconstructions on a Cartesian grid over one to three parameters (`docs/method.md`
//! section 6), the method of Petit et al. (2015) for an orbit.
//!
//! [`Grid`] has the nodes, [`Landscape`] their values in order, `table` the highest one, `paraboloid` the fit to the
//! nodes around it (`region`), and `marginal` the posterior from all nodes under a prior.

pub mod grid;
pub mod marginal;
pub mod node;
pub mod paraboloid;
pub mod region;
pub mod table;

pub use grid::{Axis, Grid};
pub use marginal::Marginal;
pub use node::{Landscape, LandscapeError, Node};
pub use paraboloid::{Estimate, Paraboloid, Undefined, paraboloid};
pub use region::Rule;
pub use table::{paraboloid_table, table};
