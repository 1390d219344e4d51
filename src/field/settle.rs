//! The most probable field of data that are not linear in it: Gauss-Newton, of which every step is the linear answer
//! (`docs/method.md` section 9).
//!
//! The largest change of the field in a step is limited: far from the answer the linear model promises too much. Start
//! from no field at all or from the answer of the same hyperparameters nearby; from that of others it may not come
//! back. Where the field hardly changes any more, steps by the covariance of an earlier one come nearer as well, and
//! cost next to nothing: each is mixed with those before, and leaves some fifth of the way.

use super::epoch::pulled;
use super::evidence::Nearby;
use super::tilt::tilted;
use super::{Compression, Degrees, Epoch, Evidence, Field, FieldError};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Largest change of the field in a step over that in the step before the last, up to which one covariance will do;
/// and for how many steps.
const FALLS: f64 = 0.9;
const FROZEN: usize = 10;

/// Steps that one is mixed with.
const MIXED: usize = 3;

/// What is looked for.
#[derive(Clone, Copy, Debug)]
pub struct Sought<'a> {
    /// The field before the data.
    pub field: Field,
    /// Degrees of the coefficients (H).
    pub degrees: &'a Degrees,
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
/// (`tilt`) is found with each covariance that is made on the way, or is as nearby; in the evidence at the end it is
/// that of the end, unless there is one nearby. ln Z depends on it to second order only, but one found far from the
/// answer put ln Z of one star 2.6 too low.
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
    // a reference has its own: neighbours begin from that
    let known = nearby.and_then(|nearby| last.as_ref().unwrap_or(nearby).explained());
    let explained = known.map(<[f64]>::to_vec);
    let seen = last.as_ref().or(nearby).and_then(Evidence::seen);
    // of many profiles each is hundreds of megabytes
    drop(last);
    let evidence = sought.evidence((&epochs, &coefficients), settings, Nearby { explained, seen })?;
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
    let mut changes = [f64::INFINITY; 3];
    let mut last: Option<Evidence> = None;
    let mut mixing = Mixing::default();
    let mut steps = [0; 2];
    // a reference, from which others begin, is to be found more closely
    let near = if nearby.is_some() { settings.longest } else { 0.5 * settings.longest };
    while steps[0] < settings.steps {
        // steps by another covariance say nothing of those by this
        let [before, _, change] = changes;
        let falls = change < near && change < FALLS * before && mixing.steps < FROZEN;
        let by = match last.as_ref().or(nearby).filter(|_| steps[0] == 0 || falls) {
            Some(earlier) => earlier,
            None => {
                steps[1] += 1;
                let seen = last.take().as_ref().or(nearby).and_then(Evidence::seen);
                mixing = Mixing::default();
                changes = [f64::INFINITY; 3];
                let known = Nearby { explained: None, seen };
                last.insert(sought.evidence((&epochs, &coefficients), settings, known)?)
            }
        };
        let mut pulled = pulled(&epochs)?;
        if let Some(explained) = by.explained() {
            pulled -= tilted(explained, &epochs);
        }
        let step = by.step(&sought.field, &coefficients, &pulled);
        steps[0] += 1;
        changes = [changes[1], changes[2], (sought.watched * &step).amax()];
        if !changes[2].is_finite() {
            break;
        }
        let ends = changes[2] < settings.tolerance;
        let (way, length) = match ends || changes[2] > settings.longest {
            true => (step, changes[2]),
            false => {
                let way = mixing.mixed(&coefficients, step);
                let length = (sought.watched * &way).amax();
                (way, length)
            }
        };
        coefficients += way * if length > settings.longest { settings.longest / length } else { 1.0 };
        epochs = linearise(&coefficients);
        if ends {
            return Ok(Way { coefficients, epochs, last, steps, change: changes[2] });
        }
    }
    Err(FieldError::NotSettled { steps: steps[0], change: changes[2] })
}

impl Sought<'_> {
    /// Of epochs linear around these coefficients.
    fn evidence(
        &self,
        (epochs, around): (&[Epoch], &DMatrix<f64>),
        settings: &Settling,
        nearby: Nearby,
    ) -> Result<Evidence, FieldError> {
        Evidence::of(self.field, self.degrees, (epochs, around), settings.compression, nearby)
    }
}

/// Steps by one covariance, each mixed with those before so that they come nearer faster (Anderson 1965; Walker & Ni
/// 2011).
#[derive(Default)]
struct Mixing {
    /// The last place and the step from there.
    last: Option<[DMatrix<f64>; 2]>,
    /// From place to place, and from step to step.
    differences: Vec<[DMatrix<f64>; 2]>,
    /// How many there were.
    steps: usize,
}

impl Mixing {
    /// The way from `place` by a step and by what those before tell of where it leads.
    fn mixed(&mut self, place: &DMatrix<f64>, step: DMatrix<f64>) -> DMatrix<f64> {
        self.steps += 1;
        if let Some([place_before, step_before]) = self.last.take() {
            self.differences.push([place - place_before, &step - step_before]);
            if self.differences.len() > MIXED {
                self.differences.remove(0);
            }
        }
        self.last = Some([place.clone(), step.clone()]);
        let n = self.differences.len();
        let products = DMatrix::from_fn(n, n, |i, j| self.differences[i][1].dot(&self.differences[j][1]));
        let along = DVector::from_fn(n, |i, _| self.differences[i][1].dot(&step));
        let mut way = step;
        if let Some(factor) = products.cholesky() {
            for ([places, steps], share) in self.differences.iter().zip(factor.solve(&along).iter()) {
                way -= (places + steps) * *share;
            }
        }
        way
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps that leave 0.7, 0.5, 0.2 and -0.4 of the way along four directions.
    #[test]
    fn mixed_steps_come_nearer_faster_than_each() {
        let left = DVector::from_row_slice(&[0.7, 0.5, 0.2, -0.4]);
        let answer = DVector::from_row_slice(&[1.0, -2.0, 3.0, 4.0]);
        let step = |place: &DMatrix<f64>| {
            let way = &answer - place.column(0);
            DMatrix::from_column_slice(4, 1, (&way - left.component_mul(&way)).as_slice())
        };
        let (mut mixed, mut plain) = (DMatrix::zeros(4, 1), DMatrix::zeros(4, 1));
        let mut mixing = Mixing::default();
        for _ in 0..8 {
            let here = step(&mixed);
            mixed += mixing.mixed(&mixed, here);
            plain += step(&plain);
        }
        let off = |place: &DMatrix<f64>| (place.column(0) - &answer).norm();
        assert!(off(&mixed) < 1e-3 * off(&plain), "{} {}", off(&mixed), off(&plain));
    }
}
