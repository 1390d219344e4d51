//! Whether the systemic velocity is right: how much ln L gains when a constant velocity is free beside the orbit.
//!
//! A wrong one does not stay in the mean: an orbit of another period takes it up. So the best orbit is searched for
//! once more with the constant left free at every trial period.

use super::orbits::scan;
use super::two_planets::{eliminated, without};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A constant velocity beside the orbit that is the best with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Offset {
    /// The velocity (km/s).
    pub velocity_kms: f64,
    /// Its standard error (km/s), at that period.
    pub sigma_kms: f64,
    /// ln L above that of the best orbit without a constant.
    pub gain: f64,
}

/// The constant beside an orbit of one of the `frequencies`; `best` is Delta ln L of the best orbit without it. `None`
/// where no constant is bounded.
pub fn offset(quadratic: &VelocityQuadratic, frequencies: &[f64], best: f64) -> Option<Offset> {
    let (slope, curvature) = (quadratic.gradient.sum(), quadratic.information.sum());
    let free = eliminated(quadratic, &DMatrix::from_element(quadratic.len(), 1, 1.0))?;
    let beside = scan(&free, frequencies).into_iter().filter_map(|trial| Some((trial.frequency, trial.orbit?)));
    let (frequency, orbit) = beside.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l))?;
    let gain = 0.5 * slope * slope / curvature + orbit.delta_ln_l - best;
    let rest = without(quadratic, frequency)?;
    let (slope, curvature) = (rest.gradient.sum(), rest.information.sum());
    Some(Offset { velocity_kms: slope / curvature, sigma_kms: curvature.sqrt().recip(), gain })
}

#[cfg(test)]
mod tests {
    use super::super::orbits::at;
    use super::super::sample::{self, uneven};
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn a_constant_velocity_is_told_from_the_orbit() {
        let cycles = uneven(30, 4.0);
        let frequencies = [0.2, 0.4, 1.0 / 1.7, 0.8, 1.3];
        let gain_of = |constant: f64| {
            let rv = sample::orbit(&cycles, 0.1, 1.7, 0.3).add_scalar(constant);
            let quadratic = sample::independent(&cycles, &rv, &DVector::from_element(30, 0.05));
            let best = frequencies.iter().map(|f| at(&quadratic, *f).orbit.unwrap().delta_ln_l).fold(0.0, f64::max);
            offset(&quadratic, &frequencies, best).unwrap()
        };
        let wrong = gain_of(0.2);
        assert!((wrong.velocity_kms - 0.2).abs() < 1e-10 && wrong.gain > 100.0, "{wrong:?}");
        assert!(wrong.sigma_kms > 0.05 / 30f64.sqrt() && wrong.sigma_kms < 0.011, "{wrong:?}");
        let right = gain_of(0.0);
        assert!(right.velocity_kms.abs() < 1e-10 && right.gain.abs() < 1e-8, "{right:?}");
    }
}
