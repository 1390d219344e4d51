//! The most probable field of data that are not linear in it: Gauss-Newton, each step of which solves the linear
//! problem (`docs/method.md` section 9).
//!
//! The largest change of the field in a step is limited: far from the solution the linear model overestimates the gain.
//! Start from no field or from a nearby solution with the same hyperparameters; from other solutions the iteration may
//! not converge. Where the field hardly changes, steps with the covariance of an earlier iteration converge as well at
//! almost no cost: each is mixed with those before, and leaves some fifth of the distance.

use super::epoch::pulled;
use super::evidence::Nearby;
use super::tilt::tilted;
use super::{Compression, Degrees, Epoch, Evidence, Field, FieldError};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Largest change of the field in a step over that in the step before the last, up to which one covariance is kept; and
/// for how many steps.
const FALLS: f64 = 0.9;
const FROZEN: usize = 10;

/// Number of earlier steps mixed with each step.
const MIXED: usize = 3;

/// The problem to solve.
#[derive(Clone, Copy, Debug)]
pub struct Sought<'a> {
    /// The prior of the field.
    pub field: Field,
    /// Degrees of the coefficients (H).
    pub degrees: &'a Degrees,
    /// Harmonics (points, H) of the points at which changes of the field are monitored: some hundred.
    pub watched: &'a DMatrix<f64>,
}

/// When Gauss-Newton ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settling {
    /// Most steps.
    pub steps: usize,
    /// Largest change of the field, at the monitored points, at convergence.
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
    /// Number of steps, and number of those with a new covariance.
    pub steps: [usize; 2],
    /// Largest change of the field in the last of them.
    pub change: f64,
}

/// Finds the most probable field from the coefficients `start` (H, epochs), zeros for no field. `linearise` linearises
/// all epochs around such coefficients, one column per epoch: always the same epochs in the same order. Where there is
/// no model it gives numbers that are not finite.
///
/// With the evidence of a model and a field `nearby`, found before, first steps are made by its covariance. The
/// remaining distance is an error of ln Z (`docs/method.md` section 9). How many numbers of an epoch the field explains
/// (`tilt`) is found with each new covariance, or taken from nearby; the evidence at the end uses that of the end,
/// unless there is one nearby. ln Z depends on it to second order only, but a value found far from the solution made ln
/// Z of one star 2.6 too low.
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
    // a reference computes its own: neighbours begin from it
    let known = nearby.and_then(|nearby| last.as_ref().unwrap_or(nearby).explained());
    let explained = known.map(<[f64]>::to_vec);
    let seen = last.as_ref().or(nearby).and_then(Evidence::seen);
    // of many profiles each is hundreds of megabytes
    drop(last);
    let evidence = sought.evidence((&epochs, &coefficients), settings, Nearby { explained, seen })?;
    Ok(Settled { coefficients, evidence, steps, change })
}

/// The path to the most probable field.
pub(crate) struct Way {
    /// Where it ends: coefficients of the field (H, epochs).
    pub coefficients: DMatrix<f64>,
    /// The epochs made linear there.
    epochs: Vec<Epoch>,
    /// The last evidence computed on it before the end; `None` if the nearby one was enough.
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
    // a reference, from which others begin, needs a closer solution
    let near = if nearby.is_some() { settings.longest } else { 0.5 * settings.longest };
    while steps[0] < settings.steps {
        // steps with another covariance do not predict those with this one
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
    /// The change from `place`: a step, extrapolated by the steps before.
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
