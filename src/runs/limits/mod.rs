//! Which planets the profiles would show: orbits of many periods, semi-amplitudes and phases put into them, and whether
//! the blind search finds them.
//!
//! An orbit is a shift of the profiles' velocities, in which ln L is known to second order: putting one in changes the
//! gradient by the information times its velocities, and the search that follows costs milliseconds. What is counted as
//! unresolved spots is found anew with every orbit, as `periodogram` would, and so is the field of spots, among some
//! that lie on a line. On a few orbits the shortcut is held against the whole way: profiles resampled, imaged and
//! searched.

mod cells;
mod file;
mod full;
mod shortcut;

pub use cells::{Cell, Limit, Orbits, even_in_logarithm, limits, recovered};
pub use file::{CSV, JSON, LimitsFile};
pub use full::{Comparison, WholeWay, WholeWayError, drawn};
pub use shortcut::{BestOrbit, LimitSettings, Outcome, Searches, Shortcut};
