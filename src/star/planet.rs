//! Quoted quantities of a planet's orbit: times of the largest radial velocity and of inferior conjunction, and the
//! minimum mass.
//!
//! The z axis points away from the observer, so that the star's radial velocity is `V = dz/dt` (positive receding) and
//! the planet, on the other side of the common centre of mass, is at `-z M / m`. At inferior conjunction the planet is
//! nearest to the observer and the star farthest: z is largest, V = 0, and V falls through zero, from receding to
//! approaching. On a circular orbit `V = K cos(2 pi (t - T) / P)` does so a quarter of a period *after* its maximum at
//! T: `T_conj = T_max + P / 4`. On an orbit with `V = K (cos(nu + omega) + e cos omega)` the maximum is at the true
//! anomaly `nu = -omega` and the conjunction at `nu = pi / 2 - omega` (the middle of the transit of an edge-on orbit).
//!
//! The minimum mass x = m sin i solves the mass function of the star, `x^3 / (M + x)^2 = P K^3 (1 - e^2)^(3/2) / (2 pi
//! G)`, in which the planet's own mass is counted as its minimum: exact for an orbit seen edge-on.

use super::Orbit;
use crate::numerics::units::{JUPITERS_PER_SUN, SECONDS_PER_DAY, SOLAR_GM_KM3_S2};
use std::f64::consts::TAU;

/// From the largest radial velocity of a circular orbit to the inferior conjunction (orbital cycles).
pub const MAXIMUM_TO_CONJUNCTION: f64 = 0.25;

/// Largest number of Newton steps in ln x; convergence is quadratic and never overshoots twice.
const STEPS: usize = 60;

/// A minimum mass with its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MinimumMass {
    /// m sin i (Jupiter masses).
    pub mjup: f64,
    /// Its derivative by the semi-amplitude (Jupiter masses s/km).
    pub by_k: f64,
    /// Its derivative by the period (Jupiter masses per day).
    pub by_period: f64,
}

/// The minimum mass of a planet that moves a star of `mass_msun` (solar masses) with `k_kms` (of an eccentric orbit `K
/// sqrt(1 - e^2)`) in `period_d`. A negative amplitude means the opposite phase.
pub fn minimum_mass(k_kms: f64, period_d: f64, mass_msun: f64) -> MinimumMass {
    let per_third = (period_d * SECONDS_PER_DAY / (TAU * SOLAR_GM_KM3_S2)).cbrt();
    let k = k_kms.abs();
    // for a planet of negligible mass; exact in the limit of small K
    let light = k * per_third * mass_msun.powf(2.0 / 3.0);
    if light == 0.0 {
        let by_k = JUPITERS_PER_SUN * per_third * mass_msun.powf(2.0 / 3.0);
        return MinimumMass { mjup: 0.0, by_k, by_period: 0.0 };
    }
    let mut ln_x = light.ln();
    for _ in 0..STEPS {
        let x = ln_x.exp();
        let excess = 3.0 * (ln_x - light.ln()) - 2.0 * (x / mass_msun).ln_1p();
        let step = excess / (3.0 - 2.0 * x / (mass_msun + x));
        ln_x -= step;
        if step.abs() < 1e-15 {
            break;
        }
    }
    let x = ln_x.exp();
    let (mjup, share) = (JUPITERS_PER_SUN * x, 3.0 - 2.0 * x / (mass_msun + x));
    MinimumMass { mjup, by_k: k_kms.signum() * 3.0 * mjup / (k * share), by_period: mjup / (period_d * share) }
}

/// The semi-amplitude (km/s) of a circular orbit with the minimum mass `mjup` (Jupiter masses): the inverse of
/// [`minimum_mass`].
pub fn amplitude_kms(mjup: f64, period_d: f64, mass_msun: f64) -> f64 {
    let per_third = (period_d * SECONDS_PER_DAY / (TAU * SOLAR_GM_KM3_S2)).cbrt();
    let x = mjup / JUPITERS_PER_SUN;
    x / (per_third * (mass_msun + x).powf(2.0 / 3.0))
}

