//! The effect of spots on line profiles, behind one interface: a [`SurfaceModel`].
//!
//! There are two models: `static_map`, the map of maximum entropy (`docs/method.md` sections 2 to 4), and
//! `evolving_map`, a Gaussian field on the sphere and in time, marginalised over (section 9). `settings` chooses one of
//! them, and its [`Properties`], for an objective. A third model requires one more folder here, an arm of these two
//! `match`es, a name in [`ObjectiveKind`] and a kind of [`record`]; with several values per pixel, or other local
//! lines, it also changes `star::response` and [`imaging`].
//!
//! In: an [`Imager`](imaging::Imager), which has the star, when it was observed, and the data with their [`nuisances`]
//! and light curves ([`photometry`]); [`calibration`] measures their uncertainties. Out: ln L to second order in the
//! velocities of the profiles ([`Linearised`], [`expansion`]), a density of the parameters ([`density`]) with its
//! [`surrogate`] and its maximum ([`optimum`]), and [`maps`] with [`checks`] of their residuals. A [`record`] of a
//! reference rebuilds the density to the same bits.

pub mod calibration;
pub mod checks;
mod constants;
pub mod density;
pub mod evolving_map;
pub mod expansion;
pub mod imaging;
pub mod indicator;
mod linearised;
pub mod maps;
pub mod mean_profile;
mod model;
pub mod nuisances;
pub mod objective;
pub mod optimum;
pub mod photometry;
pub mod record;
mod settings;
pub mod static_map;
pub mod surrogate;

/// Expected constraints of planned profiles on velocities: with evolving spots, whatever the config's objective.
pub mod planned {
    pub use super::evolving_map::{Assumed, Basis, Marginal, Planned, fit};
}

pub use constants::{ConstantVelocity, Constants, FoundDrift};
pub use evolving_map::contrast::FittedContrast;
pub use evolving_map::{
    Change, FieldStart, FittedIndicator, FluxFit, Known, MEAN_FILLING, NoFit, OtherRotation, ReadingFit,
};
pub use linearised::{
    AtTarget, Explained, FieldErrors, FilteredVelocity, Linearised, SpotField, SurfaceError, WithoutJitter,
};
pub use maps::{MapSummary, NoMaps, SurfaceMap, SurfaceMaps, VelocityWithoutSpots};
pub use model::{At, OrbitOf, Properties, SurfaceModel};
pub use objective::{ObjectiveKind, UnresolvedSpots};
pub use settings::SurfaceSettings;
pub use static_map::{CHI2, LIKELIHOOD_NUMBERS, ReferenceError, SPOTTEDNESS};
