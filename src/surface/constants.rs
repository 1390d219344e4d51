//! The velocities that profiles have in common: the systemic velocity, and the RV offsets of data sets. Their
//! uncertainties include all that is free: spots, jitter, each other, and the reported orbit.

use super::Linearised;
use super::expansion::Nuisance;
use super::imaging::{Drift, Imager};
use crate::model::Parameter;
use crate::planets::periodogram::Peak;
use crate::planets::periodogram::offset::{Common, common_velocities};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A velocity with its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConstantVelocity {
    /// The velocity (km/s).
    pub value_kms: f64,
    /// Its standard error (km/s).
    pub sigma_kms: f64,
}

/// A drift of the velocities: its slope at the middle of the data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundDrift {
    /// The slope (km/s per day).
    pub kms_d: f64,
    /// Its standard error (km/s per day).
    pub sigma_kms_d: f64,
    /// Number of its data set (from 1), where the offset of that set is fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub data_set: Option<usize>,
}

/// A drift of so many standard errors is significant.
const SIGNIFICANT: f64 = 4.0;

/// A slope of so many standard errors without an orbit is marginalised over: a planet makes the uncertainties larger.
const INTEGRATED: f64 = 3.0;

/// The slope of each drift of `imager` (km/s per day), where one is so steep that it is to be marginalised over: by
/// velocities of this quadratic without an orbit, RV offsets and systemic velocity free according to the `nuisances`,
/// held at `vsys_kms`.
pub(super) fn slopes(
    held: &VelocityQuadratic,
    imager: &Imager,
    nuisances: &[Nuisance],
    vsys_kms: f64,
) -> Option<Vec<f64>> {
    let (_, all) = commons(imager, nuisances, vsys_kms, held.len());
    let (values, sigmas) = common_velocities(held, &all, None)?;
    let found = found_drifts(imager, all.len(), &values, &sigmas);
    let is_steep = found.iter().any(|drift| drift.sigmas() > INTEGRATED);
    is_steep.then(|| found.iter().map(|drift| drift.kms_d).collect())
}

/// The drifts of `imager`, their terms the last among so many common velocities of these `values`.
fn found_drifts(imager: &Imager, commons: usize, values: &DVector<f64>, sigmas: &DVector<f64>) -> Vec<FoundDrift> {
    let mut term = commons - imager.drifts.iter().map(Drift::terms).sum::<usize>();
    let slope = |drift: &Drift| {
        let [kms_d, sigma_kms_d] = [values[term], sigmas[term]].map(|kms| kms / drift.half_span_d);
        term += drift.terms();
        FoundDrift { kms_d: drift.held_kms_d + kms_d, sigma_kms_d, data_set: drift.set.map(|set| set + 1) }
    };
    imager.drifts.iter().map(slope).collect()
}

/// The systemic velocity, where it is among the `nuisances`, and whether it is; then all other velocities that so many
/// profiles have in common.
fn commons(imager: &Imager, nuisances: &[Nuisance], vsys_kms: f64, n: usize) -> (bool, Vec<Common>) {
    let systemic = nuisances.iter().find(|nuisance| nuisance.parameter == Parameter::Vsys);
    let systemic = systemic.map(|prior| Common {
        of_each: DVector::from_element(n, 1.0),
        mean_kms: prior.mean - vsys_kms,
        sd_kms: prior.sd,
    });
    (systemic.is_some(), systemic.into_iter().chain(imager.common_velocities(n)).collect())
}

impl FoundDrift {
    /// In units of its uncertainty.
    fn sigmas(&self) -> f64 {
        self.kms_d.abs() / self.sigma_kms_d
    }

    /// A text.
    pub fn line(&self) -> String {
        let FoundDrift { kms_d, sigma_kms_d, data_set } = self;
        let m_s = |kms: f64| format!("{:.1}", 1000.0 * kms);
        let of_set = data_set.map_or_else(String::new, |set| format!(" of data set {set}"));
        let of = format!("RV drift{of_set}: {} ± {} m/s/d", m_s(*kms_d), m_s(*sigma_kms_d));
        let is = "subtracted from rv_kms";
        match self.sigmas() > SIGNIFICANT {
            true => format!("{of} ({:.0}σ), {is}: a long-period companion or instrumental drift", self.sigmas()),
            false => format!("{of}, {is}"),
        }
    }
}

/// Velocities that profiles have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Constants {
    /// Systemic velocity, where it is free.
    pub systemic: Option<ConstantVelocity>,
    /// RV offsets of those data sets whose offset is fitted, in the order of the sets.
    pub offsets: Vec<ConstantVelocity>,
    /// Drift of the velocities, where one is marginalised over: the most significant one of several.
    pub drift: Option<FoundDrift>,
    /// The contribution of systemic velocity, offsets and drift to the velocity of each profile in [`Linearised::held`]
    /// (km/s).
    pub of_each_kms: DVector<f64>,
}

impl Linearised {
    /// The velocities that profiles of `imager` have in common, together with the orbit of the `peak`, its amplitude,
    /// phase and period free, or without an orbit; and together with the amplitudes of other velocities, the columns of
    /// `known` (profiles x amplitudes). The systemic velocity is free if it is among the `nuisances`. `None` where they
    /// are not bounded.
    pub fn constants(
        &self,
        imager: &Imager,
        nuisances: &[Nuisance],
        (peak, known): (Option<&Peak>, Option<&DMatrix<f64>>),
    ) -> Option<Constants> {
        let n = self.held.len();
        let vsys_kms = self.expansion.values[Parameter::Vsys];
        let (is_free, all) = commons(imager, nuisances, vsys_kms, n);
        let rest = known.and_then(|known| self.held.beside(known));
        let (values, sigmas) = common_velocities(rest.as_ref().unwrap_or(&self.held), &all, peak)?;
        // relative to where the expansion holds them
        let centres = is_free.then_some(vsys_kms).into_iter().chain(imager.zero_points.iter().map(|z| z.held_kms()));
        let found = centres.zip(values.iter().zip(&sigmas));
        let mut found = found.map(|(at, (value, sigma))| ConstantVelocity { value_kms: at + value, sigma_kms: *sigma });
        let of_each = |sum: DVector<f64>, (common, value): (&Common, &f64)| sum + *value * &common.of_each;
        let drifts = found_drifts(imager, all.len(), &values, &sigmas).into_iter();
        let drift = drifts.max_by(|a, b| a.sigmas().total_cmp(&b.sigmas()));
        Some(Constants {
            systemic: if is_free { found.next() } else { None },
            offsets: found.collect(),
            drift,
            of_each_kms: all.iter().zip(&values).fold(DVector::zeros(n), of_each),
        })
    }
}
