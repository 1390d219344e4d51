//! The interface of surface models: what is assumed of the spots, and what the profiles then say.

use super::density::Density;
use super::expansion::{Expansion, Nuisance};
use super::imaging::Imager;
use super::optimum::{Best, BlindStart, Progress, SearchError, Sought};
use super::record::{RebuildError, SurfaceRecord};
use super::{
    AtTarget, Change, Explained, FieldErrors, Linearised, NoFit, NoMaps, SurfaceError, SurfaceMaps, WithoutJitter,
};
use crate::model::{ParameterSpace, ParameterValues};
use crate::planets::periodogram::{CircularOrbit, Frequencies, OfField};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::Remark;
use crate::star::observation::Observations;
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

/// What a model is, before there are data: what a config may ask of it, and what it leaves to be measured beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Properties {
    /// Its name. Images, jitters and fields of two models are not the same quantities.
    pub name: &'static str,
    /// What is under way while it looks for maps, in words.
    pub under_way: &'static str,
    /// Whether the map changes all the time: seasons need no maps of their own, and what one map leaves over is not
    /// noise.
    pub map_changes: bool,
    /// Whether velocity jitter and velocity offsets of data sets are integrated out with the maps; otherwise they are
    /// settled beforehand.
    pub marginalises: bool,
    /// Whether spots are a field, of an amplitude, a slope and a lifetime.
    pub has_field: bool,
    /// Whether it takes light curves beside the profiles.
    pub takes_light_curves: bool,
    /// Whether it is one map at a target chi2, which leaves spots unresolved.
    pub has_target: bool,
}

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

    /// The star as it is `here` without its velocity jitter, where the profiles are to say how large that is; `None`
    /// where it is given, or there is none.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn without_jitter(&self, at: At, here: &Linearised) -> Result<Option<WithoutJitter>, SurfaceError>;

    /// The star as it is `here` with fields of spots that absorb less and more of an orbit, in even steps along a line,
    /// where spots are a field; none otherwise.
    ///
    /// # Errors
    /// [`SurfaceError`].
    fn absorbing(&self, _at: At, _here: &Linearised) -> Result<Vec<OfField>, SurfaceError> {
        Ok(Vec::new())
    }

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

    /// How well the profiles tell the field of spots; nothing where there is none.
    fn field_errors(&self, imager: &Imager, here: &Linearised) -> FieldErrors;

    /// What has to be known of the maps.
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
