//! The expansion in the orbit's velocities, marginalised over systemic velocity and stellar parameters within their
//! priors, each represented by a Gaussian of the same mean and variance.

use super::{Expansion, STELLAR};
use crate::model::{FreeParameter, Parameter};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A parameter that is marginalised over, with the Gaussian that represents its prior.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Nuisance {
    /// Systemic velocity, or one of [`STELLAR`].
    pub parameter: Parameter,
    /// Mean of its prior.
    pub mean: f64,
    /// Standard deviation of its prior.
    pub sd: f64,
}

/// The nuisances among the free parameters of a config.
pub fn nuisances(free: &[FreeParameter]) -> Vec<Nuisance> {
    let is_nuisance = |p: Parameter| p == Parameter::Vsys || STELLAR.contains(&p);
    let nuisance = |f: &FreeParameter| {
        let (mean, sd) = f.prior.mean_and_sd();
        Nuisance { parameter: f.parameter, mean, sd }
    };
    free.iter().filter(|f| is_nuisance(f.parameter)).map(nuisance).collect()
}

/// The nuisances that are not velocities: all but the systemic one.
pub fn of_the_star(nuisances: &[Nuisance]) -> Vec<Nuisance> {
    nuisances.iter().copied().filter(|nuisance| nuisance.parameter != Parameter::Vsys).collect()
}

impl Expansion {
    /// The quadratic in the velocities of the orbit alone, relative to the systemic velocity of the centre,
    /// marginalised over the `nuisances`. Stellar ones must be among the coordinates.
    pub fn velocities(&self, nuisances: &[Nuisance]) -> VelocityQuadratic {
        let (n, all) = (self.profiles(), self.centre.len());
        let columns = self.columns(nuisances);
        let (sd, offset) = self.priors(nuisances);
        let weight = sd.map(|sd| sd.powi(-2));
        // at orbital velocities 0, all else as in the centre, including a second planet
        let orbit = self.values.motion().first;
        let mut back = DVector::zeros(all);
        back.iter_mut().zip(&self.cycles).for_each(|(v, cycle)| *v = orbit.velocity_kms(*cycle));
        let gradient = &self.gradient + &self.information * &back;
        // the response of the nuisances to a change of velocities: eta = (N' I N + P)^-1 (N' (g - I v) + P offset)
        let mut keep = DMatrix::zeros(n, all);
        keep.view_mut((0, 0), (n, n)).fill_with_identity();
        let mut pulled = DVector::zeros(n);
        let own = columns.tr_mul(&(&self.information * &columns)) + DMatrix::from_diagonal(&weight);
        if let Some(own) = own.cholesky() {
            let response = self.information.rows(0, n) * &columns * own.inverse();
            keep -= &response * columns.transpose();
            pulled = &response * weight.component_mul(&offset);
        }
        let information = &keep * self.information.columns(0, n);
        VelocityQuadratic {
            cycles: self.cycles.clone(),
            gradient: &keep * gradient - pulled,
            information: 0.5 * (&information + information.transpose()),
        }
    }

    /// Derivatives of the coordinates with each nuisance, one column each.
    pub(in crate::surface) fn columns(&self, nuisances: &[Nuisance]) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(self.centre.len(), nuisances.len());
        for (mut column, nuisance) in columns.column_iter_mut().zip(nuisances) {
            column.copy_from(&self.direction(nuisance.parameter));
        }
        columns
    }
}
