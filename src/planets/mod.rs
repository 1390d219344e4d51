//! Planets in the radial velocities of the profiles, whatever their origin.
//!
//! In: ln L as a quadratic in the velocities of the profiles ([`velocities`]). Out: a [`verdict`] with its caveats. The
//! steps between are files of [`periodogram`], in this order: `frequencies` has the trial periods, `orbits` the best
//! orbit at each, `peaks` the highest; `false_alarm` has the false-alarm probability, `rotation` and `window` the
//! periods that spots and the sampling mimic, `limits` the upper and detection limits on K. `eccentric` and
//! `two_planets` are searched on request.
//!
//! [`evidence`] has Bayes factors of models with and without planets; [`mixture`], K where several orbits are possible;
//! [`modes`], the periods of a posterior; [`occurrence`], the rate of planets in a sample of stars.
//!
//! [`speeds`] has the unit in which velocities are shown.
//!
//! The thresholds (false-alarm probabilities of candidate and detection among them) are constants of [`verdict`].

pub mod evidence;
pub mod mixture;
pub mod modes;
pub mod occurrence;
pub mod periodogram;
pub mod speeds;
pub mod velocities;
pub mod verdict;
