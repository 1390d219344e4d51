//! The results of a search for the best parameters, whatever the surface model, and its common steps.

use super::density::Density;
use super::evolving_map::NoFit;
use super::imaging::Imager;
use super::static_map::ReferenceError;
use crate::field::FieldError;
use crate::model::{ParameterSpace, ParameterValues, Prior};
use crate::sampling::optimise::{OptimiseError, Optimum};

/// The problem of the search.
#[derive(Clone, Copy, Debug)]
pub struct Sought<'a> {
    /// Star, times and data.
    pub imager: &'a Imager,
    /// The free parameters.
    pub space: &'a ParameterSpace,
    /// Largest number of other orbits to start from, beside the config's values.
    pub other_starts: usize,
    /// Seed of those that are drawn.
    pub seed: u64,
}

/// A start from a blind search.
#[derive(Clone, Debug)]
pub struct BlindStart<'a> {
    /// Its orbit, where the priors allow it, and the spots with it (physical coordinates).
    pub theta: Vec<f64>,
    /// The same as values of all parameters.
    pub values: ParameterValues,
    /// The star with that orbit.
    pub here: &'a super::Linearised,
}

/// One start of the search and its end.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// The start (physical coordinates); the first attempt is from the config's values.
    pub start: Vec<f64>,
    /// The end, or its error.
    pub end: Result<Optimum, OptimiseError>,
}

/// The result of a surface model.
#[derive(Clone, Debug)]
pub struct Best {
    /// The posterior relative to the reference at the optimum.
    pub posterior: Density,
    /// The optimum.
    pub optimum: Optimum,
    /// All starts.
    pub attempts: Vec<Attempt>,
}

/// Why a search failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// No reference image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No field.
    #[error("{0}")]
    Field(#[from] NoFit),
    /// No start was successful.
    #[error("{0}")]
    Optimise(#[from] OptimiseError),
}

impl From<FieldError> for SearchError {
    fn from(error: FieldError) -> Self {
        SearchError::Field(error.into())
    }
}

/// Progress of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// The stage.
    pub stage: Stage,
    /// Evaluations made by all climbs so far.
    pub evaluations: usize,
}

/// Stages of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reconstruction at the config's values.
    FirstImage,
    /// Climbs from all starts.
    Climbing {
        /// Climbs that have ended.
        done: usize,
        /// Number of starts.
        starts: usize,
    },
    /// The reference at the best parameters.
    Reference,
    /// The last climb, on the requested objective.
    Refining,
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Stage::FirstImage => f.write_str("reconstructing at the config's values"),
            Stage::Climbing { done, starts } => write!(f, "searching, {done} of {starts} climbs done"),
            Stage::Reference => f.write_str("reference image and trade-off curve"),
            Stage::Refining => f.write_str("refining the best parameters"),
        }
    }
}

/// Peaks of the quadratic at most this far below its best in ln L are climbed too.
pub(super) const PEAK_DROP: f64 = 10.0;

/// The reference is rebuilt until the optimum stays within this many standard deviations of it.
pub(super) const REFERENCE_SHIFT: f64 = 0.3;

/// Climbs that end within this many standard deviations of each other found the same maximum.
pub(crate) const RIVAL_DISTANCE: f64 = 4.0;

/// `theta` moved into the bounds of the priors, slightly inside.
pub(crate) fn within(space: &ParameterSpace, mut theta: Vec<f64>) -> Vec<f64> {
    for (x, f) in theta.iter_mut().zip(space.free()) {
        let (low, high) = f.prior.bounds();
        let margin = if (high - low).is_finite() { 0.02 * (high - low) } else { 0.0 };
        if f.prior != Prior::Periodic && !f.prior.contains(*x) {
            *x = x.clamp(low + margin, high - margin);
        }
    }
    theta
}

/// `theta` with the spots of `values` where they are free, moved into their priors.
pub(crate) fn with_spots_of(space: &ParameterSpace, mut theta: Vec<f64>, values: &ParameterValues) -> Vec<f64> {
    for (x, f) in theta.iter_mut().zip(space.free()).filter(|(_, f)| f.parameter.is_of_field()) {
        *x = values[f.parameter];
    }
    within(space, theta)
}

/// Distance of an optimum from `theta`, in standard deviations of the curvature.
pub(crate) fn shift(space: &ParameterSpace, theta: &[f64], to: &Optimum) -> f64 {
    let (a, b) = (space.to_sampling(theta), space.to_sampling(&to.theta));
    let d = nalgebra::DVector::from_iterator(a.len(), a.iter().zip(&b).map(|(a, b)| b - a));
    (&to.curvature * &d).dot(&d).max(0.0).sqrt()
}
