//! Planets in the velocities of the profiles, wherever those come from.
//!
//! In: ln L as a quadratic in the velocities of the profiles ([`velocities`]). Out: a [`verdict`] with what speaks
//! against it. The steps between are files of [`periodogram`], in this order: `frequencies` has the trial periods,
//! `orbits` the best orbit at each, `peaks` the highest; `false_alarm` says how often chance makes one, `rotation` and
//! `window` which periods spots and nights imitate, `limits` what K may be. `eccentric` and `two_planets` have what is
//! searched for on request.
//!
//! [`evidence`] has Bayes factors of models with and without planets; [`mixture`], K where several orbits may be true;
//! [`modes`], the periods of a posterior; [`occurrence`], the rate of planets in a sample of stars.
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
