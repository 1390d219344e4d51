//! The star of a fit in the form of all surface models: linearised, with its spots as a field.

use super::{Assumed, Fitted};
use crate::field::{Field, FieldError};
use crate::model::Parameter;
use crate::surface::expansion::{Nuisance, STELLAR, of_the_star};
use crate::surface::imaging::Imager;
use crate::surface::{FieldErrors, Linearised, SpotField};
use std::sync::Arc;

/// The star of a fit.
pub(in crate::surface) fn linearised(
    imager: &Imager,
    fitted: Fitted,
    nuisances: &[Nuisance],
) -> Result<Linearised, FieldError> {
    let stellar: Vec<Parameter> = nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect();
    let [expansion, held] = fitted.marginal.expansions(imager, &stellar)?;
    let quadratic = expansion.velocities(nuisances);
    let fitted = match fitted.marginal.assumed.night_kms {
        0.0 => fitted,
        _ => Fitted { ln_evidence: held.log_likelihood, ..fitted },
    };
    Ok(Linearised {
        expansion,
        held: held.velocities(&of_the_star(nuisances)),
        regularised: quadratic.clone(),
        quadratic,
        unresolved_spots: 1.0,
        on_target: true,
        field: Some(SpotField::of(&fitted)),
        solution: Arc::new(fitted),
    })
}

impl SpotField {
    /// The field of a fit.
    pub(crate) fn of(fitted: &Fitted) -> Self {
        let Assumed { field: Field { spectrum, kernel }, jitter_kms, night_kms } = fitted.marginal.assumed;
        SpotField {
            spot_amplitude: spectrum.amplitude,
            spot_slope: spectrum.slope,
            spot_break_degree: spectrum.break_degree,
            spot_lifetime_d: kernel.lifetime.days(),
            velocity_jitter_kms: jitter_kms,
            night_offsets_kms: night_kms,
            ln_evidence: fitted.ln_evidence,
            at_bounds: fitted.at_bounds.iter().map(|name| (*name).to_owned()).collect(),
            errors: FieldErrors::default(),
        }
    }
}
