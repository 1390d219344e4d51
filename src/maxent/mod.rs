//! Maximum-entropy inversion (`docs/method.md` section 2; Skilling & Bryan 1984, Gull & Skilling 1999): the image of
//! greatest entropy at a given chi2, or at a given Lagrange multiplier.
//!
//! Knows images, data misfits and their curvature through [`Problem`] alone.

mod cg;
mod convergence;
pub mod entropy;
mod parallelism;
pub mod preconditioner;
pub mod problem;
pub mod solution;
pub mod solver;

pub use parallelism::parallelism;
pub use preconditioner::Preconditioner;
pub use problem::{Curvature, Problem};
pub use solution::{Best, Goal, Image, Solution, SolverSettings, Start, Termination};
pub use solver::Solver;
