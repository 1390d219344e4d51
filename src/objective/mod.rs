//! What a point of parameter space is worth: parameters, priors, trade-off curve, objectives (method section 3).

pub mod parameters;
pub mod prior;

pub use parameters::{Parameter, ParameterValues};
