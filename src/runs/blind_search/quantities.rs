//! Commonly quoted quantities of an orbit: times of the largest radial velocity and of inferior conjunction nearest to
//! the middle of the data, and the minimum mass where the star's is known.
//!
//! Uncertainties are to first order in K, period and phase; where the period has none, at that period.

use crate::model::{Estimate, OrbitQuantities, OrbitQuantity, ParameterValues};
use crate::planets::periodogram::KeplerianOrbit;
use crate::planets::periodogram::peaks::Peak;
use crate::star::Orbit;
use crate::star::planet::minimum_mass;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The quantities in a file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct QuantitiesRecord {
    /// Time of the largest radial velocity (d).
    pub t_max_rv_d: Option<f64>,
    /// Its uncertainty (d).
    pub sigma_t_max_rv_d: Option<f64>,
    /// Time of inferior conjunction (d).
    pub t_conjunction_d: Option<f64>,
    /// Its uncertainty (d).
    pub sigma_t_conjunction_d: Option<f64>,
    /// Minimum mass (Jupiter masses), where the star's is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub msini_mjup: Option<f64>,
    /// Its uncertainty (Jupiter masses).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_msini_mjup: Option<f64>,
}

impl QuantitiesRecord {
    fn new([maximum, conjunction, mass]: [Option<Estimate>; 3]) -> Self {
        // an unbounded orbit gives values that are not finite
        let value = |one: Option<Estimate>| one.map(|one| one.value).filter(|x| x.is_finite());
        let sigma = |one: Option<Estimate>| one.map(|one| one.sd).filter(|x| x.is_finite());
        QuantitiesRecord {
            t_max_rv_d: value(maximum),
            sigma_t_max_rv_d: sigma(maximum),
            t_conjunction_d: value(conjunction),
            sigma_t_conjunction_d: sigma(conjunction),
            msini_mjup: value(mass),
            sigma_msini_mjup: sigma(mass),
        }
    }

    /// For a circular orbit.
    pub(super) fn of_circle(peak: &Peak, quantities: &OrbitQuantities) -> Self {
        let found = peak.orbit;
        let orbit = Orbit { k_kms: found.k_kms, porb_over_prot: peak.porb_over_prot, phi: found.phi };
        let at_period = [[found.sigma_k_kms.powi(2), 0.0, 0.0], [0.0; 3], [0.0, 0.0, found.sigma_phi.powi(2)]];
        let covariance = peak.covariance.map_or(at_period, |c| [0, 1, 2].map(|i| [0, 1, 2].map(|j| c[(i, j)])));
        let all = [OrbitQuantity::Maximum, OrbitQuantity::Conjunction, OrbitQuantity::MinimumMass];
        let [maximum, conjunction, mass] = all.map(|quantity| quantities.estimate(quantity, &orbit, &covariance));
        // K of a known planet may be negative
        QuantitiesRecord::new([maximum, conjunction, mass.filter(|_| found.k_kms > 0.0)])
    }

    /// For an eccentric orbit; the uncertainty of the mass is that of `K sqrt(1 - e^2)`.
    pub(super) fn of_ellipse(orbit: &KeplerianOrbit, quantities: &OrbitQuantities) -> Self {
        let OrbitQuantities { rotation_period_d: prot, epoch_d, mass_msun, .. } = *quantities;
        let event = |cycle: f64, sigma: f64| Some(Estimate { value: epoch_d + prot * cycle, sd: prot * sigma });
        let mass = mass_msun.map(|mass_msun| {
            let mass = minimum_mass(orbit.mass_amplitude_kms, prot * orbit.porb_over_prot, mass_msun);
            Estimate { value: mass.mjup, sd: mass.by_k * orbit.sigma_mass_amplitude_kms }
        });
        QuantitiesRecord::new([
            event(orbit.maximum_cycle, orbit.sigma_maximum_cycle),
            event(orbit.conjunction_cycle, orbit.sigma_conjunction_cycle),
            mass,
        ])
    }

    /// The same for an injected planet, by name; times nearest to those found. Empty where there is none.
    pub(super) fn injected(
        &self,
        truth: Option<ParameterValues>,
        quantities: &OrbitQuantities,
    ) -> BTreeMap<String, f64> {
        let injected = truth.map(|truth| truth.motion().first).filter(|planet| planet.orbit.k_kms != 0.0);
        let value = |quantity: OrbitQuantity| {
            let value = quantities.value(quantity, injected.as_ref()?, Some(self.of(quantity)?.0))?;
            Some((quantity.name().to_owned(), value))
        };
        OrbitQuantity::ALL.into_iter().filter_map(value).collect()
    }

    /// Value and uncertainty of a quantity, if present.
    pub fn of(&self, quantity: OrbitQuantity) -> Option<(f64, Option<f64>)> {
        let (value, sigma) = match quantity {
            OrbitQuantity::Period | OrbitQuantity::Eccentricity | OrbitQuantity::Omega => return None,
            OrbitQuantity::Maximum => (self.t_max_rv_d, self.sigma_t_max_rv_d),
            OrbitQuantity::Conjunction => (self.t_conjunction_d, self.sigma_t_conjunction_d),
            OrbitQuantity::MinimumMass => (self.msini_mjup, self.sigma_msini_mjup),
        };
        value.map(|value| (value, sigma))
    }
}
