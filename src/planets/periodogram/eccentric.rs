//! The best Keplerian orbit around a peak.
//!
//! Given period, eccentricity and time of periastron, the velocities are linear in `K cos(omega)` and `K sin(omega)`;
//! the best of a grid in the other two at the peak's period is the start of an optimisation in all five. Its
//! coordinates are those of the circular orbit, (a, b, frequency), which give the mean longitude, and `(e cos omega, e
//! sin omega)`, which are regular at e = 0.

use super::frequencies::Frequencies;
use super::orbits::{SIGMA_OF_UNKNOWN_PHASE, at, mid_cycle};
use super::peaks::{Peak, parameters, refined, steps};
use super::refine::{Maximum, Model};
use crate::planets::velocities::VelocityQuadratic;
use crate::star::kepler::{mean_anomaly, true_anomaly};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use std::f64::consts::{PI, TAU};

/// No larger eccentricity is tried.
pub const LARGEST_ECCENTRICITY: f64 = 0.95;

/// Eccentricities of the grid.
const ECCENTRICITIES: [f64; 9] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];

/// Times of periastron of the grid.
const PERIASTRA: usize = 48;

/// Step in `e cos omega` and `e sin omega` for numerical derivatives.
const STEP: f64 = 1e-5;

/// A Keplerian orbit with its standard errors, NaN where ln L does not bound them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeplerianOrbit {
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Its standard error.
    pub sigma_k_kms: f64,
    /// Period over rotation period.
    pub porb_over_prot: f64,
    /// Its standard error.
    pub sigma_porb_over_prot: f64,
    /// Eccentricity.
    pub eccentricity: f64,
    /// Its standard error.
    pub sigma_eccentricity: f64,
    /// Argument of periastron (radians), in [0, 2 pi).
    pub omega: f64,
    /// Its standard error, at most that of a uniform angle.
    pub sigma_omega: f64,
    /// Rotation cycle of the periastron nearest to mid-time.
    pub periastron_cycle: f64,
    /// Its standard error, at most that of a uniform phase.
    pub sigma_periastron_cycle: f64,
    /// `K sqrt(1 - e^2)`(km/s), to which the mass of the planet is proportional.
    pub mass_amplitude_kms: f64,
    /// Its standard error.
    pub sigma_mass_amplitude_kms: f64,
    /// Rotation cycle of the largest radial velocity nearest to mid-time.
    pub maximum_cycle: f64,
    /// Its standard error, at most that of a uniform phase.
    pub sigma_maximum_cycle: f64,
    /// Rotation cycle of the inferior conjunction nearest to mid-time.
    pub conjunction_cycle: f64,
    /// Its standard error, at most that of a uniform phase.
    pub sigma_conjunction_cycle: f64,
    /// ln L relative to no planet.
    pub delta_ln_l: f64,
    /// ln L relative to the circular orbit of the peak, which has two parameters fewer.
    pub gain_over_circle: f64,
}

/// Velocities (km/s) of (a, b, frequency, e cos omega, e sin omega).
fn velocities(cycles: &[f64], theta: &DVector<f64>) -> DVector<f64> {
    let (mid, k) = (mid_cycle(cycles), theta[0].hypot(theta[1]));
    let (e, omega) = (theta[3].hypot(theta[4]), theta[4].atan2(theta[3]));
    let (sin_omega, cos_omega) = omega.sin_cos();
    let longitude_at_mid = -theta[1].atan2(theta[0]);
    let velocity = |cycle: &f64| {
        let (cos, sin) = true_anomaly(TAU * theta[2] * (cycle - mid) + longitude_at_mid - omega, e);
        k * (cos * cos_omega - sin * sin_omega + theta[3])
    };
    DVector::from_iterator(cycles.len(), cycles.iter().map(velocity))
}

/// The best of a grid over eccentricity and periastron at one frequency.
fn best_of_grid(quadratic: &VelocityQuadratic, frequency: f64) -> Option<DVector<f64>> {
    let mid = mid_cycle(&quadratic.cycles);
    let mut best: Option<(f64, DVector<f64>)> = None;
    for e in ECCENTRICITIES {
        for k in 0..PERIASTRA {
            let periastron = TAU * k as f64 / PERIASTRA as f64;
            let row = |cycle: &f64| {
                let (cos, sin) = true_anomaly(TAU * frequency * (cycle - mid) - periastron, e);
                [cos + e, -sin]
            };
            let rows: Vec<f64> = quadratic.cycles.iter().flat_map(row).collect();
            let x = DMatrix::from_row_slice(quadratic.len(), 2, &rows);
            let (b, information) = (x.tr_mul(&quadratic.gradient), x.tr_mul(&(&quadratic.information * &x)));
            let b = Vector2::new(b[0], b[1]);
            let Some(factor) = Matrix2::from_iterator(information.iter().copied()).cholesky() else { continue };
            let amplitudes = factor.solve(&b);
            let height = 0.5 * b.dot(&amplitudes);
            if best.as_ref().is_none_or(|(highest, _)| height > *highest) {
                let (k, omega) = (amplitudes.norm(), amplitudes.y.atan2(amplitudes.x));
                let (sin, cos) = (periastron - -omega).sin_cos();
                let theta = vec![k * cos, k * sin, frequency, e * omega.cos(), e * omega.sin()];
                best = Some((height, DVector::from_vec(theta)));
            }
        }
    }
    best.map(|(_, theta)| theta)
}

