//! The velocities that profiles have in common: the systemic velocity, and the RV offsets of data sets. Their errors
//! are those with all that is free: spots, jitter, each other, and the orbit that is reported.

use super::Linearised;
use super::expansion::Nuisance;
use super::imaging::Imager;
use crate::model::Parameter;
use crate::planets::periodogram::Peak;
use crate::planets::periodogram::offset::{Common, common_velocities};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// A velocity with its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConstantVelocity {
    /// The velocity (km/s).
    pub value_kms: f64,
    /// Its standard error (km/s).
    pub sigma_kms: f64,
}

/// Velocities that profiles have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Constants {
    /// Systemic velocity, where it is free.
    pub systemic: Option<ConstantVelocity>,
    /// RV offsets of those data sets whose offset is fitted, in the order of the sets.
    pub offsets: Vec<ConstantVelocity>,
    /// What both add to the velocity of each profile in [`Linearised::held`] (km/s).
    pub of_each_kms: DVector<f64>,
}

impl Linearised {
    /// The velocities that profiles of `imager` have in common, beside the orbit of the `peak`, with its amplitude,
    /// phase and period free, or beside no orbit. The systemic velocity is free if it is among the `nuisances`. `None`
    /// where they are not bounded.
    pub fn constants(&self, imager: &Imager, nuisances: &[Nuisance], peak: Option<&Peak>) -> Option<Constants> {
        let n = self.held.len();
        let vsys_kms = self.expansion.values[Parameter::Vsys];
        let systemic = nuisances.iter().find(|nuisance| nuisance.parameter == Parameter::Vsys);
        let systemic = systemic.map(|prior| Common {
            of_each: DVector::from_element(n, 1.0),
            mean_kms: prior.mean - vsys_kms,
            sd_kms: prior.sd,
        });
        let columns = imager.offset_columns(n);
        let offset = |(z, column): (usize, nalgebra::DVectorView<f64>)| {
            let prior = &imager.zero_points[z];
            Common { of_each: column.into_owned(), mean_kms: prior.mean_kms, sd_kms: prior.sd_kms }
        };
        let is_free = systemic.is_some();
        let all: Vec<Common> = systemic.into_iter().chain(columns.column_iter().enumerate().map(offset)).collect();
        let (values, sigmas) = common_velocities(&self.held, &all, peak)?;
        // from where the expansion holds them
        let centres = is_free.then_some(vsys_kms).into_iter().chain(imager.zero_points.iter().map(|z| z.held_kms()));
        let found = centres.zip(values.iter().zip(&sigmas));
        let mut found = found.map(|(at, (value, sigma))| ConstantVelocity { value_kms: at + value, sigma_kms: *sigma });
        let of_each = |sum: DVector<f64>, (common, value): (&Common, &f64)| sum + *value * &common.of_each;
        Some(Constants {
            systemic: if is_free { found.next() } else { None },
            offsets: found.collect(),
            of_each_kms: all.iter().zip(&values).fold(DVector::zeros(n), of_each),
        })
    }
}
