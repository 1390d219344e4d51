//! Inference of planet, star and spots, whatever the surface model: the blind search for a planet, the best parameters,
//! and Bayes factors.

pub mod detection;
pub mod evidence;
pub mod search;
