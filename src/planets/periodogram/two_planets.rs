//! A second planet: the gain in ln L of two circular orbits over one, first with the period of the first fixed, then
//! with both refined together.
//!
//! At each period the 4 x 4 system in both (a, b) is solved by blocks: eliminating the first orbit's pair gives a
//! quadratic in the velocities again. Its periodogram is the gain, and gradients without a second planet have its
//! information as covariance.

use super::frequencies::Frequencies;
use super::orbits::{at, design, velocities};
use super::peaks::{Peak, parameters, peak, steps};
use super::refine::{Maximum, Model};
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DVector, Vector2, Vector3};

/// Two orbits with standard errors from the curvature in all six parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoOrbits {
    /// The first orbit, then the second. Their Delta ln L is that of both together.
    pub orbits: [Peak; 2],
    /// ln L of both relative to the first alone, in the same quadratic.
    pub gain: f64,
}

/// The quadratic with the orbit of that frequency (orbits a rotation cycle) left free; `None` where it is unbounded.
pub fn without(quadratic: &VelocityQuadratic, frequency: f64) -> Option<VelocityQuadratic> {
    quadratic.beside(&design(&quadratic.cycles, &[frequency]))
}

/// Both orbits refined together, from the `first` and from the `second` found beside it. `None` where they have no
/// maximum.
pub fn both(
    quadratic: &VelocityQuadratic,
    frequencies: &Frequencies,
    first: &Peak,
    second: &Peak,
) -> Option<TwoOrbits> {
    let cycles = &quadratic.cycles;
    let (lo, hi) = (frequencies.range().0 - frequencies.step(), frequencies.range().1 + frequencies.step());
    let orbit = |theta: &DVector<f64>, i: usize| {
        let frequency = theta[i + 2];
        (lo..=hi).contains(&frequency).then(|| velocities(cycles, frequency, Vector2::new(theta[i], theta[i + 1])))
    };
    let sum = |theta: &DVector<f64>| Some(orbit(theta, 0)? + orbit(theta, 3)?);
    // the first orbit, fitted with the second
    let frequency = 1.0 / first.porb_over_prot;
    let start_second = parameters(cycles, second);
    let taken = orbit(&start_second, 0)?;
    let x = design(cycles, &[frequency]);
    let rest = &quadratic.gradient - &quadratic.information * taken;
    let ab = x.tr_mul(&(&quadratic.information * &x)).cholesky()?.solve(&x.tr_mul(&rest));
    let start = DVector::from_vec(vec![ab[0], ab[1], frequency, start_second[0], start_second[1], start_second[2]]);
    let alone = at(quadratic, frequency).orbit?.delta_ln_l;
    let step = |k_kms: f64| steps(k_kms, frequencies.time_base_cycles);
    let steps = DVector::from_vec([step(first.orbit.k_kms), step(second.orbit.k_kms)].concat());
    let Maximum { theta, delta_ln_l, covariance } = Model { velocities: &sum, steps }.climb(quadratic, start)?;
    let one = |i: usize| {
        let own = covariance.as_ref().map(|c| c.fixed_view::<3, 3>(i, i).into_owned());
        peak(cycles, Vector3::new(theta[i], theta[i + 1], theta[i + 2]), own, delta_ln_l)
    };
    Some(TwoOrbits { orbits: [one(0), one(3)], gain: delta_ln_l - alone })
}

#[cfg(test)]
mod tests {
    use super::super::frequencies::FrequencySettings;
    use super::super::sample::{self, uneven};
    use super::super::{Search, SearchSettings};
    use super::*;

    #[test]
    fn the_gain_is_that_of_the_whole_system() {
        let cycles = uneven(30, 4.0);
        let quadratic = sample::correlated(&cycles, &(0.1 * sample::normal(30, 1)), 1);
        let (first, second) = (1.0 / 1.7, 1.0 / 0.6);
        let x = design(&cycles, &[first, second]);
        let b = x.tr_mul(&quadratic.gradient);
        let system = x.tr_mul(&(&quadratic.information * &x)).cholesky().unwrap();
        let whole = 0.5 * b.dot(&system.solve(&b));
        let height = |q: &VelocityQuadratic, f: f64| super::super::orbits::at(q, f).orbit.map(|o| o.delta_ln_l);
        let rest = without(&quadratic, first).unwrap();
        let parts = height(&quadratic, first).unwrap() + height(&rest, second).unwrap();
        assert!((whole - parts).abs() < 1e-9 * whole);
        assert_eq!(height(&rest, first), None);
    }

    #[test]
    fn two_orbits_without_noise_are_given_back() {
        let cycles = uneven(60, 8.0);
        let rv = sample::orbit(&cycles, 0.1, 1.7, 0.3) + sample::orbit(&cycles, 0.04, 0.63, 0.8);
        let quadratic = sample::correlated(&cycles, &rv, 4);
        let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
        let settings = SearchSettings { draws: 1000, seed: 1 };
        let first = Search::new(&quadratic, &frequencies, settings).unwrap();
        let rest = without(&quadratic, 1.0 / first.peaks[0].porb_over_prot).unwrap();
        let second = Search::new(&rest, &frequencies, settings).unwrap();
        let found = both(&quadratic, &frequencies, &first.peaks[0], &second.peaks[0]).unwrap();
        for (peak, (k, period, phi)) in found.orbits.iter().zip([(0.1, 1.7, 0.3), (0.04, 0.63, 0.8)]) {
            assert!((peak.orbit.k_kms - k).abs() < 1e-6 && (peak.porb_over_prot - period).abs() < 1e-5, "{peak:?}");
            assert!((peak.orbit.phi - phi).abs() < 1e-4, "{peak:?}");
        }
        assert!(found.gain > 0.0 && found.gain < first.peaks[0].orbit.delta_ln_l);
    }
}
