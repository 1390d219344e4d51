//! Usually quoted quantities of an orbit: period in days, time of the largest radial velocity and of inferior
//! conjunction, minimum mass, eccentricity; for single orbits, with uncertainties for circular ones. For each draw of a
//! chain see `quoted`.
//!
//! Formulas are in `star::planet`.

use super::Parameter;
use super::elements::{Clock, to_conjunction};
use crate::numerics::units::EARTHS_PER_JUPITER;
use crate::star::planet::{maximum_phase, minimum_mass};
use crate::star::{Eccentric, Orbit, StarSettings};
use serde::{Deserialize, Serialize};

/// Standard deviation of a uniform phase (cycles).
pub(super) const UNKNOWN_PHASE: f64 = 0.288_675_134_594_812_9;

/// Minimum masses below this (Jupiter masses) are also given in masses of the Earth.
const SMALL_MJUP: f64 = 0.1;

/// A quantity of an orbit. The order is that of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrbitQuantity {
    /// Orbital period (d).
    Period,
    /// Time of the largest radial velocity nearest to the middle of the data (d).
    Maximum,
    /// Time of the inferior conjunction nearest to the middle of the data (d).
    Conjunction,
    /// Minimum mass of the planet (Jupiter masses).
    MinimumMass,
    /// Eccentricity.
    Eccentricity,
    /// Argument of periastron of the star's orbit (degrees).
    Omega,
}

impl OrbitQuantity {
    /// Those of a circular orbit, in order.
    pub const ALL: [OrbitQuantity; 4] =
        [OrbitQuantity::Period, OrbitQuantity::Maximum, OrbitQuantity::Conjunction, OrbitQuantity::MinimumMass];

    /// The name used in files and tables.
    pub fn name(self) -> &'static str {
        match self {
            OrbitQuantity::Period => "period_d",
            OrbitQuantity::Maximum => "t_max_rv_d",
            OrbitQuantity::Conjunction => "t_conjunction_d",
            OrbitQuantity::MinimumMass => "msini_mjup",
            OrbitQuantity::Eccentricity => "eccentricity",
            OrbitQuantity::Omega => "omega_deg",
        }
    }

    /// Whether it is the time of an event that recurs with every orbit.
    pub fn is_event(self) -> bool {
        matches!(self, OrbitQuantity::Maximum | OrbitQuantity::Conjunction)
    }

    /// Unit of its values.
    pub fn unit(self) -> &'static str {
        match self {
            OrbitQuantity::MinimumMass => "Mjup",
            OrbitQuantity::Eccentricity => "1",
            OrbitQuantity::Omega => "deg",
            OrbitQuantity::Period | OrbitQuantity::Maximum | OrbitQuantity::Conjunction => "d",
        }
    }

    /// Its symbol, in LaTeX without dollars.
    pub fn latex(self) -> &'static str {
        match self {
            OrbitQuantity::Period => r"P_\mathrm{orb}",
            OrbitQuantity::Maximum => r"T_\mathrm{max\,RV}",
            OrbitQuantity::Conjunction => r"T_\mathrm{conj}",
            OrbitQuantity::MinimumMass => r"M \sin i",
            OrbitQuantity::Eccentricity => "e",
            OrbitQuantity::Omega => r"\omega",
        }
    }

    /// Its description in one line; `None` where the name is enough.
    pub fn definition(self) -> Option<&'static str> {
        Some(match self {
            OrbitQuantity::Period | OrbitQuantity::Eccentricity => return None,
            OrbitQuantity::Omega => "argument of periastron of the star's orbit (degrees)",
            OrbitQuantity::Maximum => {
                "time (d) of the largest (receding) radial velocity nearest to the middle of the data"
            }
            OrbitQuantity::Conjunction => {
                "time (d) of the inferior conjunction (planet in front) nearest to the middle of the data"
            }
            OrbitQuantity::MinimumMass => "minimum mass of the planet (Jupiter masses) for star.mass_msun",
        })
    }
}

/// A value and its standard error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub sd: f64,
}

/// Required properties of star and data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitQuantities {
    /// Period (d) that `porb_over_prot` refers to.
    pub rotation_period_d: f64,
    /// Time (d) that phi is counted from.
    pub epoch_d: f64,
    /// First and last time of the data (d); without it there are no times.
    pub time_span_d: Option<[f64; 2]>,
    /// Mass of the star (solar masses); without it there is no minimum mass.
    pub mass_msun: Option<f64>,
}