/// The best Keplerian orbit around `peak`; `None` where K is 0.
pub fn keplerian(quadratic: &VelocityQuadratic, frequencies: &Frequencies, peak: &Peak) -> Option<KeplerianOrbit> {
    let (lo, hi) = frequencies.range();
    let orbit = |theta: &DVector<f64>| {
        let inside = theta[2] >= lo - frequencies.step() && theta[2] <= hi + frequencies.step();
        let bound = theta[3].hypot(theta[4]) < LARGEST_ECCENTRICITY;
        (inside && bound).then(|| velocities(&quadratic.cycles, theta))
    };
    let [a, b, f] = steps(peak.orbit.k_kms, frequencies.time_base_cycles);
    let model = Model { velocities: &orbit, steps: DVector::from_vec(vec![a, b, f, 1e-4, 1e-4]) };
    let circle = parameters(&quadratic.cycles, peak).push(0.0).push(0.0);
    let starts = [Some(circle), best_of_grid(quadratic, 1.0 / peak.porb_over_prot)];
    let maxima = starts.into_iter().flatten().filter_map(|start| model.climb(quadratic, start));
    let maximum = maxima.max_by(|a, b| a.delta_ln_l.total_cmp(&b.delta_ln_l))?;
    // the peak's height may be of other maps
    let start = Peak { orbit: at(quadratic, 1.0 / peak.porb_over_prot).orbit?, ..*peak };
    let circle = refined(quadratic, frequencies, &start).orbit.delta_ln_l;
    Some(named(&quadratic.cycles, &maximum, circle))
}

/// The orbit at a maximum, its standard errors to first order in the coordinates.
fn named(cycles: &[f64], maximum: &Maximum, circle: f64) -> KeplerianOrbit {
    let Maximum { theta, delta_ln_l, covariance } = maximum;
    let (a, b, f, h, k) = (theta[0], theta[1], theta[2], theta[3], theta[4]);
    let sigma = |slope: [f64; 5]| {
        let slope = DVector::from_row_slice(&slope);
        covariance.as_ref().map_or(f64::NAN, |c| slope.dot(&(c * &slope)).sqrt())
    };
    // NaN arises here where an angle has no direction
    let capped = |sigma: f64, most: f64| if covariance.is_some() { sigma.min(most) } else { sigma };
    let (k2, e2) = (a * a + b * b, h * h + k * k);
    let (amplitude, e, omega) = (k2.sqrt(), e2.sqrt(), k.atan2(h));
    // radians from mid-time to periastron
    let angle = (b.atan2(a) + omega + PI).rem_euclid(TAU) - PI;
    let turn = 1.0 / (TAU * f);
    let unknown = SIGMA_OF_UNKNOWN_PHASE / f;
    // mean longitude at which the angle from the node is `from_node`, the true anomaly plus omega
    let longitude = |h: f64, k: f64, from_node: f64| {
        let omega = k.atan2(h);
        mean_anomaly(from_node - omega, h.hypot(k)) + omega
    };
    let passage = |from_node: f64| {
        let angle = (b.atan2(a) + longitude(h, k, from_node) + PI).rem_euclid(TAU) - PI;
        let by = |dh: f64, dk: f64| longitude(h + dh, k + dk, from_node) - longitude(h - dh, k - dk, from_node);
        // the angle may cross a branch cut between the two
        let slope = |dh: f64, dk: f64| ((by(dh, dk) + PI).rem_euclid(TAU) - PI) / (2.0 * STEP);
        let (by_h, by_k) = (turn * slope(STEP, 0.0), turn * slope(0.0, STEP));
        let error = sigma([-turn * b / k2, turn * a / k2, -turn * angle / f, by_h, by_k]);
        (mid_cycle(cycles) + turn * angle, capped(error, unknown))
    };
    let (maximum_cycle, sigma_maximum_cycle) = passage(0.0);
    let (conjunction_cycle, sigma_conjunction_cycle) = passage(0.5 * PI);
    let round = (1.0 - e2).sqrt();
    KeplerianOrbit {
        mass_amplitude_kms: amplitude * round,
        sigma_mass_amplitude_kms: sigma([
            round * a / amplitude,
            round * b / amplitude,
            0.0,
            -amplitude * h / round,
            -amplitude * k / round,
        ]),
        maximum_cycle,
        sigma_maximum_cycle,
        conjunction_cycle,
        sigma_conjunction_cycle,
        k_kms: amplitude,
        sigma_k_kms: sigma([a / amplitude, b / amplitude, 0.0, 0.0, 0.0]),
        porb_over_prot: 1.0 / f,
        sigma_porb_over_prot: sigma([0.0, 0.0, 1.0 / (f * f), 0.0, 0.0]),
        eccentricity: e,
        sigma_eccentricity: if e > 0.0 {
            sigma([0.0, 0.0, 0.0, h / e, k / e])
        } else {
            sigma([0.0, 0.0, 0.0, 1.0, 0.0])
        },
        omega: omega.rem_euclid(TAU),
        sigma_omega: capped(sigma([0.0, 0.0, 0.0, -k / e2, h / e2]), TAU * SIGMA_OF_UNKNOWN_PHASE),
        periastron_cycle: mid_cycle(cycles) + turn * angle,
        sigma_periastron_cycle: capped(
            sigma([-turn * b / k2, turn * a / k2, -turn * angle / f, -turn * k / e2, turn * h / e2]),
            unknown,
        ),
        delta_ln_l: *delta_ln_l,
        gain_over_circle: delta_ln_l - circle,
    }
}

