//! The surrogate against the expansion that it is made of, for every kind of orbit.

use super::*;
use crate::model::{FreeParameter, ParameterValues, Prior};
use crate::sampling::log_density::LogDensity as _;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const MID: f64 = 2.5;
const SPAN: f64 = 5.0;

/// Twenty velocities with errors of `sigma` and a little of each other's.
fn expansion(sigma: f64, truth: Option<&ParameterValues>) -> Expansion {
    let cycles: Vec<f64> = (0..20).map(|k| SPAN * (f64::from(k) + 0.3 * f64::from(k % 3)) / 20.0).collect();
    let n = cycles.len();
    let information = DMatrix::from_fn(n, n, |i, j| if i == j { 1.0 } else { 0.2 / (1.0 + i.abs_diff(j) as f64) });
    let information = information / (sigma * sigma);
    let observed =
        truth.map_or(DVector::zeros(n), |truth| DVector::from_iterator(n, truth.motion().velocities_kms(&cycles)));
    Expansion {
        values: ParameterValues::of_eight([0.0, 1.7, 0.0, 2.0, 0.0, 40.0, 40.0, 0.0]),
        stellar: Vec::new(),
        log_likelihood: 0.0,
        centre: DVector::zeros(n),
        gradient: &information * observed,
        noise: information.clone(),
        information,
        cycles,
    }
}

fn free(parameter: Parameter) -> FreeParameter {
    let prior = match parameter {
        Parameter::K | Parameter::K2 => Prior::Uniform { min: 0.0, max: 0.3 },
        Parameter::PorbOverProt => Prior::Uniform { min: 1.0, max: 2.0 },
        Parameter::PorbOverProt2 => Prior::Uniform { min: 2.5, max: 4.0 },
        Parameter::Period => Prior::Normal { mean: 5.1, sd: 0.01, min: 0.0, max: f64::INFINITY },
        Parameter::Conjunction => Prior::Normal { mean: 1008.0, sd: 0.05, min: f64::NEG_INFINITY, max: f64::INFINITY },
        Parameter::Phi | Parameter::Phi2 => Prior::Periodic,
        Parameter::Vsys => Prior::Uniform { min: -1.0, max: 1.0 },
        _ => Prior::Disc { max_eccentricity: 0.6 },
    };
    FreeParameter { parameter, prior }
}

use Parameter::{
    Conjunction, K, K2, Period, Phi, Phi2, PorbOverProt, PorbOverProt2, SqrtECosOmega, SqrtESinOmega, Vsys,
};

const KINDS: [&[Parameter]; 5] = [
    &[K, PorbOverProt, Phi, Vsys],
    &[K, PorbOverProt, Phi, SqrtECosOmega, SqrtESinOmega],
    &[K, PorbOverProt, Phi, K2, PorbOverProt2, Phi2, Vsys],
    &[K, Period, Conjunction],
    &[K, Period, Conjunction, SqrtECosOmega, SqrtESinOmega, K2, PorbOverProt2, Phi2],
];

fn space(kind: &[Parameter]) -> ParameterSpace {
    let mut values = ParameterValues::of_eight([0.1, 1.7, 0.3, 2.0, 0.0, 40.0, 40.0, 0.0]);
    if kind.contains(&K2) {
        values.set(K2, 0.06);
        values.set(PorbOverProt2, 3.1);
        values.set(Phi2, 0.8);
    }
    if kind.contains(&SqrtECosOmega) {
        values.set(SqrtECosOmega, 0.3);
        values.set(SqrtESinOmega, 0.4);
    }
    ParameterSpace::new(kind.iter().copied().map(free).collect(), values, MID, SPAN, 3.0).of_star(1000.0, None)
}

fn surrogate(kind: &[Parameter], expansion: &Expansion) -> Surrogate {
    let model = LinearModel::new(expansion, &space(kind), MID).unwrap();
    Surrogate::of(model, space(kind), SPAN, 1.0).unwrap()
}