impl OrbitQuantities {
    /// Those of a star and data of that span.
    pub fn new(star: &StarSettings, mass_msun: Option<f64>, time_span_d: Option<[f64; 2]>) -> Self {
        OrbitQuantities { rotation_period_d: star.rotation_period_d, epoch_d: star.epoch_d, time_span_d, mass_msun }
    }

    /// Middle of the data (d).
    pub fn middle_d(&self) -> Option<f64> {
        self.time_span_d.map(|[first, last]| 0.5 * (first + last))
    }

    /// Rotation period and epoch for ephemerides.
    pub fn clock(&self) -> Clock {
        Clock { rotation_period_d: self.rotation_period_d, epoch_d: self.epoch_d }
    }

    /// Period (d) of an orbit.
    pub fn period_d(&self, orbit: &Orbit) -> f64 {
        self.rotation_period_d * orbit.porb_over_prot
    }

    /// Phase of an event, counted like phi; `None` for other quantities.
    fn phase(quantity: OrbitQuantity, orbit: &Eccentric) -> Option<f64> {
        let maximum = maximum_phase(&orbit.orbit);
        match quantity {
            OrbitQuantity::Maximum => Some(maximum),
            OrbitQuantity::Conjunction => Some(maximum + to_conjunction(&orbit.shape)),
            _ => None,
        }
    }

    /// Time (d) of an event nearest to `near`.
    fn time(&self, phase: f64, orbit: &Orbit, near: f64) -> f64 {
        let period = self.period_d(orbit);
        let turns = ((near - self.epoch_d) / period - phase).round();
        self.epoch_d + period * (turns + phase)
    }

    /// The value for one orbit; an event nearest to `near`, or else to the middle of the data. `None` where it is
    /// undefined.
    pub fn value(&self, quantity: OrbitQuantity, orbit: &Eccentric, near: Option<f64>) -> Option<f64> {
        let period = self.period_d(&orbit.orbit);
        let value = match quantity {
            OrbitQuantity::Period => Some(period),
            OrbitQuantity::MinimumMass => {
                let round = (1.0 - orbit.shape.eccentricity().powi(2)).sqrt();
                Some(minimum_mass(orbit.orbit.k_kms * round, period, self.mass_msun?).mjup)
            }
            OrbitQuantity::Eccentricity => Some(orbit.shape.eccentricity()),
            OrbitQuantity::Omega => Some(orbit.shape.omega().to_degrees().rem_euclid(360.0)),
            event => Self::phase(event, orbit)
                .zip(near.or(self.middle_d()))
                .map(|(phase, near)| self.time(phase, &orbit.orbit, near)),
        };
        value.filter(|value| value.is_finite())
    }

    /// The value for a circular orbit with its standard error to first order, from the covariance of K, period over
    /// rotation period and phi. The error of an event is at most that of a uniform phase.
    pub fn estimate(&self, quantity: OrbitQuantity, orbit: &Orbit, covariance: &[[f64; 3]; 3]) -> Option<Estimate> {
        let value = self.value(quantity, &(*orbit).into(), None)?;
        let (prot, period) = (self.rotation_period_d, self.period_d(orbit));
        let slope = match quantity {
            OrbitQuantity::Period => [0.0, prot, 0.0],
            OrbitQuantity::Maximum | OrbitQuantity::Conjunction => {
                [0.0, (value - self.epoch_d) / orbit.porb_over_prot, period]
            }
            OrbitQuantity::MinimumMass => {
                let mass = minimum_mass(orbit.k_kms, period, self.mass_msun?);
                [mass.by_k, prot * mass.by_period, 0.0]
            }
            OrbitQuantity::Eccentricity | OrbitQuantity::Omega => return None,
        };
        let variance: f64 = (0..3).flat_map(|i| (0..3).map(move |j| slope[i] * covariance[i][j] * slope[j])).sum();
        let most = if quantity.is_event() { UNKNOWN_PHASE * period } else { f64::INFINITY };
        Some(Estimate { value, sd: variance.max(0.0).sqrt().min(most) })
    }
}

/// The description of a parameter of an orbit in one line, where its name is not enough.
pub fn definition(parameter: &str) -> Option<&'static str> {
    Parameter::from_name(parameter)?.spec().definition
}

