//! Velocity zero points of data sets that are not known: one number a set, integrated out of velocities within a
//! Gaussian prior; in maps they are held where they are most probable, so that no spot stands in for them
//! (`docs/method.md` section 9).

use crate::field::{FieldError, Lifetime};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::{Frequencies, orbits};
use crate::surface::evolving_map::Basis;
use crate::surface::evolving_map::fit::usual;
use crate::surface::imaging::{Imager, ZeroPointPrior};
use crate::surface::{ConstantVelocity, Known};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Standard deviation of the prior (km/s), around 0.
pub const PRIOR_KMS: f64 = 3.0;

/// Times that maps, orbit and zero points are found in turn.
const ROUNDS: usize = 3;

/// Zero points that move by less than this part of their errors stay.
const STAYS: f64 = 0.1;

/// The zero point of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldZeroPoint {
    /// Where it is held in maps (km/s).
    #[serde(default)]
    pub held_kms: f64,
    /// What is found of it beside the orbit that is reported, all that is free integrated out; absent where no model
    /// was fitted.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub found: Option<ConstantVelocity>,
}

/// Finds the zero points of those sets of `imager` that have a prior, and holds them there: by the velocity quadratic
/// of a usual field, with the best orbit at any of the `frequencies` in the model from the second round on. It is where
/// to hold them beside the systemic velocity of `values`, and no measurement of them.
///
/// # Errors
/// [`FieldError`].
pub fn hold(
    imager: &mut Imager,
    values: ParameterValues,
    known: Known,
    frequencies: Option<&Frequencies>,
) -> Result<Vec<HeldZeroPoint>, FieldError> {
    let basis = Basis::rough(&imager.grid);
    let lifetime = known.lifetime.unwrap_or(Lifetime::Days(Parameter::SpotLifetime.usual()));
    let known = Known { lifetime: Some(lifetime), ..known };
    let mut values = values;
    values.set(Parameter::K, 0.0);
    let mut near = None;
    for _ in 0..ROUNDS {
        let marginal = usual(imager, &basis, values, known, near.as_ref())?.marginal;
        let orbit = frequencies.and_then(|frequencies| {
            let quadratic = marginal.expansion(imager, &basis, &[]).ok()?.velocities(&[]);
            let trials = orbits::scan(&quadratic, &frequencies.per_cycle);
            let found = trials.iter().filter_map(|trial| Some((trial.frequency, trial.orbit?)));
            found.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l))
        });
        if let Some((frequency, orbit)) = orbit {
            values.set(Parameter::K, orbit.k_kms);
            values.set(Parameter::PorbOverProt, 1.0 / frequency);
            values.set(Parameter::Phi, orbit.phi);
        }
        let known_velocities = marginal.known_zero_points(imager, &basis, &[])?;
        let step = known_velocities.coordinates(&values) - &known_velocities.centre;
        let gradient = &known_velocities.gradient - &known_velocities.information * step;
        let (moves, sigmas) = most_probable(imager, &gradient, &known_velocities.information)?;
        let mut stays = true;
        for z in 0..imager.zero_points.len() {
            stays &= moves[z].abs() < STAYS * sigmas[z];
            imager.move_zero_point(z, moves[z]);
        }
        near = Some(marginal);
        if stays {
            break;
        }
    }
    Ok(imager.zero_points.iter().map(|z| HeldZeroPoint { held_kms: z.held_kms(), found: None }).collect())
}

/// How far the most probable zero points are from where they are held, and their errors (km/s).
fn most_probable(
    imager: &Imager,
    gradient: &DVector<f64>,
    information: &DMatrix<f64>,
) -> Result<(DVector<f64>, DVector<f64>), FieldError> {
    let columns = imager.offset_columns(gradient.len());
    let weight = |prior: &ZeroPointPrior| prior.sd_kms.powi(-2);
    let mut own = columns.tr_mul(&(information * &columns));
    let mut pulled = columns.tr_mul(gradient);
    for (z, prior) in imager.zero_points.iter().enumerate() {
        own[(z, z)] += weight(prior);
        pulled[z] += weight(prior) * prior.mean_kms;
    }
    let factor = own.cholesky().ok_or(FieldError::NotPositive)?;
    Ok((factor.solve(&pulled), factor.inverse().diagonal().map(f64::sqrt)))
}
