//! Tests of the coordinates of sampling.

use super::*;
use rand::SeedableRng;

fn space() -> ParameterSpace {
    let uniform = |parameter, min, max| FreeParameter { parameter, prior: Prior::Uniform { min, max } };
    let free = vec![
        FreeParameter { parameter: Parameter::Phi, prior: Prior::Periodic },
        uniform(Parameter::K, 0.0, 0.3),
        uniform(Parameter::PorbOverProt, 0.5, 4.0),
    ];
    ParameterSpace::new(free, ParameterValues::of_eight([0.1, 1.7, 0.5, 2.0, 0.0, 38.0, 40.0, 0.0]), 1.47, 2.94, 3.0)
}

#[test]
fn internal_and_written_coordinates_are_inverse_and_keep_the_orbit() {
    let space = space();
    assert_eq!(space.names(), ["k_kms", "porb_over_prot", "phi"]);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    for _ in 0..200 {
        let theta = space.sample_prior(&mut rng);
        let back = space.to_physical(&space.to_sampling(&theta));
        for (a, b) in theta.iter().zip(&back) {
            assert!((a - b).abs() < 1e-9, "{theta:?} {back:?}");
        }
        // x is the velocity at mid-time
        let velocity = space.values_at(&theta).state().motion.velocity_kms(1.47);
        assert!((space.to_sampling(&theta)[0] - velocity).abs() < 1e-12);
    }
}

#[test]
fn jacobian_is_the_determinant() {
    let space = space();
    let theta = [0.12, 1.6, 0.3];
    let h = 1e-6;
    let column = |i: usize| {
        let shifted = |h: f64| {
            let mut t = theta;
            t[i] += h;
            space.to_sampling(&t)
        };
        let (plus, minus) = (shifted(h), shifted(-h));
        [0, 1, 2].map(|j| (plus[j] - minus[j]) / (2.0 * h))
    };
    let m = nalgebra::Matrix3::from_columns(&[column(0), column(1), column(2)].map(nalgebra::Vector3::from));
    assert!((m.determinant().abs().ln() + space.log_jacobian(&theta)).abs() < 1e-6);
}

/// Two Keplerian orbits: round trip, with the determinant of the Jacobian by differences.
#[test]
fn ellipses_and_second_planets_have_coordinates_of_their_own() {
    use Parameter::{K, K2, Phi, Phi2, PorbOverProt, PorbOverProt2, SqrtECosOmega, SqrtESinOmega};
    let uniform = |parameter, min, max| FreeParameter { parameter, prior: Prior::Uniform { min, max } };
    let other = |parameter, prior| FreeParameter { parameter, prior };
    let disc = Prior::Disc { max_eccentricity: 0.5 };
    let free = vec![
        uniform(K, 0.0, 0.3),
        uniform(PorbOverProt, 0.5, 1.0),
        other(Phi, Prior::Periodic),
        other(SqrtECosOmega, disc),
        other(SqrtESinOmega, disc),
        uniform(K2, 0.0, 0.3),
        uniform(PorbOverProt2, 3.0, 4.0),
        other(Phi2, Prior::Periodic),
    ];
    let mut values = ParameterValues::of_eight([0.1, 0.7, 0.5, 2.0, 0.0, 38.0, 40.0, 0.0]);
    values.set(K2, 0.1);
    values.set(PorbOverProt2, 3.5);
    values.set(Phi2, 0.5);
    values.set(SqrtECosOmega, 0.0);
    values.set(SqrtESinOmega, 0.0);
    let space = ParameterSpace::new(free, values, 1.47, 2.94, 3.0);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    for _ in 0..20 {
        let theta = space.sample_prior(&mut rng);
        assert!(theta[3].powi(2) + theta[4].powi(2) <= 0.5 && space.log_prior(&theta).is_finite());
        let back = space.to_physical(&space.to_sampling(&theta));
        assert!(theta.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-8), "{theta:?} {back:?}");
        let h = 1e-6;
        let column = |i: usize| {
            let shifted = |h: f64| {
                let mut t = theta.clone();
                t[i] += h;
                nalgebra::DVector::from_vec(space.to_sampling(&t))
            };
            (shifted(h) - shifted(-h)) / (2.0 * h)
        };
        let columns: Vec<_> = (0..8).map(column).collect();
        let determinant = nalgebra::DMatrix::from_columns(&columns).determinant();
        assert!((determinant.abs().ln() + space.log_jacobian(&theta)).abs() < 1e-4, "{theta:?}");
    }
    // crossing orbits are outside of the prior
    let mut crossing = space.start();
    (crossing[1], crossing[6]) = (1.0, 3.0);
    (crossing[3], crossing[4]) = (0.5f64.sqrt() - 1e-9, 0.0);
    assert!(space.log_prior(&crossing).is_finite());
    crossing[6] = 1.5;
    assert_eq!(space.log_prior(&crossing), f64::NEG_INFINITY);
}

