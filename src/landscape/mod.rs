//! The landscape: ln L of the reconstructions on a Cartesian grid over one to three parameters (method section 6), the
//! paper's own way to an orbit.
//!
//! [`Grid`] says where the nodes are, [`Landscape`] holds their values in order, `table` says where the highest one is. The
//! prior does not enter. Left out: who reconstructs (`survey`), and files (`io::landscape`).

pub mod grid;
pub mod node;
pub mod table;

pub use grid::{Axis, Grid};
pub use node::{Landscape, LandscapeError, Node};
pub use table::table;