#[test]
fn its_likelihood_is_that_of_the_expansion() {
    for kind in KINDS {
        let space = space(kind);
        let expansion = expansion(0.03, Some(&space.values_at(&space.start())));
        let surrogate = surrogate(kind, &expansion);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..50 {
            let theta = space.sample_prior(&mut rng);
            let position = space.to_sampling(&theta);
            let (given, linear) = surrogate.model.split(&position);
            let found = surrogate.model.at(&given, 1.0).unwrap().log_likelihood(&linear);
            let wanted = expansion.log_likelihood_at(&space.values_at(&theta));
            assert!((found - wanted).abs() < 1e-6 * (1.0 + wanted.abs()), "{kind:?}: {found} {wanted}");
            let back = surrogate.model.position(&given, &linear);
            assert!(back.iter().zip(&position).all(|(a, b)| (a - b).abs() < 1e-9), "{kind:?}");
        }
    }
}

/// Draws are those of the prior, weighted by the likelihood: the densities of all proposals and the Jacobians are
/// right.
#[test]
fn draws_are_those_of_prior_and_likelihood() {
    for kind in KINDS {
        let space = space(kind);
        let surrogate = surrogate(kind, &expansion(0.5, None));
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        const DRAWS: usize = 200;
        const PRIOR: usize = 4000;
        let draws: Vec<(Vec<f64>, f64)> =
            (0..DRAWS).map(|_| (space.to_physical(&surrogate.draw(&mut rng).unwrap()), 1.0)).collect();
        let weighted = |theta: Vec<f64>| {
            let ln_prior = space.log_prior(&theta) + space.log_jacobian(&theta);
            let weight = (surrogate.log_density(&space.to_sampling(&theta)) - ln_prior).exp();
            (theta, weight)
        };
        let wanted: Vec<(Vec<f64>, f64)> = (0..PRIOR).map(|_| weighted(space.sample_prior(&mut rng))).collect();
        // mean, variance, and of how many draws
        let moments = |draws: &[(Vec<f64>, f64)], of: &dyn Fn(&[f64]) -> f64| {
            let total: f64 = draws.iter().map(|(_, w)| w).sum();
            let mean = draws.iter().map(|(theta, w)| w * of(theta)).sum::<f64>() / total;
            let variance = draws.iter().map(|(theta, w)| w * (of(theta) - mean).powi(2)).sum::<f64>() / total;
            (mean, variance, total * total / draws.iter().map(|(_, w)| w * w).sum::<f64>())
        };
        let check = |of: &dyn Fn(&[f64]) -> f64, what: &str| {
            let ((a, ..), (b, variance, size)) = (moments(&draws, of), moments(&wanted, of));
            // draws of a walk are worth a half of independent ones at least
            let error = (variance * (2.0 / DRAWS as f64 + 1.0 / size)).sqrt();
            assert!((a - b).abs() < 4.0 * error, "{kind:?} {what}: {a} {b} +- {error}");
        };
        for (i, f) in space.free().iter().enumerate() {
            check(&|theta| theta[i], f.parameter.name());
            check(&|theta| theta[i] * theta[i], f.parameter.name());
        }
        if let Some(i) = kind.iter().position(|p| *p == SqrtECosOmega) {
            check(&|theta| theta[i].powi(2) + theta[i + 1].powi(2), "e");
        }
    }
}

#[test]
fn peaks_lie_at_the_orbits_that_are_there() {
    for kind in &KINDS[..3] {
        let space = space(kind);
        let truth = space.values_at(&space.start());
        let expansion = expansion(0.005, Some(&truth));
        let surrogate = surrogate(kind, &expansion);
        let peak = &surrogate.peaks(10.0, 3)[0];
        let found = space.values_at(&space.to_physical(&peak.position));
        assert!((found[PorbOverProt] - 1.7).abs() < 0.1 && (found[K] - 0.1).abs() < 0.05, "{kind:?}: {found:?}");
        if kind.contains(&K2) {
            assert!((found[PorbOverProt2] - 3.1).abs() < 0.2 && (found[K2] - 0.06).abs() < 0.02, "{found:?}");
        }
        // and a climb of the expansion from there ends at the truth
        let forecast = crate::surface::evolving_map::Forecast { space: &space, expansion: &expansion };
        let end = crate::sampling::optimise::climb(&forecast, &space.to_physical(&peak.position), &|| ()).unwrap();
        let start = space.start();
        let highest = forecast.evaluate(&start).log_prob;
        assert!(end.evaluation.log_prob > highest - 0.5, "{kind:?}: {} {highest}", end.evaluation.log_prob);
    }
}