/// An ephemeris in days is the same orbit with the same density, apart from units.
#[test]
fn an_ephemeris_gives_the_posterior_of_what_it_stands_for() {
    use Parameter::{Conjunction, K, Period, Phi, PorbOverProt};
    let values = ParameterValues::of_eight([0.1, 1.7, 0.5, 2.0, 0.0, 38.0, 40.0, 0.0]);
    let of = |free: Vec<(Parameter, Prior)>| {
        let free = free.into_iter().map(|(parameter, prior)| FreeParameter { parameter, prior }).collect();
        ParameterSpace::new(free, values, 1.47, 2.94, 3.0).of_star(100.0, None)
    };
    let k = (K, Prior::Uniform { min: 0.0, max: 0.3 });
    let ratio = Prior::Normal { mean: 1.7, sd: 0.01, min: 0.0, max: 4.0 };
    let internal = of(vec![k, (PorbOverProt, ratio), (Phi, Prior::Periodic)]);
    let days = Prior::Normal { mean: 5.1, sd: 0.03, min: 0.0, max: 12.0 };
    let named = of(vec![k, (Period, days), (Phi, Prior::Periodic)]);
    for period in [1.69, 1.7, 1.72] {
        let (a, b) = ([0.1, period, 0.4], [0.1, 3.0 * period, 0.4]);
        let (one, other) = (named.values_at(&b), internal.values_at(&a));
        assert!((one[PorbOverProt] - other[PorbOverProt]).abs() < 1e-15 && one[Phi] == other[Phi]);
        assert!((named.log_prior(&b) - internal.log_prior(&a) + 3f64.ln()).abs() < 1e-9);
        assert!((named.log_jacobian(&b) - internal.log_jacobian(&a)).abs() < 1e-12);
        let (x, y) = (named.to_sampling(&b), internal.to_sampling(&a));
        assert!((x[0] - y[0]).abs() < 1e-14 && (x[2] - y[2]).abs() < 1e-14);
    }
    // a conjunction anywhere in one orbit is a uniform phase
    let phase = of(vec![k, (Phi, Prior::Periodic)]);
    let conjunction = of(vec![k, (Conjunction, Prior::Uniform { min: 150.0, max: 155.1 })]);
    let density = |space: &ParameterSpace, theta: &[f64]| space.log_prior(theta);
    for phi in [0.0, 0.2, 0.77] {
        let mut values = values;
        values.set(Phi, phi);
        let theta = conjunction.theta_of(&values);
        assert!((150.0..=155.1).contains(&theta[1]), "{theta:?}");
        let back = conjunction.values_at(&theta)[Phi];
        assert!(((back - phi + 0.5).rem_euclid(1.0) - 0.5).abs() < 1e-12);
        let difference = density(&phase, &[0.1, phi]) - density(&conjunction, &theta);
        assert!((difference - 5.1f64.ln()).abs() < 1e-9);
    }
}
