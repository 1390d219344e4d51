//! What the data say of planet, star and spots, whatever the surface model: a first look at the profiles, the blind
//! search for a planet, the best parameters, the surrogate of the posterior, and Bayes factors.

pub mod detection;
pub mod evidence;
pub mod first_look;
pub mod search;
