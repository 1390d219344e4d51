//! What is searched, scanned and sampled: the density of the free parameters that a surface model gives.

use super::imaging::Imager;
use super::objective::UnresolvedSpots;
use super::record::SurfaceRecord;
use super::surrogate::Surrogate;
use crate::model::ParameterSpace;
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity};
use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

/// Such a density, shared.
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

    /// ln L at `theta` (physical coordinates) without the prior, with the numbers of
    /// [`SurfaceDensity::likelihood_numbers`].
    fn likelihood(&self, theta: &[f64]) -> Evaluation;

    /// Names of the numbers beside ln L.
    fn likelihood_numbers(&self) -> &[&str];

    /// The same with the warm starts that so many evaluations, spread like `thetas`, are worth; itself where it needs
    /// none.
    fn with_warm_starts_for(self: Arc<Self>, thetas: &[Vec<f64>], evaluations: usize) -> Density;

    /// The same with warm starts at `thetas` (physical coordinates) besides the reference, and no others.
    fn with_warm_starts(self: Arc<Self>, thetas: &[Vec<f64>]) -> Density;

    /// Where its warm starts are, but for the reference.
    fn warm_starts(&self) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// What is written of the reference, and what it is rebuilt from.
    fn record(&self) -> SurfaceRecord;

    /// The density that a chain samples: the same, with unresolved spots as a config has them.
    ///
    /// # Errors
    /// [`UnresolvedSpotsError`].
    fn sampled(self: Arc<Self>, unresolved_spots: UnresolvedSpots) -> Result<Density, UnresolvedSpotsError>;

    /// The quadratic of the density with the priors; `None` where there is none.
    fn surrogate(&self) -> Option<Surrogate>;

    /// The surrogate fitted to the density itself, as far as it is not its own expansion, and the share of its
    /// proposals accepted on trial.
    fn fitted(&self, surrogate: Surrogate, evaluator: &dyn Evaluator) -> (Surrogate, f64);

    /// Itself.
    fn any(&self) -> &dyn Any;
}