/// A small mass (Jupiter masses) in words, in masses of the Earth; `None` for a larger one.
pub fn in_earths(mjup: f64) -> Option<String> {
    (mjup < SMALL_MJUP).then(|| format!("{mjup:.4} Jupiter masses are {:.2} of the Earth", mjup * EARTHS_PER_JUPITER))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAR: OrbitQuantities = OrbitQuantities {
        rotation_period_d: 3.0,
        epoch_d: 2_459_000.25,
        time_span_d: Some([2_459_310.0, 2_459_330.0]),
        mass_msun: Some(0.9),
    };

    /// Quoted times are those of the named event in the model's velocity, and no other such time is nearer to the
    /// middle.
    #[test]
    fn times_are_those_of_the_velocities() {
        for (k, p, phi) in [(0.1, 1.7, 0.3), (0.4, 0.31, 0.99), (-0.1, 2.4, 0.6), (0.2, 30.0, 0.1)] {
            let orbit = Orbit { k_kms: k, porb_over_prot: p, phi };
            let velocity = |t: f64| orbit.velocity_kms((t - STAR.epoch_d) / STAR.rotation_period_d);
            let at = |quantity| STAR.value(quantity, &orbit.into(), None).unwrap();
            let (period, maximum) = (at(OrbitQuantity::Period), at(OrbitQuantity::Maximum));
            assert_eq!(period, 3.0 * p);
            assert!((velocity(maximum) / k.abs() - 1.0).abs() < 1e-9, "{maximum}");
            let conjunction = at(OrbitQuantity::Conjunction);
            assert!(velocity(conjunction).abs() < 1e-6 * k.abs());
            assert!(velocity(conjunction + 1e-3 * period) < 0.0 && velocity(conjunction - 1e-3 * period) > 0.0);
            for time in [maximum, conjunction] {
                assert!((time - 2_459_320.0).abs() <= 0.5 * period + 1e-9, "{time}");
            }
            assert_eq!(STAR.value(OrbitQuantity::Maximum, &orbit.into(), Some(maximum + 3.0 * period)), {
                Some(STAR.time(maximum_phase(&orbit), &orbit, maximum + 3.0 * period))
            });
        }
    }

    /// Errors to first order are those of differences, and a time far from the epoch may be known better than phi.
    #[test]
    fn errors_are_propagated() {
        let orbit = Orbit { k_kms: 0.1, porb_over_prot: 1.7, phi: 0.3 };
        // period and phi of which only a combination is constrained, the phase 107 cycles after the epoch
        let (sp, sphi, sk, small): (f64, f64, f64, f64) = (1e-3, 1e-3 * 62.7 / 1.7, 0.01, 1e-3);
        let covariance =
            [[sk * sk, 0.0, 0.0], [0.0, sp * sp, -sp * sphi], [0.0, -sp * sphi, sphi * sphi + small * small]];
        for quantity in OrbitQuantity::ALL {
            let found = STAR.estimate(quantity, &orbit, &covariance).unwrap();
            let by = |dk: f64, dp: f64, dphi: f64| {
                let moved = |sign: f64| Orbit {
                    k_kms: orbit.k_kms + sign * dk,
                    porb_over_prot: orbit.porb_over_prot + sign * dp,
                    phi: orbit.phi + sign * dphi,
                };
                let at = |sign: f64| STAR.value(quantity, &moved(sign).into(), None).unwrap();
                0.5 * (at(1.0) - at(-1.0))
            };
            // the two directions of the covariance, and K
            let along = by(0.0, 1e-2 * sp, -1e-2 * sphi) / 1e-2;
            let wanted = along.hypot(by(sk, 0.0, 0.0)).hypot(by(0.0, 0.0, small));
            assert!((found.sd / wanted - 1.0).abs() < 1e-2, "{quantity:?}: {found:?} {wanted}");
        }
        let maximum = STAR.estimate(OrbitQuantity::Maximum, &orbit, &covariance).unwrap();
        assert!(maximum.sd < 0.2 * sphi * 5.1, "{maximum:?}");
        let unknown = [[0.0; 3], [0.0, 100.0, 0.0], [0.0; 3]];
        let most = STAR.estimate(OrbitQuantity::Conjunction, &orbit, &unknown).unwrap().sd;
        assert!((most - UNKNOWN_PHASE * 5.1).abs() < 1e-9);
    }

    #[test]
    fn small_masses_are_told_in_earths() {
        assert_eq!(in_earths(0.01).unwrap(), "0.0100 Jupiter masses are 3.18 of the Earth");
        assert_eq!(in_earths(0.2), None);
    }
}
