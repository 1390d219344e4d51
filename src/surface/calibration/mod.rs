//! What the profiles say of themselves before anything else: line, continuum and vsini ([`first_look`]), how large
//! their uncertainties are ([`noise`]), the RV jitter ([`jitter`]), RV offsets between data sets ([`offsets`]), and the
//! target chi2 ([`target`]).

pub mod events;
pub mod first_look;
pub mod jitter;
pub mod noise;
pub mod offsets;
pub mod star;
pub mod target;
