//! Detection limits: orbits of many periods, semi-amplitudes and phases injected into the profiles, and whether the
//! blind search recovers them.
//!
//! An orbit is a shift of the profiles' velocities, in which ln L is known to second order: injecting one changes the
//! gradient by the information times its velocities, and the following search costs milliseconds. The noise by
//! unresolved spots is fitted again with every orbit, as `periodogram` would, and so is the field of spots, among some
//! that lie on a line. For a few orbits the linearised result is compared with the full pipeline: profiles resampled,
//! imaged and searched.

mod cells;
mod file;
mod full;
mod shortcut;

pub use cells::{Cell, Limit, Orbits, even_in_logarithm, limits, recovered};
pub use file::{CSV, JSON, LimitsFile};
pub use full::{Comparison, WholeWay, WholeWayError, drawn};
pub use shortcut::{BestOrbit, LimitSettings, Outcome, Searches, Shortcut};
