//! What spots do to line profiles, behind one interface: a [`SurfaceModel`].
//!
//! There are two models: `static_map`, the map of maximum entropy (`docs/method.md` sections 2 to 4), and
//! `evolving_map`, a Gaussian field on the sphere and in time, marginalised (section 9). [`SurfaceSettings::model`]
//! chooses one of them. A third model is one more folder here, an arm of that `match`, a name in [`ObjectiveKind`] and
//! a kind of [`record`]; one with several numbers a pixel, or lines of its own, changes `star::response` and
//! [`imaging`], too.
//!
//! In: an [`Imager`](imaging::Imager), which has the star, when it was observed, and the data with their [`nuisances`]
//! and light curves ([`photometry`]); [`calibration`] measures their uncertainties. Out: ln L to second order in the
//! velocities of the profiles ([`Linearised`], [`expansion`]), a density of the parameters ([`density`]) with its
//! [`surrogate`] and its maximum ([`optimum`]), and [`maps`] with [`checks`] of their residuals. A [`record`] of a
//! reference rebuilds the density to the same bits.

pub mod calibration;
pub mod checks;
pub mod density;
pub mod evolving_map;
pub mod expansion;
pub mod imaging;
mod linearised;
pub mod maps;
pub mod nuisances;
pub mod objective;
pub mod optimum;
pub mod photometry;
pub mod record;
pub mod static_map;
pub mod surrogate;

/// What profiles that are not yet taken will say of velocities: spots that evolve, whatever the config's objective.
pub mod planned {
    pub use super::evolving_map::{Assumed, Basis, Marginal, Planned, fit};
}

pub use evolving_map::{Change, FluxFit, Known, MEAN_FILLING, NoFit};
pub use linearised::{AtTarget, Explained, FilteredVelocity, Linearised, SpotField, SurfaceError};
pub use maps::{MapSummary, NoMaps, SurfaceMap, SurfaceMaps, VelocityWithoutSpots};
pub use objective::{ObjectiveKind, UnresolvedSpots};
pub use static_map::{CHI2, LIKELIHOOD_NUMBERS, ReferenceError, SPOTTEDNESS};

use crate::model::{ParameterSpace, ParameterValues};
use crate::planets::periodogram::{CircularOrbit, Frequencies, Jitters};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::Remark;
use crate::star::observation::Observations;
use density::Density;
use expansion::{Expansion, Nuisance};
use imaging::Imager;
use optimum::{Best, BlindStart, Progress, SearchError, Sought};
use record::{RebuildError, SurfaceRecord};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// Star and data, and what is integrated out with the velocities.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// Star, times and data.
    pub imager: &'a Imager,
    /// The parameters of star and orbit.
    pub values: ParameterValues,
    /// Parameters that are integrated out within their priors; the others are fixed.
    pub nuisances: &'a [Nuisance],
}

/// What is made of the velocities of some profiles: an orbit at a period.
pub type OrbitOf<'a> = &'a (dyn Fn(&VelocityQuadratic) -> Option<CircularOrbit> + Sync);

/// What is assumed of the spots, and what the profiles then say.
pub trait SurfaceModel: Debug + Send + Sync {
    /// ln L to second order around the star at some parameters; maps are found from those of a star `near` by.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn linearise(&self, at: At, near: Option<&Linearised>) -> Result<Linearised, SurfaceError>;

    /// The quadratic of the orbit's velocities in an expansion of this model, whose gradient may be another one than
    /// that of the data: spots that the map does not resolve count as noise of the size that the gradient says.
    fn velocities(&self, expansion: &Expansion, nuisances: &[Nuisance]) -> Option<VelocityQuadratic>;

    /// The likelihood of the velocities beside velocity jitters of several sizes, where the profiles say how large it
    /// is.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn jitters(&self, at: At, here: &Linearised) -> Result<Jitters, SurfaceError>;

    /// The same model with what was fitted of the spots held.
    fn holding(&self, here: &Linearised) -> Box<dyn SurfaceModel>;

    /// Whether the spots evolve, where the model takes them for static; `None` where that is not asked.
    fn evolution(&self, at: At, frequencies: &Frequencies) -> Option<Result<Change, NoFit>>;

    /// Whether spots imitate orbits at fractions of the rotation period, too.
    fn imitates_at_fractions(&self) -> bool;

    /// An orbit without each of these groups of profiles (ascending).
    fn without_each(
        &self,
        at: At,
        here: &Linearised,
        groups: &[Vec<usize>],
        orbit: OrbitOf,
    ) -> Vec<Option<CircularOrbit>>;

    /// An orbit at other targets of chi2; none where there is no target.
    fn at_other_targets(&self, at: At, orbit: OrbitOf) -> Vec<AtTarget>;

    /// The profiles as the most probable maps explain them.
    fn explained(&self, imager: &Imager, observations: &Observations, here: &Linearised) -> Explained;

    /// What has to be known of the maps.
    fn remarks(&self, imager: &Imager, here: &Linearised) -> Vec<Remark>;

    /// Whether maps evolve, so that they are of a time.
    fn evolves(&self) -> bool;

    /// The maps at `values`, of these times (d) where they are given and the maps evolve.
    ///
    /// # Errors
    /// [`NoMaps`].
    fn maps(
        &self,
        imager: &Imager,
        observations: &Observations,
        values: ParameterValues,
        times_d: Option<&[f64]>,
    ) -> Result<SurfaceMaps, NoMaps>;

    /// Whether the search for the best parameters begins with a blind search for the planet.
    fn begins_with_blind_search(&self) -> bool;

    /// The best parameters and the density around them; `report` is called as the search goes on, from any thread.
    ///
    /// # Errors
    /// If there is no reference, or no start leads to a finite log-probability.
    fn optimum(
        &self,
        sought: Sought,
        start: Option<BlindStart>,
        report: &(dyn Fn(Progress) + Sync),
    ) -> Result<Best, SearchError>;

    /// The density of `space` around a reference that was recorded, which is rebuilt to the same bits; what the record
    /// lacks is as in `others`.
    ///
    /// # Errors
    /// [`RebuildError`].
    fn rebuilt(
        &self,
        imager: Imager,
        space: ParameterSpace,
        record: &SurfaceRecord,
        others: &ParameterValues,
    ) -> Result<Density, RebuildError>;
}

/// A surface model as a config asks for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceSettings {
    /// The objective.
    pub objective: ObjectiveKind,
    /// Target of chi2, per datum, where there is one.
    pub chi2_target: f64,
    /// What is known of the spots as a field that evolves. Where they are taken for static, whether they are is looked
    /// into with it; without it that is not asked.
    pub field: Option<Known>,
}

impl SurfaceSettings {
    /// The map of fewest spots at a target chi2 per datum, of a star of which it is not asked whether it evolves.
    pub fn spottedness(chi2_target: f64) -> Self {
        SurfaceSettings { objective: ObjectiveKind::Spottedness, chi2_target, field: None }
    }

    /// The model.
    pub fn model(&self) -> Box<dyn SurfaceModel> {
        match self.objective {
            ObjectiveKind::MarginalLikelihood => {
                Box::new(evolving_map::EvolvingMap::new(self.field.unwrap_or_default()))
            }
            ObjectiveKind::Spottedness | ObjectiveKind::Entropy | ObjectiveKind::RegularisedLikelihood => {
                Box::new(static_map::StaticMap {
                    objective: self.objective,
                    chi2_target: self.chi2_target,
                    compared_with: self.field,
                })
            }
        }
    }
}
