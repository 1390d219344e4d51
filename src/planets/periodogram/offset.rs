//! Constant velocities beside an orbit: whether the systemic velocity is right, and the RV offsets common to all
//! profiles or to those of one data set.
//!
//! A wrong systemic velocity is absorbed in part by an orbit of another period. So the best orbit is searched for once
//! more with the constant free at every trial period.

use super::orbits::{design, mid_cycle, scan, velocities};
use super::peaks::{Peak, parameters};
use super::two_planets::without;
use crate::planets::velocities::VelocityQuadratic;
use nalgebra::{DMatrix, DVector, Vector2};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A constant velocity beside the orbit that is the best with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Offset {
    /// The velocity (km/s).
    pub velocity_kms: f64,
    /// Its standard error (km/s), at that period.
    pub sigma_kms: f64,
    /// ln L relative to the best orbit without a constant.
    pub gain: f64,
}

/// The constant beside an orbit of one of the `frequencies`; `best` is Delta ln L of the best orbit without it. `None`
/// where no constant is bounded.
pub fn offset(quadratic: &VelocityQuadratic, frequencies: &[f64], best: f64) -> Option<Offset> {
    let (slope, curvature) = (quadratic.gradient.sum(), quadratic.information.sum());
    let free = quadratic.beside(&DMatrix::from_element(quadratic.len(), 1, 1.0))?;
    let beside = scan(&free, frequencies).into_iter().filter_map(|trial| Some((trial.frequency, trial.orbit?)));
    let (frequency, orbit) = beside.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l))?;
    let gain = 0.5 * slope * slope / curvature + orbit.delta_ln_l - best;
    let rest = without(quadratic, frequency)?;
    let (slope, curvature) = (rest.gradient.sum(), rest.information.sum());
    Some(Offset { velocity_kms: slope / curvature, sigma_kms: curvature.sqrt().recip(), gain })
}

/// A velocity common to several profiles, with a Gaussian prior (km/s).
#[derive(Clone, Debug, PartialEq)]
pub struct Common {
    /// Its factor for each coordinate, the velocities of profiles first: 1 or 0, or a polynomial in time.
    pub of_each: DVector<f64>,
    /// Mean of the prior (km/s).
    pub mean_kms: f64,
    /// Standard deviation of the prior (km/s).
    pub sd_kms: f64,
}

/// The most probable values (km/s) of all `common` velocities, and their standard errors (km/s) with all of them free;
/// beside the orbit of the `peak`, if there is one, with its amplitude, phase and period free. `None` where they are
/// not bounded.
pub fn common_velocities(
    quadratic: &VelocityQuadratic,
    common: &[Common],
    peak: Option<&Peak>,
) -> Option<(DVector<f64>, DVector<f64>)> {
    let rest = match peak {
        Some(peak) => beside(quadratic, peak)?,
        None => quadratic.clone(),
    };
    let columns = DMatrix::from_fn(rest.len(), common.len(), |k, c| common[c].of_each[k]);
    let mut information = columns.tr_mul(&(&rest.information * &columns));
    let mut pulled = columns.tr_mul(&rest.gradient);
    for (c, Common { mean_kms, sd_kms, .. }) in common.iter().enumerate() {
        let weight = sd_kms.powi(-2);
        information[(c, c)] += weight;
        pulled[c] += weight * mean_kms;
    }
    let factor = information.cholesky()?;
    Some((factor.solve(&pulled), factor.inverse().diagonal().map(f64::sqrt)))
}

/// The quadratic around the orbit of the `peak`, with its amplitude, phase and period left free.
fn beside(quadratic: &VelocityQuadratic, peak: &Peak) -> Option<VelocityQuadratic> {
    let cycles = &quadratic.cycles;
    let theta = parameters(cycles, peak);
    let (a, b, frequency) = (theta[0], theta[1], theta[2]);
    let gradient = &quadratic.gradient - &quadratic.information * velocities(cycles, frequency, Vector2::new(a, b));
    let around = VelocityQuadratic { gradient, ..quadratic.clone() };
    let x = design(cycles, &[frequency]);
    let mid = mid_cycle(cycles);
    let by_frequency = |k: usize| TAU * (cycles[k] - mid) * (b * x[(k, 0)] - a * x[(k, 1)]);
    // without an amplitude, or on the edge of a search, the period is not fitted
    let period = peak.sigma_porb_over_prot.and_then(|_| {
        let of_three = |k: usize, c: usize| if c < 2 { x[(k, c)] } else { by_frequency(k) };
        around.beside(&DMatrix::from_fn(cycles.len(), 3, of_three))
    });
    period.or_else(|| around.beside(&x))
}

