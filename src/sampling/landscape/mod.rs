//! The landscape: ln L of the reconstructions on a Cartesian grid over one to three parameters (`docs/method.md`
//! section 6), the paper's own way to an orbit.
//!
//! [`Grid`] says where the nodes are, [`Landscape`] holds their values in order, `table` says where the highest one is,
//! `paraboloid` what the nodes around it (`region`) say of the parameters, and `marginal` what all of them do once
//! there is a prior.

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
