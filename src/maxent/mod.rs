//! Maximum-entropy inversion (`docs/method.md` section 2; Skilling & Bryan 1984, Gull & Skilling 1999).
//!
//! In: a misfit with gradient and curvature ([`problem`]), the entropy of an image ([`entropy`]), a goal and a start
//! ([`solution`]). Out: the image of greatest entropy at that chi2, or at that Lagrange multiplier.
//!
//! [`solver`] makes Newton steps; each is a linear system for `cg`, accelerated by [`preconditioner`]. `convergence`
//! estimates the distance to the goal, `parallelism` is Skilling & Bryan's own test.

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