#[cfg(test)]
mod tests {
    use super::super::orbits::{amplitudes, at};
    use super::super::peaks::{peak, refined};
    use super::super::sample::{self, uneven};
    use super::super::{Frequencies, FrequencySettings};
    use super::*;
    use nalgebra::Vector3;

    /// Two data sets of one star with a planet, with an unknown offset between them and an unknown systemic velocity:
    /// the offset found is true within its uncertainty, which is that of a fit of all five parameters.
    #[test]
    fn common_velocities_scatter_as_their_errors_say() {
        let cycles: Vec<f64> =
            uneven(14, 3.0).into_iter().chain(uneven(11, 3.0).into_iter().map(|c| c + 17.3)).collect();
        let (n, first) = (cycles.len(), 14);
        let sigma = DVector::from_element(n, 0.04);
        let of_second = DVector::from_fn(n, |k, _| f64::from(u8::from(k >= first)));
        let all = DVector::from_element(n, 1.0);
        let orbit = sample::orbit(&cycles, 0.15, 2.3, 0.3);
        let common = [(all.clone(), 0.4), (of_second.clone(), 3.0)];
        let common = common.map(|(of_each, sd_kms)| Common { of_each, mean_kms: 0.0, sd_kms });
        let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
        let ab = amplitudes(&cycles, 1.0 / 2.3, 0.15, 0.3);
        let truth = peak(&cycles, Vector3::new(ab.x, ab.y, 1.0 / 2.3), None, 0.0);
        let (mut squares, mut wide, trials) = (0.0, 0, 60);
        for seed in 0..trials {
            let noise = sample::normal(n, seed).component_mul(&sigma);
            let rv = &orbit + 0.12 * &of_second + 0.05 * &all + noise;
            let quadratic = sample::independent(&cycles, &rv, &sigma);
            // at the best orbit with constants
            let x = DMatrix::from_columns(&[all.clone(), of_second.clone()]);
            let free = quadratic.beside(&x).unwrap();
            let peak = refined(&free, &frequencies, &truth);
            let (values, errors) = common_velocities(&quadratic, &common, Some(&peak)).unwrap();
            squares += ((values[1] - 0.12) / errors[1]).powi(2) / f64::from(trials as u32);
            // least squares of all parameters at once
            let theta = parameters(&cycles, &peak);
            let orbits = design(&cycles, &[theta[2]]);
            let step = 1e-6;
            let moved = |f: f64| velocities(&cycles, f, Vector2::new(theta[0], theta[1]));
            let slope = (moved(theta[2] + step) - moved(theta[2] - step)) / (2.0 * step);
            let column = |c: usize| match c {
                0 => all.clone(),
                1 => of_second.clone(),
                2 => slope.clone(),
                c => orbits.column(c - 3).into_owned(),
            };
            let x = DMatrix::from_columns(&(0..5).map(column).collect::<Vec<_>>()) / 0.04;
            let mut whole = x.tr_mul(&x);
            (whole[(0, 0)], whole[(1, 1)]) = (whole[(0, 0)] + 0.4f64.powi(-2), whole[(1, 1)] + 3f64.powi(-2));
            let expected = whole.try_inverse().unwrap()[(1, 1)].sqrt();
            assert!((errors[1] / expected - 1.0).abs() < 1e-4, "{} {expected}", errors[1]);
            // with systemic velocity and orbit fixed, the standard error is far too small
            let held = common_velocities(&quadratic, &common[1..], None).unwrap().1[0];
            wide += u32::from(errors[1] > 1.3 * held);
        }
        assert!((0.6..1.5).contains(&squares) && wide == trials as u32, "{squares} {wide}");
    }

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
