//! Stability of two planets.
//!
//! Orbits must not cross: `a1 (1 + e1) < a2 (1 - e2)`. Where the star's mass is known the planets must be stable by
//! Hill's criterion as well, so that close encounters are impossible at all times (Gladman 1993, *Icarus* 106, 247,
//! equation 21): with `mu_i = m_i / M`, `alpha = mu_1 + mu_2`, `gamma_i = sqrt(1 - e_i^2)` and `delta = sqrt(a2 / a1)`,
//!
//! `alpha^-3 (mu_1 + mu_2 / delta^2) (mu_1 gamma_1 + mu_2 gamma_2 delta)^2 > 1 + 3^(4/3) mu_1 mu_2 / alpha^(4/3)`.
//!
//! Masses are minimum masses, the least that would have to be stable.

use super::Eccentric;
use super::planet::minimum_mass;
use crate::numerics::units::JUPITERS_PER_SUN;

/// Why two planets are unstable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unstable {
    /// Their orbits cross.
    #[error("the orbits of the two planets cross")]
    Crossing,
    /// Hill's criterion.
    #[error("the two planets are too close to each other to be stable (Hill's criterion, Gladman 1993)")]
    Hill,
}

/// Whether planets with these orbits are stable, for a star with that rotation period (d), and mass (solar masses) if
/// known.
///
/// # Errors
/// [`Unstable`].
pub fn check(
    one: &Eccentric,
    other: &Eccentric,
    rotation_period_d: f64,
    mass_msun: Option<f64>,
) -> Result<(), Unstable> {
    let is_inner = one.orbit.porb_over_prot <= other.orbit.porb_over_prot;
    let (inner, outer) = if is_inner { (one, other) } else { (other, one) };
    // Kepler's third law
    let ratio = (outer.orbit.porb_over_prot / inner.orbit.porb_over_prot).powf(2.0 / 3.0);
    let [e1, e2] = [inner, outer].map(|planet| planet.shape.eccentricity());
    let (apastron, periastron) = (1.0 + e1, ratio * (1.0 - e2));
    if periastron.is_nan() || apastron >= periastron {
        return Err(Unstable::Crossing);
    }
    let Some(mass_msun) = mass_msun else { return Ok(()) };
    let [mu1, mu2] = [inner, outer].map(|planet| {
        let amplitude = planet.orbit.k_kms * (1.0 - planet.shape.eccentricity().powi(2)).sqrt();
        let period_d = rotation_period_d * planet.orbit.porb_over_prot;
        minimum_mass(amplitude, period_d, mass_msun).mjup / JUPITERS_PER_SUN / mass_msun
    });
    let alpha = mu1 + mu2;
    if alpha == 0.0 {
        return Ok(());
    }
    let [gamma1, gamma2] = [e1, e2].map(|e| (1.0 - e * e).sqrt());
    let delta = ratio.sqrt();
    let angular_momentum = (mu1 * gamma1 + mu2 * gamma2 * delta).powi(2);
    let left = alpha.powi(-3) * (mu1 + mu2 / (delta * delta)) * angular_momentum;
    let right = 1.0 + 3f64.powf(4.0 / 3.0) * mu1 * mu2 / alpha.powf(4.0 / 3.0);
    if left > right { Ok(()) } else { Err(Unstable::Hill) }
}

#[cfg(test)]
mod tests {
    use super::super::{Orbit, Shape};
    use super::*;

    fn planet(k_kms: f64, porb_over_prot: f64, e: f64) -> Eccentric {
        Eccentric { orbit: Orbit { k_kms, porb_over_prot, phi: 0.0 }, shape: Shape::new(e, 1.0) }
    }

    /// Small planets on circular orbits are stable if farther apart than 2 sqrt(3) mutual Hill radii, `a1 ((mu1 + mu2)
    /// / 3)^(1/3)` (Gladman 1993, equation 24).
    #[test]
    fn circles_are_stable_beyond_two_root_three_hill_radii() {
        let (mass_msun, rotation_period_d) = (1.0, 3.0);
        let k = 1e-4;
        let stable =
            |ratio: f64| check(&planet(k, 1.0, 0.0), &planet(k, ratio, 0.0), rotation_period_d, Some(mass_msun));
        let mu = 2.0 * minimum_mass(k, 3.0, mass_msun).mjup / JUPITERS_PER_SUN;
        let separation = 2.0 * 3f64.sqrt() * (mu / 3.0).cbrt();
        let ratio = |part: f64| (1.0 + part * separation).powf(1.5);
        assert_eq!(stable(ratio(1.1)), Ok(()));
        assert_eq!(stable(ratio(0.9)), Err(Unstable::Hill));
        // in either order
        let swapped = check(&planet(k, ratio(0.9), 0.0), &planet(k, 1.0, 0.0), rotation_period_d, Some(mass_msun));
        assert_eq!(swapped, Err(Unstable::Hill));
        assert_eq!(check(&planet(k, 1.0, 0.0), &planet(k, ratio(0.9), 0.0), rotation_period_d, None), Ok(()));
    }

    #[test]
    fn crossing_orbits_are_refused() {
        let pair = |e1: f64, e2: f64, ratio: f64| check(&planet(0.1, 1.0, e1), &planet(0.1, ratio, e2), 3.0, None);
        assert_eq!(pair(0.0, 0.0, 1.0), Err(Unstable::Crossing));
        // a2 / a1 = 2: they touch at 1 + e1 = 2 (1 - e2)
        let ratio = 2f64.powf(1.5);
        assert_eq!(pair(0.3, 0.34, ratio), Ok(()));
        assert_eq!(pair(0.3, 0.36, ratio), Err(Unstable::Crossing));
        assert_eq!(check(&planet(0.0, 1.0, 0.0), &planet(0.0, 2.0, 0.0), 3.0, Some(1.0)), Ok(()));
    }
}
