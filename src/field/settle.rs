//! The most probable field of data that are not linear in it: Gauss-Newton, of which every step is the linear answer
//! (`docs/method.md` section 9).
//!
//! The largest change of the field in a step is limited: far from the answer the linear model promises too much. Start
//! from no field at all or from the answer of the same hyperparameters nearby; from that of others it may not come
//! back.

use super::{Compression, Epoch, Evidence, Field, FieldError};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// What is observed of a field.
pub trait Model {
    /// All epochs, made linear around coefficients (H, epochs), one column an epoch: always the same epochs in the same
    /// order. Numbers that are not finite, where there is no model, are noticed.
    fn linearise(&mut self, coefficients: &DMatrix<f64>) -> Vec<Epoch>;
}

/// When Gauss-Newton ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settling {
    /// Most steps.
    pub steps: usize,
    /// Largest change of the field, at the points that are watched, that ends it.
    pub tolerance: f64,
    /// Largest change of the field in a step.
    pub longest: f64,
    /// How data are compressed.
    pub compression: Compression,
}

impl Default for Settling {
    fn default() -> Self {
        Settling { steps: 40, tolerance: 1e-3, longest: 0.6, compression: Compression::default() }
    }
}

/// The most probable field.
#[derive(Clone, Debug)]
pub struct Settled {
    /// Its coefficients (H, epochs).
    pub coefficients: DMatrix<f64>,
    /// The evidence of the data linearised there.
    pub evidence: Evidence,
    /// Steps that were made.
    pub steps: usize,
}

/// Finds the most probable field from the coefficients `start` (H, epochs), zeros for no field. The change of the field
/// is watched at points, given their harmonics (H, points).
///
/// # Errors
/// Those of [`Evidence::new`], and [`FieldError::NotSettled`].
pub fn settle(
    model: &mut impl Model,
    field: Field,
    degrees: &[usize],
    watched: &DMatrix<f64>,
    start: DMatrix<f64>,
    settings: &Settling,
) -> Result<Settled, FieldError> {
    let mut coefficients = start;
    let mut change = f64::INFINITY;
    for steps in 0..=settings.steps {
        let evidence = linear(model, field, degrees, &coefficients, settings)?;
        if change < settings.tolerance {
            return Ok(Settled { coefficients, evidence, steps });
        }
        let step = evidence.coefficients() - &coefficients;
        change = (watched.tr_mul(&step)).amax();
        if !change.is_finite() {
            break;
        }
        coefficients += step * (settings.longest / change).min(1.0);
    }
    Err(FieldError::NotSettled { steps: settings.steps, change })
}

/// The evidence of the model linearised at coefficients.
fn linear(
    model: &mut impl Model,
    field: Field,
    degrees: &[usize],
    coefficients: &DMatrix<f64>,
    settings: &Settling,
) -> Result<Evidence, FieldError> {
    Evidence::new(field, degrees, &model.linearise(coefficients), coefficients, settings.compression)
}
