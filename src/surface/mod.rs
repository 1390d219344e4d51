//! What spots do to line profiles: a static map of maximum entropy, and an evolving map that is a Gaussian field,
//! marginalised (`docs/method.md` sections 2 to 4 and 9).

pub mod density;
pub mod evolving_map;
pub mod expansion;
pub mod fit;
pub mod imaging;
pub mod nuisances;
pub mod objective;
pub mod photometry;
pub mod static_map;

pub use objective::{ObjectiveKind, UnresolvedSpots};
