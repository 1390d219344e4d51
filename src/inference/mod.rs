//! What the data say of planet, star and spots, whatever the surface model.
//!
//! In: an `Imager`, and a surface model (room `surface`). Out: a [`first_look`] at the profiles; [`detection`], the
//! blind search for a planet; [`search`], the best parameters; [`evidence`], Bayes factors under the priors of a
//! config.

pub mod detection;
pub mod evidence;
pub mod first_look;
pub mod search;
