//! The function that is searched, scanned and sampled: the density of the free parameters under a surface model.

use super::imaging::Imager;
use super::objective::UnresolvedSpots;
use super::record::SurfaceRecord;
use super::surrogate::Surrogate;
use crate::model::ParameterSpace;
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity};
use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

/// A shared density.
pub type Density = Arc<dyn SurfaceDensity>;

/// The residual spots have no size that fits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "imaging.unresolved_spots: no size of the unresolved spots fits the data; \"entropy\" takes them as the entropy \
    has them"
)]
pub struct UnresolvedSpotsError;

/// A posterior density under a surface model, around a reference.
pub trait SurfaceDensity: LogDensity + Debug + Send {
    /// The parameter space.
    fn space(&self) -> &ParameterSpace;

    /// Star, times and data.
    fn imager(&self) -> &Imager;

    /// ln L at `theta` (physical coordinates) without the prior, with the values of
    /// [`SurfaceDensity::likelihood_numbers`].
    fn likelihood(&self, theta: &[f64]) -> Evaluation;

    /// Names of the values beside ln L.
    fn likelihood_numbers(&self) -> &[&str];

    /// The same with the warm starts that pay off for so many evaluations, spread like `thetas`; itself where it needs
    /// none.
    fn with_warm_starts_for(self: Arc<Self>, thetas: &[Vec<f64>], evaluations: usize) -> Density;

    /// The same with warm starts at `thetas` (physical coordinates) besides the reference, and no others.
    fn with_warm_starts(self: Arc<Self>, thetas: &[Vec<f64>]) -> Density;

    /// Positions of its warm starts, except the reference.
    fn warm_starts(&self) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// The record of the reference, from which it is rebuilt.
    fn record(&self) -> SurfaceRecord;

    /// The density that a chain samples: the same, with unresolved spots as in a config.
    ///
    /// # Errors
    /// [`UnresolvedSpotsError`].
    fn sampled(self: Arc<Self>, unresolved_spots: UnresolvedSpots) -> Result<Density, UnresolvedSpotsError>;

    /// The quadratic of the density with the priors; `None` where there is none.
    fn surrogate(&self) -> Option<Surrogate>;

    /// The surrogate fitted to the density itself, unless it is its own expansion, and the fraction of its proposals
    /// accepted in a test.
    fn fitted(&self, surrogate: Surrogate, evaluator: &dyn Evaluator) -> (Surrogate, f64);

    /// Itself.
    fn any(&self) -> &dyn Any;
}
