//! Truths about the objectives: gradients, agreement near the optimum, precision, and a monotone fall far from it.

use crate::common::{imager, oracle, values, whole_truth};
use dimcmc::internals::maxent::entropy::Entropy;
use dimcmc::internals::maxent::{Image, SolverSettings};
use dimcmc::internals::model::{FreeParameter, Parameter, ParameterSpace, Prior};
use dimcmc::internals::sampling::log_density::{Gradient, LogDensity, Status};
use dimcmc::internals::star::{Orbit, Quadrature, SurfaceGrid};
use dimcmc::internals::surface::ObjectiveKind;
use dimcmc::internals::surface::imaging::Imager;
use dimcmc::internals::surface::static_map::{Posterior, Reference};
use std::sync::OnceLock;

const KINDS: [ObjectiveKind; 3] =
    [ObjectiveKind::Spottedness, ObjectiveKind::Entropy, ObjectiveKind::RegularisedLikelihood];

type Setup = (Imager, ParameterSpace, Reference);

/// All eight parameters free, with the reference near the optimum of the oracle's data; maps of spots, or of spots and
/// what is bright. The reference takes seconds: made once.
fn setup(entropy: Option<Entropy>) -> Setup {
    static MADE: [OnceLock<Setup>; 2] = [const { OnceLock::new() }; 2];
    MADE[usize::from(entropy.is_some())].get_or_init(|| made(entropy)).clone()
}

fn made(entropy: Option<Entropy>) -> Setup {
    let oracle = oracle();
    let grid = SurfaceGrid::equal_area(1200, Quadrature::Gauss2x2);
    let entropy = entropy.unwrap_or(Entropy::new(oracle.default_spot));
    let imager = Imager { entropy, ..imager(&oracle, grid) };
    let mut values = values(&oracle.json["results"]["fixed_lambda"][0]["theta"], 3.0);
    values.first.orbit = Orbit { k_kms: 0.088, porb_over_prot: 1.763, phi: 0.486 };
    let uniform = |parameter, min, max| FreeParameter { parameter, prior: Prior::Uniform { min, max } };
    let free = vec![
        uniform(Parameter::K, 0.0, 2.0),
        uniform(Parameter::PorbOverProt, 0.5, 4.0),
        FreeParameter { parameter: Parameter::Phi, prior: Prior::Periodic },
        uniform(Parameter::OmegaEq, 1.5, 2.5),
        uniform(Parameter::DOmega, -0.5, 0.5),
        uniform(Parameter::Inclination, 10.0, 80.0),
        uniform(Parameter::Vsini, 30.0, 50.0),
        uniform(Parameter::Vsys, -2.0, 2.0),
    ];
    let space = ParameterSpace::new(free, values, imager.mid_cycle(), imager.time_base_cycles(), 3.0);
    let reference = Reference::build(&imager, values, 0.97).unwrap();
    (imager, space, reference)
}

fn posteriors(entropy: Option<Entropy>) -> Vec<Posterior> {
    let (imager, space, reference) = setup(entropy);
    KINDS.map(|kind| Posterior::new(imager.clone(), space.clone(), kind, reference.clone())).to_vec()
}

/// The same with orbit and systemic velocity free alone.
fn of_orbits(entropy: Option<Entropy>) -> Vec<Posterior> {
    let (imager, space, reference) = setup(entropy);
    let free: Vec<FreeParameter> = space.free().iter().filter(|f| f.parameter.only_shifts()).cloned().collect();
    let space = ParameterSpace::new(free, reference.values, imager.mid_cycle(), imager.time_base_cycles(), 3.0);
    KINDS.map(|kind| Posterior::new(imager.clone(), space.clone(), kind, reference.clone())).to_vec()
}

/// The content of maps.
const MAPS: [Option<Entropy>; 2] = [None, Some(Entropy::BrightAndDark)];

