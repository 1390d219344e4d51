//! The interface of surface models: the assumptions on the spots, and the resulting constraints from the profiles.

use super::density::Density;
use super::expansion::{Expansion, Nuisance};
use super::imaging::Imager;
use super::optimum::{Best, BlindStart, Progress, SearchError, Sought};
use super::record::{RebuildError, SurfaceRecord};
use super::{
    AtTarget, Change, Explained, FieldErrors, Linearised, NoFit, NoMaps, SurfaceError, SurfaceMaps, WithoutJitter,
};
use crate::model::{ParameterSpace, ParameterValues};
use crate::planets::periodogram::{CircularOrbit, Frequencies, OfField, Scatter};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::Remark;
use crate::star::observation::Observations;
use std::fmt::Debug;

/// Star and data, and the parameters that are marginalised over with the velocities.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// Star, times and data.
    pub imager: &'a Imager,
    /// The parameters of star and orbit.
    pub values: ParameterValues,
    /// Parameters that are marginalised over within their priors; the others are fixed.
    pub nuisances: &'a [Nuisance],
}

/// A function of the velocities of some profiles: an orbit at a period.
pub type OrbitOf<'a> = &'a (dyn Fn(&VelocityQuadratic) -> Option<CircularOrbit> + Sync);

/// Properties of a model, before there are data: what a config may require of it, and what must be measured beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Properties {
    /// Its name. Images, jitters and fields of two models are different quantities.
    pub name: &'static str,
    /// The current stage of the search for maps, as text.
    pub under_way: &'static str,
    /// Whether the map evolves continuously: seasons then need no separate maps, and the residuals of one map are not
    /// noise.
    pub map_changes: bool,
    /// Whether RV jitter and RV offsets of data sets are marginalised over together with the maps; otherwise they are
    /// fixed beforehand.
    pub marginalises: bool,
    /// Whether spots are a field with an amplitude, a slope and a lifetime.
    pub has_field: bool,
    /// Whether it uses light curves beside the profiles.
    pub takes_light_curves: bool,
    /// Whether it is one map at a target chi2, with unresolved spots.
    pub has_target: bool,
}

/// A surface model: assumptions on the spots, and the resulting constraints from the profiles.
pub trait SurfaceModel: Debug + Send + Sync {
    /// ln L to second order around the star at some parameters; maps are found from those of a star `near`.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn linearise(&self, at: At, near: Option<&Linearised>) -> Result<Linearised, SurfaceError>;

    /// The quadratic of the orbit's velocities in an expansion of this model, whose gradient may differ from that of
    /// the data: unresolved spots count as noise of the size that the gradient implies.
    fn velocities(&self, expansion: &Expansion, nuisances: &[Nuisance]) -> Option<VelocityQuadratic>;

    /// The star `here` without its RV jitter and RV offsets of nights, where the profiles are to constrain the jitter;
    /// `None` where it is given, or there is none.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn without_jitter(&self, at: At, here: &Linearised) -> Result<Option<WithoutJitter>, SurfaceError>;

    /// The star `here` with this jitter and these RV offsets of nights as noise of its velocities, where it has such.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn with_noise(&self, _at: At, here: &Linearised, _noise: Scatter) -> Result<Linearised, SurfaceError> {
        Ok(here.clone())
    }

    /// The star `here` with fields of spots that absorb less and more of an orbit, in even steps along a line, where
    /// spots are a field; none otherwise.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn absorbing(&self, _at: At, _here: &Linearised) -> Result<Vec<OfField>, SurfaceError> {
        Ok(Vec::new())
    }

    /// The same model with the fitted parameters of the spots held.
    fn holding(&self, here: &Linearised) -> Box<dyn SurfaceModel>;

    /// Whether the spots evolve, where the model assumes static ones; `None` where that is not tested.
    fn evolution(&self, at: At, frequencies: &Frequencies) -> Option<Result<Change, NoFit>>;

    /// Whether spots also mimic orbits at fractions of the rotation period.
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

    /// The profiles with the model of the most probable maps.
    fn explained(&self, imager: &Imager, observations: &Observations, here: &Linearised) -> Explained;

    /// Uncertainties of the field of spots; empty where there is none.
    fn field_errors(&self, imager: &Imager, here: &Linearised) -> FieldErrors;

    /// Remarks on the maps.
    fn remarks(&self, imager: &Imager, here: &Linearised) -> Vec<Remark>;

    /// The maps at the values of `at`, of these times (d) where they are given and the maps evolve.
    ///
    /// # Errors
    /// [`NoMaps`].
    fn maps(&self, at: At, observations: &Observations, times_d: Option<&[f64]>) -> Result<SurfaceMaps, NoMaps>;

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

    /// The density of `space` around a recorded reference, which is rebuilt to the same bits; values missing in the
    /// record are as in `others`.
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
