//! Planets in the velocities of the profiles, wherever those come from.
//!
//! In: ln L as a quadratic in the velocities of the profiles ([`velocities`]). Then, in this order: the best orbit at
//! each period ([`periodogram`]), how often chance makes as high a peak, which periods spots and nights imitate,
//! limits. Out: a [`verdict`], with what speaks against it; every threshold on a planet stands there.

pub mod periodogram;
pub mod velocities;
pub mod verdict;