#[cfg(test)]
mod tests {
    use super::super::frequencies::FrequencySettings;
    use super::super::orbits::CircularOrbit;
    use super::super::sample::{self, uneven};
    use super::*;

    fn peak_of(quadratic: &VelocityQuadratic, period: f64) -> (Frequencies, Peak) {
        let frequencies = Frequencies::new(&quadratic.cycles, 1.0, FrequencySettings::default()).unwrap();
        let orbit = at(quadratic, 1.0 / period).orbit.unwrap();
        let start = Peak {
            porb_over_prot: period,
            sigma_porb_over_prot: None,
            covariance: None,
            orbit,
            on_edge: false,
            alias: None,
            imitation: None,
        };
        let peak = refined(quadratic, &frequencies, &start);
        (frequencies, peak)
    }

    #[test]
    fn without_eccentricity_it_is_the_circle() {
        let cycles = uneven(40, 5.0);
        let theta = DVector::from_vec(vec![0.03, -0.04, 0.7, 0.0, 0.0]);
        let circle = super::super::orbits::velocities(&cycles, 0.7, Vector2::new(0.03, -0.04));
        assert!((velocities(&cycles, &theta) - &circle).norm() < 1e-14);
        let quadratic = sample::correlated(&cycles, &circle, 1);
        let (frequencies, peak) = peak_of(&quadratic, 1.0 / 0.7);
        let orbit = keplerian(&quadratic, &frequencies, &peak).unwrap();
        assert!(orbit.eccentricity < 1e-4 && orbit.gain_over_circle.abs() < 1e-6, "{orbit:?}");
        assert!((orbit.k_kms - 0.05).abs() < 1e-6);
        // a height of other maps is none of this likelihood
        let lower = Peak { orbit: CircularOrbit { delta_ln_l: peak.orbit.delta_ln_l - 10.0, ..peak.orbit }, ..peak };
        let orbit = keplerian(&quadratic, &frequencies, &lower).unwrap();
        assert!(orbit.gain_over_circle.abs() < 1e-6, "{orbit:?}");
    }

    #[test]
    fn an_eccentric_orbit_is_given_back() {
        let cycles = uneven(60, 6.0);
        for (e, omega) in [(0.3, 0.7), (0.6, 4.0), (0.05, 2.0)] {
            let theta = DVector::from_vec(vec![0.08, 0.05, 0.55, e * f64::cos(omega), e * f64::sin(omega)]);
            let quadratic = sample::correlated(&cycles, &velocities(&cycles, &theta), 1);
            let (frequencies, peak) = peak_of(&quadratic, 1.0 / 0.55);
            let found = keplerian(&quadratic, &frequencies, &peak).unwrap();
            assert!((found.eccentricity - e).abs() < 1e-4 && (found.omega - omega).abs() < 1e-3, "{found:?}");
            assert!((found.porb_over_prot * 0.55 - 1.0).abs() < 1e-5 && found.gain_over_circle > 0.0, "{found:?}");
            // at periastron the velocity has its own form: K (1 + e) cos omega
            let at = velocities(&[cycles[0], found.periastron_cycle, 2.0 * mid_cycle(&cycles) - cycles[0]], &theta)[1];
            assert!((at - theta[0].hypot(theta[1]) * (1.0 + e) * omega.cos()).abs() < 1e-3, "{at}");
            let ends = [cycles[0], 2.0 * mid_cycle(&cycles) - cycles[0]];
            let velocity = |cycle: f64| velocities(&[ends[0], cycle, ends[1]], &theta)[1];
            // the largest velocity is K (1 + e cos omega)
            let largest = theta[0].hypot(theta[1]) * (1.0 + e * omega.cos());
            assert!((velocity(found.maximum_cycle) - largest).abs() < 1e-4 * largest, "{found:?}");
            // at conjunction the velocity is K e cos omega, that of the centre of mass, and falls
            let at = velocity(found.conjunction_cycle) - theta[0].hypot(theta[1]) * e * omega.cos();
            assert!(at.abs() < 1e-3 * largest, "{at}");
            assert!(velocity(found.conjunction_cycle + 1e-3) < velocity(found.conjunction_cycle - 1e-3));
            assert!((found.mass_amplitude_kms - found.k_kms * (1.0 - e * e).sqrt()).abs() < 1e-4);
        }
    }
}
