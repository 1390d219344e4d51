//! The weights compared with a dense inverse, and their limits.

use super::*;
use crate::numerics::vector::Portable;
use nalgebra::DVector;

fn profile(first_velocity_kms: f64, phase: f64) -> Profile {
    let depth = |j: usize| 0.3 * (-0.5 * ((j as f64 - 9.5) / 4.0).powi(2)).exp();
    Profile {
        time_d: phase,
        first_velocity_kms,
        step_kms: 2.0,
        intensity: (0..20).map(|j| 1.0 - depth(j) + 0.01 * (phase + j as f64).sin()).collect(),
        sigma: (0..20).map(|j| 1e-3 * (1.5 + (0.7 * j as f64 + phase).cos())).collect(),
        exposure_s: None,
    }
}

/// Two profiles whose bins are offset from each other.
fn observations() -> Observations {
    Observations { profiles: vec![profile(-20.0, 0.0), profile(-17.3, 1.0)] }
}

/// Dense weights of profile `k`: the results for all unit vectors.
fn dense(nuisances: &Nuisances, k: usize, power: i32, root: bool) -> DMatrix<f64> {
    let (observations, bins) = (observations(), 20 * k..20 * k + 20);
    let mut matrix = DMatrix::zeros(20, 20);
    for j in 0..20 {
        let (mut x, mut out) = (vec![0.0; 40], vec![f64::NAN; 40]);
        x[20 * k + j] = 1.0;
        let sigma = &observations.profiles[k].sigma;
        bins.clone().for_each(|i| out[i] = x[i] * sigma[i - 20 * k].powi(-power));
        if root {
            nuisances.weigh_root(bins.clone(), &x, &mut out)
        } else {
            nuisances.weigh(Portable, bins.clone(), &x, &mut out)
        }
        matrix.column_mut(j).copy_from_slice(&out[bins.clone()]);
    }
    matrix
}

fn covariance(priors: LineAndContinuum, k: usize) -> DMatrix<f64> {
    let observations = observations();
    let profile = &observations.profiles[k];
    let rows = templates_of(profile, &observations);
    let t = DMatrix::from_fn(20, 3, |j, i| rows[j][i] * priors.numbers()[i]);
    DMatrix::from_diagonal(&DVector::from_iterator(20, profile.sigma.iter().map(|s| s * s))) + &t * t.transpose()
}

#[test]
fn weights_are_the_inverse_of_the_covariance_and_roots_their_root() {
    for priors in [[1e-3, 2e-3, 0.02], [0.0, 1e-2, 0.0], [1.0, 1.0, 1.0]].map(LineAndContinuum::of_numbers) {
        let nuisances = Nuisances::new(priors, &observations());
        for k in 0..2 {
            let (weights, root) = (dense(&nuisances, k, 2, false), dense(&nuisances, k, 1, true));
            let one = covariance(priors, k) * &weights;
            // the condition of the covariance: 1e6 for the widest priors, 1e6 weights
            assert!((one - DMatrix::identity(20, 20)).amax() < 1e-8);
            assert!((root.tr_mul(&root) - &weights).amax() < 1e-12 * weights.amax());
        }
    }
}

#[test]
fn wide_priors_project_the_templates_out() {
    let nuisances = Nuisances::new(LineAndContinuum::of_numbers([10.0; 3]), &observations());
    let observations = observations();
    for k in 0..2 {
        let weights = dense(&nuisances, k, 2, false);
        let rows = templates_of(&observations.profiles[k], &observations);
        for template in [0, 1, 2].map(|i| DVector::from_iterator(20, rows.iter().map(|row| row[i]))) {
            // the remaining information is the prior's: 1/100 where the data have 1e6
            assert!((&weights * &template).dot(&template) < 0.02);
        }
        let trace = (covariance(LineAndContinuum::default(), k) * weights).trace();
        assert!((trace - 17.0).abs() < 1e-4, "three of 20 degrees of freedom are gone: {trace}");
    }
}

#[test]
fn the_line_is_the_mean_of_all_profiles_where_they_are() {
    let observations = observations();
    let rows = templates_of(&observations.profiles[1], &observations);
    let [first, second] = [0, 1].map(|k| &observations.profiles[k]);
    let both = 1.0 - 0.5 * (second.intensity[3] + first.intensity_at(-11.3));
    assert!((rows[3][2] - both).abs() < 1e-12);
    // beyond the end of the first
    assert!((rows[19][2] - (1.0 - second.intensity[19])).abs() < 1e-12);
    assert_eq!((rows[0][1], rows[19][1]), (1.0, -1.0));
}

#[test]
fn fewer_profiles_or_larger_errors_are_as_if_made_so() {
    let priors = LineAndContinuum::of_numbers([1e-3, 2e-3, 0.02]);
    let all = Nuisances::new(priors, &observations());
    let sigma: Vec<f64> = observations().profiles[1].sigma.iter().map(|s| 3.0 * s).collect();
    let second = all.of_profiles(std::slice::from_ref(&(20..40)), &sigma);
    let x: Vec<f64> = (0..20).map(|j| (j as f64).cos()).collect();
    let mut weighted: Vec<f64> = x.iter().zip(&sigma).map(|(x, s)| x / (s * s)).collect();
    second.weigh(Portable, 0..20, &x, &mut weighted);
    let noise = DMatrix::from_diagonal(&DVector::from_iterator(20, sigma.iter().map(|s| s * s)));
    let quoted = observations().profiles[1].sigma.iter().map(|s| s * s).collect::<Vec<f64>>();
    let dense = covariance(priors, 1) - DMatrix::from_diagonal(&DVector::from_vec(quoted)) + noise;
    let wanted = dense.cholesky().unwrap().solve(&DVector::from_vec(x));
    assert!((DVector::from_vec(weighted) - &wanted).amax() < 1e-9 * wanted.amax());
}
