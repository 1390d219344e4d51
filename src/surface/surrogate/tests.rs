//! The surrogate compared with its expansion, for every kind of orbit.

use super::*;
use crate::model::{FreeParameter, ParameterValues, Prior};
use crate::sampling::log_density::{Evaluation, LogDensity, Status, Threads};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const MID: f64 = 2.5;
const SPAN: f64 = 5.0;

/// Twenty velocities with uncertainties of `sigma` and small correlations.
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
        // mean, variance, and effective number of draws
        let moments = |draws: &[(Vec<f64>, f64)], of: &dyn Fn(&[f64]) -> f64| {
            let total: f64 = draws.iter().map(|(_, w)| w).sum();
            let mean = draws.iter().map(|(theta, w)| w * of(theta)).sum::<f64>() / total;
            let variance = draws.iter().map(|(theta, w)| w * (of(theta) - mean).powi(2)).sum::<f64>() / total;
            (mean, variance, total * total / draws.iter().map(|(_, w)| w * w).sum::<f64>())
        };
        let check = |of: &dyn Fn(&[f64]) -> f64, what: &str| {
            let ((a, ..), (b, variance, size)) = (moments(&draws, of), moments(&wanted, of));
            // draws of a walk have at least half the weight of independent ones
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

/// A density whose velocities are the better constrained the longer the spots live, as those of stars are; its
/// expansion at one lifetime does not include that.
struct Living {
    space: ParameterSpace,
    observed: DVector<f64>,
    plain: Expansion,
}

impl Living {
    fn new() -> Self {
        let values = space(&[K, PorbOverProt, Phi, Vsys]).values_at(&space(&[K, PorbOverProt, Phi, Vsys]).start());
        let mut values = values;
        values.field = Some(crate::model::FieldValues { amplitude: 0.2, slope: 1.0, lifetime_d: Some(20.0) });
        let kinds = [K, PorbOverProt, Phi, Vsys].map(free).into_iter();
        let of_field = [
            (Parameter::SpotAmplitude, Prior::LogUniform { min: 0.05, max: 0.8 }),
            (Parameter::SpotLifetime, Prior::LogUniform { min: 1.0, max: 400.0 }),
        ];
        let of_field = of_field.map(|(parameter, prior)| FreeParameter { parameter, prior });
        let space = ParameterSpace::new(kinds.chain(of_field).collect(), values, MID, SPAN, 3.0).of_star(1000.0, None);
        let plain = expansion(0.06, Some(&values));
        let observed = DVector::from_iterator(plain.profiles(), values.motion().velocities_kms(&plain.cycles));
        Living { space, observed, plain }
    }

    /// The expansion in the velocities at a field.
    fn at(&self, theta: &[f64]) -> Expansion {
        let values = self.space.values_at(theta);
        let [a, t] = [Parameter::SpotAmplitude, Parameter::SpotLifetime].map(|p| values[p].ln());
        let (a, t) = ((a - 0.2f64.ln()) / 0.2, (t - 20.0f64.ln()) / 0.5);
        let information = &self.plain.information * (0.8 * t - 0.3 * a).exp();
        let gradient = &information * &self.observed;
        // the same height at the best orbit, whatever the uncertainties
        let field = -0.5 * (a * a + t * t - 0.8 * a * t) - 0.1 * t.powi(3).max(-8.0) / (1.0 + t * t);
        let log_likelihood = field - 0.5 * self.observed.dot(&gradient);
        Expansion { log_likelihood, gradient, noise: information.clone(), information, ..self.plain.clone() }
    }

    /// To second order in the field as well.
    fn expanded(&self) -> Expansion {
        let here = self.at(&self.space.start());
        let n = here.profiles();
        let mut information = DMatrix::zeros(n + 2, n + 2);
        information.view_mut((0, 0), (n, n)).copy_from(&here.information);
        let (a, t) = (1.0 / 0.2, 1.0 / 0.5);
        information.view_mut((n, n), (2, 2)).copy_from(&DMatrix::from_row_slice(
            2,
            2,
            &[a * a, -0.4 * a * t, -0.4 * a * t, t * t],
        ));
        let field = [0.2f64.ln(), 20.0f64.ln()];
        Expansion {
            stellar: vec![Parameter::SpotAmplitude, Parameter::SpotLifetime],
            centre: DVector::from_iterator(n + 2, here.centre.iter().copied().chain(field)),
            gradient: DVector::from_iterator(n + 2, here.gradient.iter().copied().chain([0.0, 0.0])),
            noise: information.clone(),
            information,
            ..here
        }
    }
}

impl LogDensity for Living {
    fn names(&self) -> &[String] {
        self.space.names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        let log_prior = self.space.log_prior(theta);
        if !log_prior.is_finite() {
            return Evaluation::rejected(Status::OutsidePrior);
        }
        Evaluation::of(self.at(theta).log_likelihood_at(&self.space.values_at(theta)) + log_prior)
    }

    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        self.space.to_sampling(theta)
    }

    fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        self.space.to_physical(internal)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.space.log_jacobian(theta)
    }
}

#[test]
fn expansions_at_other_fields_make_its_proposals_good() {
    let living = Living::new();
    let model = LinearModel::new(&living.expanded(), &living.space, MID).unwrap();
    let plain = Surrogate::of(model, living.space.clone(), SPAN, 1.0).unwrap();
    let (_, of_one) = plain.clone().fitted_if_poor(&living, &Threads(&living));
    let at = |theta: &[f64]| Some(living.at(theta));
    let (refined, of_many) = plain.refined(MID, &living, &at, &Threads(&living));
    assert!(of_many > 0.9 && of_one < 0.8, "{of_one} {of_many}");
    // also at points that are not in its interpolation
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let mut off = Vec::new();
    for _ in 0..40 {
        let position = refined.draw(&mut rng).unwrap();
        let theta = living.space.to_physical(&position);
        let (given, linear) = refined.model.split(&position);
        let found = refined.model.at(&given, 1.0).unwrap().log_likelihood(&linear);
        let wanted = living.at(&theta).log_likelihood_at(&living.space.values_at(&theta));
        off.push((found - wanted).abs());
        assert_eq!(refined.model.position(&given, &linear), position);
    }
    off.sort_by(f64::total_cmp);
    assert!(off[20] < 0.05 && off[36] < 0.3, "{off:?}");
}