/// The start of a space with all parameters off by about one standard deviation each, in varying directions.
fn nearby(space: &ParameterSpace, i: usize) -> Vec<f64> {
    let sigma = [0.01, 0.06, 0.035, 0.0005, 0.0014, 0.3, 0.015, 0.008];
    assert!(space.dimension() <= sigma.len());
    let offset = |j: usize| 0.7 * sigma[j] * ((7 * j + 13 * i) as f64).sin();
    space.start().iter().enumerate().map(|(j, x)| x + offset(j)).collect()
}

#[test]
fn gradients_match_differences_of_reconstructions() {
    for posterior in MAPS.into_iter().flat_map(posteriors) {
        let exact = posterior.with_settings(SolverSettings::exact());
        let theta = nearby(exact.space(), 1);
        let (_, gradient) = exact.evaluate_with_gradient(&theta);
        let x = exact.to_sampling(&theta);
        for (j, scale) in exact.scales().iter().enumerate() {
            let h = 0.05 * scale;
            let at = |h: f64| {
                let mut y = x.clone();
                y[j] += h;
                exact.evaluate(&exact.to_physical(&y)).log_prob
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            let size = difference.abs() + 0.3 / scale;
            // numerical derivatives: h^2 terms, and pixels that appear at the limb
            assert!((gradient[j] - difference).abs() < 0.01 * size, "{j}: {} {difference}", gradient[j]);
        }
    }
}

/// The same for the parameters of the star's surface.
#[test]
fn gradients_along_the_surface_match_differences_of_reconstructions() {
    let (imager, ..) = setup(None);
    let values = whole_truth(&oracle());
    let reference = Reference::build(&imager, values, 0.97).unwrap();
    let uniform = |parameter, min, max| FreeParameter { parameter, prior: Prior::Uniform { min, max } };
    let free = vec![
        uniform(Parameter::LimbDarkening, 0.0, 1.0),
        uniform(Parameter::LineSigma, 1.0, 9.0),
        uniform(Parameter::EquivalentWidth, 1.0, 9.0),
        uniform(Parameter::Contrast, 0.0, 1.0),
    ];
    let space = ParameterSpace::new(free, values, imager.mid_cycle(), imager.time_base_cycles(), 3.0);
    for kind in KINDS {
        let exact = Posterior::new(imager.clone(), space.clone(), kind, reference.clone());
        let exact = exact.with_settings(SolverSettings::exact());
        let sigma = [0.003, 0.01, 0.002, 0.01];
        let theta: Vec<f64> = space.start().iter().zip(sigma).map(|(x, sigma)| x + 0.7 * sigma).collect();
        let (_, gradient) = exact.evaluate_with_gradient(&theta);
        for (j, scale) in exact.scales().iter().enumerate() {
            let h = 0.05 * scale;
            let at = |h: f64| {
                let mut y = theta.clone();
                y[j] += h;
                exact.evaluate(&y).log_prob
            };
            let difference = (at(h) - at(-h)) / (2.0 * h);
            let size = difference.abs() + 0.3 / scale;
            println!("{kind:?} {j}: {} {difference}", gradient[j]);
            assert!((gradient[j] - difference).abs() < 0.01 * size, "{kind:?} {j}: {} {difference}", gradient[j]);
        }
    }
}

#[test]
fn objectives_agree_near_the_optimum_and_are_precise() {
    MAPS.into_iter().for_each(|map| agree_and_are_precise(&posteriors(map)));
}

fn agree_and_are_precise(posteriors: &[Posterior]) {
    let start = posteriors[0].space().start();
    let at_start: Vec<f64> = posteriors.iter().map(|p| p.evaluate(&start).log_prob).collect();
    for i in 0..4 {
        // orbit and systemic velocity alone, where the method's table has the three agree to a few per cent
        let mut theta = nearby(posteriors[0].space(), i);
        theta[3..7].copy_from_slice(&start[3..7]);
        let drops: Vec<f64> =
            posteriors.iter().zip(&at_start).map(|(p, p0)| p.evaluate(&theta).log_prob - p0).collect();
        for (posterior, (drop, p0)) in posteriors.iter().zip(drops.iter().zip(&at_start)) {
            assert!((drop - drops[2]).abs() < 0.05 + 0.05 * drops[2].abs(), "{drops:?}");
            let exact = posterior.clone().with_settings(SolverSettings::exact()).evaluate(&theta).log_prob - p0;
            assert!((exact - drop).abs() < 1e-3, "{exact} {drop}");
        }
    }
}

/// A map and its ln(lambda).
type Map = (Vec<f64>, f64);

fn map_of(posterior: &Posterior, image: &Image) -> Map {
    (posterior.imager().entropy.image(&image.coordinates), image.lambda.ln())
}

/// The map at `theta` to rounding error.
fn exact(posterior: &Posterior, theta: &[f64]) -> Map {
    let exact = posterior.clone().with_settings(SolverSettings::exact());
    map_of(posterior, &exact.reconstruct(theta).0.image)
}

/// Errors of predictions at `theta`, where the map is `exact`: of the map, in its metric at the start, and of
/// ln(lambda). A solver that accepts any start returns the prediction unchanged.
fn prediction_errors(posterior: &Posterior, theta: &[f64], (b, lambda_b): &Map) -> [f64; 2] {
    let careless = SolverSettings { tolerance: f64::INFINITY, ..SolverSettings::default() };
    let predicted = posterior.clone().with_settings(careless);
    let imager = posterior.imager();
    let start = map_of(posterior, &posterior.reference().solution.image);
    let scale = imager.entropy.metric(&start.0, &imager.grid.area);
    let (a, lambda_a) = map_of(posterior, &predicted.reconstruct(theta).0.image);
    let image = (0..a.len()).map(|p| ((a[p] - b[p]) / f64::from(scale[p])).powi(2)).sum::<f64>().sqrt();
    [image, (lambda_a - lambda_b).abs()]
}

/// Their errors are of second order, in image and lambda.
#[test]
fn predictions_are_right_to_first_order() {
    for entropy in MAPS {
        let posterior = posteriors(entropy).swap_remove(0);
        // K and systemic velocity by 0.4 standard errors, in which no pixels come into sight
        for (j, step) in [(0, 0.004), (7, 0.003)] {
            let errors = [1.0, 2.0].map(|steps| {
                let mut theta = posterior.space().start();
                theta[j] += steps * step;
                prediction_errors(&posterior, &theta, &exact(&posterior, &theta))
            });
            println!("{j}: {errors:?}");
            // twice the step, four times the error: an error of first order would double, those of third order are
            // smaller
            assert!((0..2).all(|i| (errors[1][i] / errors[0][i] - 4.0).abs() < 0.6), "{j}: {errors:?}");
        }
    }
}

/// Where the first order leaves errors of second order, the second leaves much less.
#[test]
fn predictions_of_orbits_alone_are_right_to_second_order() {
    for entropy in MAPS {
        // at a fixed lambda, the third of them, the first order is good enough
        for (first, second) in posteriors(entropy).iter().zip(of_orbits(entropy)).take(2) {
            // about a standard error, one by one and together
            for offset in [[0.01, 0.0, 0.0, 0.0], [0.0, 0.06, 0.0, 0.0], [-0.007, -0.04, 0.02, 0.005]] {
                let at = |posterior: &Posterior| {
                    let mut theta = posterior.space().start();
                    let last = theta.len() - 1;
                    [0, 1, 2, last].into_iter().zip(offset).for_each(|(j, offset)| theta[j] += offset);
                    theta
                };
                // one map, whichever parameters are free
                let exact = exact(&second, &at(&second));
                let errors = [first, &second].map(|posterior| prediction_errors(posterior, &at(posterior), &exact));
                println!("{:?} {offset:?}: {errors:?}", first.kind());
                assert!((0..2).all(|i| errors[1][i] < 0.1 * errors[0][i]), "{offset:?}: {errors:?}");
            }
        }
    }
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn log_probability_falls_monotonically_far_beyond_the_reach_of_the_target() {
    let walks = [
        (Parameter::K, vec![0.0, 0.1, 0.3, 0.8, 1.8]),
        (Parameter::Vsys, vec![0.0, 0.05, 0.2, 0.6, 1.5]),
        (Parameter::Vsini, vec![0.0, 0.3, 1.0, 3.0, 8.0]),
        (Parameter::Vsini, vec![0.0, -0.3, -1.0, -3.0, -8.0]),
        (Parameter::Inclination, vec![0.0, 5.0, 15.0, 40.0]),
        (Parameter::OmegaEq, vec![0.0, 0.01, 0.05, 0.3]),
    ];
    for posterior in MAPS.into_iter().flat_map(posteriors) {
        for (parameter, offsets) in &walks {
            let at = |offset: &f64| {
                let mut theta = posterior.space().start();
                let place = posterior.space().free().iter().position(|f| f.parameter == *parameter).unwrap();
                theta[place] += offset;
                posterior.evaluate(&theta)
            };
            let values: Vec<f64> = offsets.iter().map(|offset| at(offset).log_prob).collect();
            println!("{parameter:?} {offsets:?}: {values:.1?}");
            assert!(values.iter().all(|v| v.is_finite()), "{parameter:?}: {values:?}");
            assert!(values.windows(2).all(|w| w[1] < w[0]), "{parameter:?}: {values:?}");
        }
    }
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn evaluations_are_as_precise_as_they_say() {
    for posterior in MAPS.into_iter().flat_map(|map| [posteriors(map), of_orbits(map)].concat()) {
        let exact = posterior.clone().with_settings(SolverSettings::exact());
        let start = posterior.space().start();
        // around the reference, errors of 1e-3 at most; far below it, half a per cent of the distance
        let near = (0..12).map(|i| (nearby(posterior.space(), 3 * i + 2), 1e-3));
        let far = [0.02, 0.04, 0.1].map(|k| {
            let mut theta = start.clone();
            theta[0] += k;
            (theta, 0.0)
        });
        for (theta, absolute) in near.chain(far) {
            let (got, wanted) = (posterior.evaluate(&theta).log_prob, exact.evaluate(&theta).log_prob);
            let below = exact.evaluate(&start).log_prob - wanted;
            let allowed = if absolute > 0.0 { absolute } else { 1e-3 + 0.005 * below };
            assert!((got - wanted).abs() < allowed, "{theta:?}: {got} instead of {wanted}");
        }
    }
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn warm_starts_save_passes_and_change_nothing_else() {
    for posterior in MAPS.into_iter().flat_map(posteriors) {
        let start = posterior.space().start();
        let other = |k: f64, phi: f64| {
            let mut theta = start.clone();
            (theta[0], theta[2]) = (k, phi);
            theta
        };
        // two places in half a turn of the orbit, and one that is none
        let thetas: Vec<Vec<f64>> = (0..8).map(|i| other(0.09, 0.3 + 0.01 * f64::from(i))).collect();
        let absurd = other(f64::INFINITY, 0.3);
        let placed = posterior.clone().with_warm_starts(&[thetas[2].clone(), absurd, thetas[6].clone()]);
        assert_eq!(placed.warm_starts().collect::<Vec<_>>(), [&thetas[2], &thetas[6]]);
        let best = posterior.evaluate(&start).log_prob;
        assert_eq!(placed.evaluate(&start), posterior.evaluate(&start), "the reference is the nearest there");
        let exact = posterior.clone().with_settings(SolverSettings::exact());
        let (mut with, mut without) = (0, 0);
        for theta in &thetas {
            let (got, wanted) = (placed.evaluate(theta), exact.evaluate(theta).log_prob);
            assert!((got.log_prob - wanted).abs() < 1e-3 + 0.005 * (best - wanted), "{theta:?}: {got:?} {wanted}");
            with += got.model_applications;
            without += posterior.evaluate(theta).model_applications;
        }
        println!("{:?}: {with} model applications instead of {without}", posterior.kind());
        assert!(3 * with < 2 * without, "{:?}: {with} model applications instead of {without}", posterior.kind());
        // as many as their significance requires, and none where nothing is far
        assert_eq!(
            posterior.clone().with_warm_starts_for(std::slice::from_ref(&start), 10_000).warm_starts().count(),
            0
        );
        let few = posterior.clone().with_warm_starts_for(&thetas, 1).warm_starts().count();
        let many = posterior.with_warm_starts_for(&thetas, 100_000).warm_starts().count();
        assert!(few == 0 && many > 0, "{few} {many}");
    }
}

#[test]
fn a_warm_start_out_of_the_targets_reach_is_right_for_those_within() {
    for posterior in MAPS.map(|entropy| posteriors(entropy).swap_remove(0)) {
        assert_eq!(posterior.kind(), ObjectiveKind::Spottedness);
        let exact = posterior.clone().with_settings(SolverSettings::exact());
        let start = posterior.space().start();
        let at = |i: i32| {
            let mut theta = start.clone();
            theta[0] += 0.004 * f64::from(i);
            theta
        };
        let is_beyond = |i: &i32| posterior.evaluate(&at(*i)).status == Status::Unreachable;
        let roughly = (1..25).map(|i| 4 * i).find(is_beyond).unwrap();
        let beyond = (roughly - 3..=roughly).find(is_beyond).unwrap();
        let placed = posterior.with_warm_starts(&[at(beyond)]);
        assert_eq!(placed.warm_starts().count(), 1);
        let best = exact.evaluate(&start).log_prob;
        for theta in (1..4).map(|i| at(beyond - i)) {
            let (got, wanted) = (placed.evaluate(&theta), exact.evaluate(&theta).log_prob);
            println!(
                "{} below: {:e}, {} model applications",
                best - wanted,
                got.log_prob - wanted,
                got.model_applications
            );
            assert_eq!(got.status, Status::Converged);
            assert!((got.log_prob - wanted).abs() < 1e-3 + 0.005 * (best - wanted), "{theta:?}: {got:?} {wanted}");
        }
    }
}

#[test]
fn lambda_stays_within_its_bound() {
    let (imager, space, mut reference) = setup(None);
    // so tight that the way to almost every solution would lead beyond it
    reference.largest_lambda = 1.02 * reference.solution.image.lambda;
    let largest = reference.largest_lambda;
    let posterior = Posterior::new(imager, space, ObjectiveKind::Spottedness, reference);
    let exact = posterior.clone().with_settings(SolverSettings::exact());
    let start = posterior.space().start();
    let walk = [-0.04, -0.02, -0.01, -0.004, 0.004, 0.01, 0.02, 0.04].map(|k| {
        let mut theta = start.clone();
        theta[0] += k;
        theta
    });
    let target = posterior.reference().chi2_target;
    for theta in (0..8).map(|i| nearby(posterior.space(), i)).chain(walk) {
        let (got, wanted) = (posterior.reconstruct(&theta).0, exact.reconstruct(&theta).0);
        println!("{:?} {:.9} {} {}", got.termination, got.image.lambda / largest, got.chi2, wanted.chi2);
        assert_eq!(got.termination, wanted.termination, "{theta:?}");
        assert!(
            got.image.lambda <= largest * (1.0 + 1e-12),
            "{theta:?}: {} times the bound",
            got.image.lambda / largest
        );
        // the error allowed in chi2/2, and at the target what the first-order move to it covers
        let beyond = (wanted.chi2 - target).max(0.0);
        assert!(
            (got.chi2 - wanted.chi2).abs() < 0.05 + 0.01 * beyond,
            "{theta:?}: {} instead of {}",
            got.chi2,
            wanted.chi2
        );
    }
}

#[test]
fn absurd_parameters_are_refused_not_computed() {
    let posterior = &posteriors(None)[0];
    for (parameter, value) in [(Parameter::K, f64::NAN), (Parameter::K, -0.1), (Parameter::Vsini, 1e9)] {
        let mut theta = posterior.space().start();
        let place = posterior.space().free().iter().position(|f| f.parameter == parameter).unwrap();
        theta[place] = value;
        let evaluation = posterior.evaluate(&theta);
        assert_eq!(
            (evaluation.log_prob, evaluation.model_applications),
            (f64::NEG_INFINITY, 0),
            "{parameter:?} {value}"
        );
    }
}
