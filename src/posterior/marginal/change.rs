//! Whether the star changes while it is observed: ln Z of a field that lives for some time against that of one that
//! lives for ever, with the best orbit in the model on both sides. Without it a planet of 100 m/s alone makes a star
//! look changing.

use super::Basis;
use super::fit::{Fitted, Known, fit};
use crate::field::{FieldError, Lifetime};
use crate::planets::periodogram::Frequencies;
use crate::planets::periodogram::orbits;
use crate::posterior::expansion::{Nuisance, STELLAR};
use crate::posterior::imaging::Imager;
use crate::posterior::objective::{Parameter, ParameterValues};
use serde::{Deserialize, Serialize};

/// A star changes where that gains more than this in ln Z: odds of 150 to 1.
pub const CHANGES: f64 = 5.0;

/// The comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// ln Z of the best changing field over that of the best one that does not change.
    pub ln_evidence_gain: f64,
    /// Lifetime of its spots (d).
    pub spot_lifetime_d: f64,
}

impl Change {
    /// Compares both for the profiles of `imager`, all but the orbit as in `values`, the `nuisances` integrated out.
    ///
    /// # Errors
    /// [`FieldError`] where one of the fields cannot be fitted.
    pub fn of(
        imager: &Imager,
        values: ParameterValues,
        frequencies: &Frequencies,
        nuisances: &[Nuisance],
        known: Known,
    ) -> Result<Self, FieldError> {
        let basis = Basis::new(&imager.grid);
        let side = |known: Known| with_best_orbit(imager, &basis, values, frequencies, nuisances, known);
        let (still, changing) = rayon::join(|| side(known.unchanging()), || side(Known { lifetime: None, ..known }));
        let (still, changing) = (still?, changing?);
        let spot_lifetime_d = match changing.marginal.assumed.field.kernel.lifetime {
            Lifetime::Days(days) => days,
            Lifetime::Static => f64::INFINITY,
        };
        Ok(Change { ln_evidence_gain: changing.ln_evidence - still.ln_evidence, spot_lifetime_d })
    }

    /// Whether the star changes.
    pub fn is_changing(&self) -> bool {
        self.ln_evidence_gain > CHANGES
    }

    /// What is to be said of it where it does.
    pub fn sentence(&self) -> String {
        format!(
            "the star changes while it is observed (spots that live {:.3} d rather than for ever gain {:.1} in ln of \
            the evidence), which this objective does not allow for: set imaging.objective to \"marginal-likelihood\"",
            self.spot_lifetime_d, self.ln_evidence_gain
        )
    }
}

/// The field fitted without an orbit, and again with the best one.
fn with_best_orbit(
    imager: &Imager,
    basis: &Basis,
    mut values: ParameterValues,
    frequencies: &Frequencies,
    nuisances: &[Nuisance],
    known: Known,
) -> Result<Fitted, FieldError> {
    values[Parameter::K] = 0.0;
    let alone = fit(imager, basis, values, known, None)?;
    let stellar: Vec<Parameter> = nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect();
    let quadratic = alone.marginal.expansion(imager, basis, &stellar)?.velocities(nuisances);
    let trials = orbits::scan(&quadratic, &frequencies.per_cycle);
    let best = trials
        .iter()
        .filter_map(|trial| Some((trial.frequency, trial.orbit?)))
        .max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l));
    let Some((frequency, orbit)) = best else { return Ok(alone) };
    values[Parameter::K] = orbit.k_kms;
    values[Parameter::PorbOverProt] = 1.0 / frequency;
    values[Parameter::Phi] = orbit.phi;
    let beside = fit(imager, basis, values, known, Some(&alone.marginal))?;
    Ok(if beside.ln_evidence > alone.ln_evidence { beside } else { alone })
}