/// Phase (orbital cycles) of the largest radial velocity of a circular orbit: phi, or opposite to it for a negative
/// amplitude.
pub fn maximum_phase(orbit: &Orbit) -> f64 {
    if orbit.k_kms < 0.0 { orbit.phi + 0.5 } else { orbit.phi }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Positions of star and planet (arbitrary units; z away from the observer) at an angle along a circular orbit of
    /// that inclination.
    fn places(angle: f64, inclination: f64, mass_ratio: f64) -> [[f64; 3]; 2] {
        // the orbit in its own plane, then tilted about the x axis, the line of nodes
        let (x, y) = (angle.cos(), angle.sin());
        let planet = [x, y * inclination.cos(), y * inclination.sin()];
        [planet.map(|c| -c * mass_ratio), planet]
    }

    /// An orbit followed in three dimensions: the planet is in front of the star a quarter period after the star
    /// recedes fastest.
    #[test]
    fn the_planet_is_in_front_a_quarter_period_after_the_largest_velocity() {
        let orbit = Orbit { k_kms: 0.1, porb_over_prot: 1.7, phi: 0.3 };
        for inclination in [0.3, 1.0, PI / 2.0] {
            let steps = 100_000;
            let star_z = |k: i32| places(TAU * f64::from(k) / f64::from(steps), inclination, 1e-3)[0][2];
            let velocity = |k: i32| star_z(k + 1) - star_z(k - 1);
            let fastest = (0..steps).max_by(|a, b| velocity(*a).total_cmp(&velocity(*b))).unwrap();
            let planet_z = |k: i32| places(TAU * f64::from(k) / f64::from(steps), inclination, 1e-3)[1][2];
            let front = (0..steps).min_by(|a, b| planet_z(*a).total_cmp(&planet_z(*b))).unwrap();
            let after = f64::from((front - fastest).rem_euclid(steps)) / f64::from(steps);
            assert!((after - MAXIMUM_TO_CONJUNCTION).abs() < 1e-3, "{after}");
        }
        // and the velocity of the model falls through zero there
        let conjunction = 1.7 * (maximum_phase(&orbit) + MAXIMUM_TO_CONJUNCTION);
        assert!(orbit.velocity_kms(conjunction).abs() < 1e-15);
        assert!(orbit.velocity_kms(conjunction - 0.1) > 0.0 && orbit.velocity_kms(conjunction + 0.1) < 0.0);
        let opposite = Orbit { k_kms: -0.1, ..orbit };
        assert!((opposite.velocity_kms(1.7 * maximum_phase(&opposite)) - 0.1).abs() < 1e-15);
    }

    /// Jupiter moves the Sun by 12.46 m/s in 11.862 years, and a planet of Jupiter's mass with a period of a year by
    /// 28.43 m/s, for a total of one solar mass (Lovis & Fischer 2010).
    #[test]
    fn jupiter_has_the_mass_of_jupiter() {
        let jupiter = minimum_mass(0.012465, 4332.59, 1.0).mjup;
        assert!((jupiter - 1.0).abs() < 2e-3, "{jupiter}");
        let year = minimum_mass(0.0284329, 365.25, 1.0 - 1.0 / JUPITERS_PER_SUN).mjup;
        assert!((year - 1.0).abs() < 1e-4, "{year}");
    }

    /// Two bodies of any masses, each on its circular orbit around the common centre (Kepler's third law, edge-on).
    #[test]
    fn the_planets_own_mass_is_counted() {
        for (star, planet) in [(1.0, 1e-6), (0.5, 0.01), (1.0, 0.3), (1.0, 2.0)] {
            let period_d = 3.0;
            let period_s = period_d * SECONDS_PER_DAY;
            let separation = (SOLAR_GM_KM3_S2 * (star + planet) * (period_s / TAU).powi(2)).cbrt();
            let k = TAU / period_s * separation * planet / (star + planet);
            let found = minimum_mass(k, period_d, star);
            assert!((found.mjup / (planet * JUPITERS_PER_SUN) - 1.0).abs() < 1e-12, "{star} {planet}: {found:?}");
            let by = |dk: f64, dp: f64| minimum_mass(k + dk, period_d + dp, star).mjup;
            let h = 1e-5 * k;
            assert!(((by(h, 0.0) - by(-h, 0.0)) / (2.0 * h) / found.by_k - 1.0).abs() < 1e-6);
            assert!(((by(0.0, 1e-4) - by(0.0, -1e-4)) / 2e-4 / found.by_period - 1.0).abs() < 1e-6);
            assert_eq!(minimum_mass(-k, period_d, star).by_k, -found.by_k);
            assert!((amplitude_kms(found.mjup, period_d, star) / k - 1.0).abs() < 1e-12);
        }
        let nothing = minimum_mass(0.0, 3.0, 1.0);
        assert!((nothing.by_k / (minimum_mass(1e-9, 3.0, 1.0).mjup / 1e-9) - 1.0).abs() < 1e-6 && nothing.mjup == 0.0);
    }
}
