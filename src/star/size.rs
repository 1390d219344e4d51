//! Implications of rotation period, vsini and inclination: the radius of a star, and the mass for its stability.

use std::f64::consts::TAU;

/// Radius of the Sun (km) and its gravitational constant over it (km2/s2): IAU 2015 Resolution B3.
const SUN_KM: f64 = 695_700.0;
const SUN_BOUND: f64 = 1.327_124_4e11 / SUN_KM;

/// A rotating star.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// R sin i (solar radii).
    pub radius_sin_i: f64,
    /// Velocity of the equator (km/s).
    pub equator_kms: f64,
    /// Velocity at which a star of one solar mass and this radius breaks up (km/s).
    pub break_up_kms: f64,
    /// Smallest mass that is stable at this velocity (solar masses): v^2 R / G, ignoring flattening.
    pub least_mass: f64,
}

/// Upper bounds of radius (solar radii), equatorial velocity (km/s) and mass (solar masses) of stars.
const LARGEST: f64 = 1500.0;
const FASTEST_KMS: f64 = 700.0;
const HEAVIEST: f64 = 200.0;

impl Size {
    /// From rotation period (d), vsini (km/s) and inclination (deg).
    pub fn of(rotation_period_d: f64, vsini_kms: f64, inclination_deg: f64) -> Self {
        let radius_sin_i = vsini_kms * rotation_period_d * 86_400.0 / TAU / SUN_KM;
        let sin_i = inclination_deg.to_radians().sin();
        let equator_kms = vsini_kms / sin_i;
        let radius = radius_sin_i / sin_i;
        Size {
            radius_sin_i,
            equator_kms,
            break_up_kms: (SUN_BOUND / radius).sqrt(),
            least_mass: equator_kms.powi(2) * radius / SUN_BOUND,
        }
    }

    /// Why such a star is impossible: the key at fault, and the error. `None` where it is possible.
    pub fn refused(&self) -> Option<(&'static str, String)> {
        let Size { radius_sin_i, equator_kms, least_mass, .. } = *self;
        if equator_kms > FASTEST_KMS {
            let why =
                format!("implies an equatorial velocity of {equator_kms:.0} km/s: give the inclination in degrees");
            return Some(("star.inclination_deg", why));
        }
        let is_absurd = radius_sin_i > LARGEST || least_mass > HEAVIEST;
        is_absurd.then(|| {
            let why = format!(
                "implies R sin i = {radius_sin_i:.0} solar radii and a mass above {least_mass:.0} solar masses: give \
                the period in days"
            );
            ("star.rotation_period_d", why)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sun_and_a_fast_dwarf() {
        let sun = Size::of(25.05, 2.0, 90.0);
        assert!((sun.radius_sin_i - 0.99).abs() < 0.01 && sun.least_mass < 1e-4, "{sun:?}");
        let lo_peg = Size::of(0.4232, 67.7, 45.0);
        assert!((lo_peg.radius_sin_i / 0.707 - 0.80).abs() < 0.01, "{lo_peg:?}");
        assert!((lo_peg.least_mass - 0.0386).abs() < 1e-3, "{lo_peg:?}");
        assert_eq!(lo_peg.refused(), None);
    }

    #[test]
    fn radians_and_hours_are_named() {
        let (key, why) = Size::of(2.741, 30.3, 0.96).refused().unwrap();
        assert!(key == "star.inclination_deg" && why.contains("1808 km/s") && why.contains("degrees"), "{why}");
        let (key, why) = Size::of(27.4 * 24.0, 130.0, 60.0).refused().unwrap();
        assert!(key == "star.rotation_period_d" && why.contains("period in days"), "{why}");
    }
}
