//! Unknown RV offsets of data sets: one offset per set, marginalised over in velocities within a Gaussian prior; in
//! maps they are held at their most probable values, so that no spot mimics them (`docs/method.md` section 9).

use crate::field::{FieldError, Lifetime};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::{Frequencies, Peak, orbits};
use crate::planets::velocities::VelocityQuadratic;
use crate::surface::evolving_map::fit::usual;
use crate::surface::evolving_map::linearised::linearised;
use crate::surface::evolving_map::{Basis, Fitted};
use crate::surface::expansion::Nuisance;
use crate::surface::imaging::Imager;
use crate::surface::{ConstantVelocity, Known};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Standard deviation of the prior (km/s), around 0.
pub const PRIOR_KMS: f64 = 3.0;

/// Iterations over maps, orbit and RV offsets.
const ROUNDS: usize = 3;

/// RV offsets that move by less than this fraction of their uncertainties have converged.
const STAYS: f64 = 0.1;

/// The RV offset of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldZeroPoint {
    /// The value at which it is held in maps (km/s).
    #[serde(default)]
    pub held_kms: f64,
    /// Its value with the reported orbit, marginalised over all free parameters; absent where no model was fitted.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub found: Option<ConstantVelocity>,
}

/// Finds the RV offsets of those sets of `imager` that have a prior, and holds them there: by the velocity quadratic of
/// a usual field, with the best orbit at any of the `frequencies` in the model from the second round on; together with
/// the systemic velocity, if that is among the `nuisances`. The results serve to hold the offsets and are not
/// measurements: their errors are absorbed by the jitter.
///
/// # Errors
/// [`FieldError`].
pub fn hold(
    imager: &mut Imager,
    values: ParameterValues,
    nuisances: &[Nuisance],
    known: Known,
    frequencies: Option<&Frequencies>,
) -> Result<Vec<HeldZeroPoint>, FieldError> {
    let basis = Arc::new(Basis::rough(&imager.grid));
    let lifetime = known.lifetime.unwrap_or(Lifetime::Days(Parameter::SpotLifetime.usual()));
    let known = Known { lifetime: Some(lifetime), ..known };
    let systemic: Vec<Nuisance> = nuisances.iter().copied().filter(|n| n.parameter == Parameter::Vsys).collect();
    let mut values = values.without_planet();
    let mut near = None;
    for _ in 0..ROUNDS {
        let here = linearised(imager, usual(imager, &basis, values, known, near.as_ref())?, &systemic)?;
        let orbit = frequencies.and_then(|frequencies| best_orbit(&here.quadratic, frequencies));
        let Some(found) = here.constants(imager, &systemic, (orbit.as_ref(), None)) else { break };
        if let Some(Peak { porb_over_prot, orbit, .. }) = orbit {
            values.set(Parameter::K, orbit.k_kms);
            values.set(Parameter::PorbOverProt, porb_over_prot);
            values.set(Parameter::Phi, orbit.phi);
        }
        if let Some(ConstantVelocity { value_kms, .. }) = found.systemic {
            values.set(Parameter::Vsys, value_kms);
        }
        let mut stays = true;
        for (z, ConstantVelocity { value_kms, sigma_kms }) in found.offsets.into_iter().enumerate() {
            let moved = value_kms - imager.zero_points[z].held_kms();
            stays &= moved.abs() < STAYS * sigma_kms;
            imager.move_zero_point(z, moved);
        }
        near = Some(here.kept::<Fitted>().marginal.clone());
        if stays {
            break;
        }
    }
    Ok(imager.zero_points.iter().map(|z| HeldZeroPoint { held_kms: z.held_kms(), found: None }).collect())
}

/// The best of the orbits at these frequencies, its period held.
fn best_orbit(quadratic: &VelocityQuadratic, frequencies: &Frequencies) -> Option<Peak> {
    let trials = orbits::scan(quadratic, &frequencies.per_cycle);
    let found = trials.iter().filter_map(|trial| Some((trial.frequency, trial.orbit?)));
    let (frequency, orbit) = found.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l))?;
    Some(Peak {
        porb_over_prot: 1.0 / frequency,
        sigma_porb_over_prot: None,
        orbit,
        covariance: None,
        on_edge: false,
        alias: None,
        imitation: None,
    })
}
