//! The most probable field of data that are not linear in it: Gauss-Newton, of which every step is the linear answer
//! (`docs/method.md` section 9).
//!
//! The largest change of the field in a step is limited: far from the answer the linear model promises too much. Start
//! from no field at all or from the answer of the same hyperparameters nearby; from that of others it may not come
//! back. Where the field hardly changes any more, steps by the covariance of an earlier one come nearer as fast as by
//! one of their own, and cost next to nothing.

use super::epoch::pulled;
use super::{Compression, Epoch, Evidence, Field, FieldError};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Largest change of the field in a step after which the next is made by the same covariance.
const FROZEN_BELOW: f64 = 0.3;

/// What is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Sought<'a> {
    /// The field before the data.
    pub field: Field,
    /// Degree of each coefficient (H).
    pub degrees: &'a [usize],
    /// Harmonics (points, H) of the points at which changes of the field are watched: some hundred.
    pub watched: &'a DMatrix<f64>,
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
        Settling { steps: 40, tolerance: 1e-4, longest: 0.6, compression: Compression::default() }
    }
}

/// The most probable field.
#[derive(Clone, Debug)]
pub struct Settled {
    /// Its coefficients (H, epochs).
    pub coefficients: DMatrix<f64>,
    /// The evidence of the data linearised there.
    pub evidence: Evidence,
    /// Steps that were made, and in how many of them a covariance was made anew.
    pub steps: [usize; 2],
    /// Largest change of the field in the last of them.
    pub change: f64,
}

/// Finds the most probable field from the coefficients `start` (H, epochs), zeros for no field. `linearise` makes all
/// epochs linear around such coefficients, one column an epoch: always the same epochs in the same order. Where there
/// is no model it gives numbers that are not finite.
///
/// With the evidence of a model and a field `nearby`, found before, first steps are made by its covariance. What is
/// left of the way is an error of ln Z (`docs/method.md` section 9). How many numbers of an epoch the field explains
/// (`tilt`) is found with each covariance that is made, or is as nearby; ln Z depends on it to second order only. The
/// first covariance alone will not do: made far from the answer it put ln Z of one star 2.6 too low.
///
/// # Errors
/// Those of [`Evidence::new`], and [`FieldError::NotSettled`].
pub fn settle(
    linearise: impl FnMut(&DMatrix<f64>) -> Vec<Epoch>,
    sought: Sought,
    start: DMatrix<f64>,
    nearby: Option<&Evidence>,
    settings: &Settling,
) -> Result<Settled, FieldError> {
    let Way { coefficients, epochs, last, steps, change } = approach(linearise, sought, start, nearby, settings)?;
    let explained = last.as_ref().or(nearby).and_then(Evidence::explained);
    drop(last);
    let evidence = sought.evidence((&epochs, &coefficients), settings, explained)?;
    Ok(Settled { coefficients, evidence, steps, change })
}

/// The way to the most probable field.
pub(crate) struct Way {
    /// Where it ends: coefficients of the field (H, epochs).
    pub coefficients: DMatrix<f64>,
    /// The epochs made linear there.
    epochs: Vec<Epoch>,
    /// The last evidence that was made on it, beside its end; `None` if that nearby was enough.
    pub last: Option<Evidence>,
    steps: [usize; 2],
    change: f64,
}

/// The same without the evidence at the end.
///
/// # Errors
/// As there.
pub(crate) fn approach(
    mut linearise: impl FnMut(&DMatrix<f64>) -> Vec<Epoch>,
    sought: Sought,
    start: DMatrix<f64>,
    nearby: Option<&Evidence>,
    settings: &Settling,
) -> Result<Way, FieldError> {
    let mut coefficients = start;
    let mut epochs = linearise(&coefficients);
    let mut changes = [f64::INFINITY; 2];
    let mut last: Option<Evidence> = None;
    let mut steps = [0; 2];
    while steps[0] < settings.steps {
        let by = match last.as_ref().or(nearby).filter(|_| steps[0] == 0 || converges(changes)) {
            Some(earlier) => earlier,
            None => {
                steps[1] += 1;
                // of many profiles each is hundreds of megabytes
                last = None;
                last.insert(sought.evidence((&epochs, &coefficients), settings, None)?)
            }
        };
        let mut pulled = pulled(&epochs)?;
        if let Some(tilt) = &by.tilt {
            pulled -= tilt.of(&epochs);
        }
        let step = by.step(&sought.field, &coefficients, &pulled);
        steps[0] += 1;
        changes = [changes[1], (sought.watched * &step).amax()];
        if !changes[1].is_finite() {
            break;
        }
        coefficients += step * (settings.longest / changes[1]).min(1.0);
        epochs = linearise(&coefficients);
        if changes[1] < settings.tolerance {
            return Ok(Way { coefficients, epochs, last, steps, change: changes[1] });
        }
    }
    Err(FieldError::NotSettled { steps: steps[0], change: changes[1] })
}

impl Sought<'_> {
    /// Of epochs linear around these coefficients.
    fn evidence(
        &self,
        (epochs, around): (&[Epoch], &DMatrix<f64>),
        settings: &Settling,
        explained: Option<Vec<f64>>,
    ) -> Result<Evidence, FieldError> {
        Evidence::of(self.field, self.degrees, (epochs, around), settings.compression, explained)
    }
}

/// Whether steps by the covariance of an earlier one come nearer.
fn converges([before, last]: [f64; 2]) -> bool {
    last < FROZEN_BELOW && last < 0.5 * before
}
