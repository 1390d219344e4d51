//! Truths about the maximum-entropy image: derivatives of the misfit, the solver's optimality conditions, and that the
//! answer does not depend on the way to it.

use crate::common::{self, Oracle, dot, hold_derivatives, oracle, values, wave};
use dimcmc::internals::maxent::{
    Curvature, Goal, Image, Preconditioner, Problem, Solution, Solver, SolverSettings, Start, Termination,
};
use dimcmc::internals::model::Parameter;
use dimcmc::internals::star::observation::{Observations, Profile};
use dimcmc::internals::star::{Quadrature, SurfaceGrid};
use dimcmc::internals::surface::imaging::{Data, Imager, ImagingProblem};
use dimcmc::internals::surface::static_map::Reference;
use std::sync::OnceLock;

fn imager(oracle: &Oracle) -> Imager {
    common::imager(oracle, SurfaceGrid::equal_area(800, Quadrature::Gauss2x2))
}

/// The map at the injected values, which takes longest: made once.
fn reference(oracle: &Oracle, imager: &Imager) -> &'static Reference {
    static MADE: OnceLock<Reference> = OnceLock::new();
    let truth = values(&oracle.json["results"]["fixed_lambda"][0]["theta"], 3.0);
    MADE.get_or_init(|| Reference::build(imager, truth, 0.97).unwrap())
}

fn problem<'a>(oracle: &Oracle, imager: &'a Imager) -> ImagingProblem<'a> {
    let truth = values(&oracle.json["results"]["fixed_lambda"][0]["theta"], 3.0);
    imager.problem(imager.response(&truth.state()))
}

#[test]
fn chi2_is_the_sum_of_squared_residuals_over_their_errors() {
    let profile = |time_d, intensity: [f64; 2], sigma: [f64; 2]| Profile {
        time_d,
        first_velocity_kms: -1.0,
        step_kms: 2.0,
        intensity: intensity.to_vec(),
        sigma: sigma.to_vec(),
        exposure_s: None,
    };
    let profiles = vec![profile(0.0, [0.9, 1.0], [0.1, 0.2]), profile(1.0, [0.8, 0.7], [0.5, 0.05])];
    let data = Data::of(&Observations { profiles });
    let close = |a: &[f64], b: [f64; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9 * b.abs().max(1.0));
    assert!(close(&data.depth, [0.1, 0.0, 0.2, 0.3]), "{:?}", data.depth);
    assert!(close(&data.inverse_variance, [100.0, 25.0, 4.0, 400.0]), "{:?}", data.inverse_variance);
    let oracle = oracle();
    let imager = imager(&oracle);
    let mut problem = problem(&oracle, &imager);
    let chi2 = problem.linearise(&vec![0.1; imager.grid.len()]);
    let residuals = problem.model().iter().zip(&oracle.data.depth).map(|(model, depth)| (model - depth) / 1e-3);
    assert!((chi2 / residuals.map(|r| r * r).sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn gradient_and_curvature_of_the_misfit_are_its_derivatives() {
    let oracle = oracle();
    let imager = imager(&oracle);
    hold_derivatives(&mut problem(&oracle, &imager), imager.grid.len());
}

#[test]
fn single_precision_is_good_to_six_digits() {
    let oracle = oracle();
    let imager = imager(&oracle);
    let mut problem = problem(&oracle, &imager);
    let n = imager.grid.len();
    problem.linearise(&wave(n, 0.37).iter().map(|x| 0.3 + 0.2 * x).collect::<Vec<f64>>());
    for which in [Curvature::Exact, Curvature::GaussNewton] {
        let v = wave(n, 0.9);
        let rounded: Vec<f32> = v.iter().map(|x| *x as f32).collect();
        let (mut double, mut single) = (vec![0.0; n], vec![f32::NAN; n]);
        problem.curvature(which, &v, &mut double);
        problem.curvature(which, &rounded, &mut single);
        let largest = double.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        let furthest = double.iter().zip(&single).map(|(a, b)| (a - f64::from(*b)).abs()).fold(0.0, f64::max);
        // some ten roundings of 6e-8 each
        assert!(furthest <= 1e-6 * largest, "{which:?}: {furthest:e} of {largest:e}");
        problem.curvature(which, &vec![f32::NAN; n], &mut single);
        assert!(single.iter().any(|x| x.is_nan()));
    }
}

#[test]
fn loose_systems_are_solved_however_small_or_large_their_right_hand_side_is() {
    let oracle = oracle();
    let imager = imager(&oracle);
    let mut problem = problem(&oracle, &imager);
    let n = imager.grid.len();
    let image = Image { coordinates: wave(n, 0.37), lambda: 1e-4 };
    problem.linearise(&imager.entropy.image(&image.coordinates));
    let none = Preconditioner::identity();
    let loose = SolverSettings { cg_tolerance: 0.01, ..SolverSettings::patient() };
    let [loose, exact] = [loose, SolverSettings::exact()].map(|settings| Solver {
        entropy: imager.entropy,
        preconditioner: &none,
        settings,
    });
    let right = wave(n, 0.9);
    let wanted = exact.apply_inverse(&mut problem, &image, &right);
    for size in [1e-100, 1.0, 1e60] {
        let right: Vec<f64> = right.iter().map(|x| size * x).collect();
        let found = loose.apply_inverse(&mut problem, &image, &right);
        let off: Vec<f64> = found.iter().zip(&wanted).map(|(a, b)| a / size - b).collect();
        let part = (dot(&off, &off) / dot(&wanted, &wanted)).sqrt();
        assert!(part < 0.05, "{size:e}: {part}");
    }
    for (right, is_expected) in [(0.0, (|x| x == 0.0) as fn(f64) -> bool), (f64::NAN, f64::is_nan)] {
        let found = loose.apply_inverse(&mut problem, &image, &vec![right; n]);
        assert!(found.iter().all(|x| is_expected(*x)), "{right}");
    }
}

#[test]
fn the_solution_meets_its_optimality_conditions() {
    let oracle = oracle();
    let imager = imager(&oracle);
    let mut problem = problem(&oracle, &imager);
    let none = Preconditioner::identity();
    let solver = Solver { entropy: imager.entropy, preconditioner: &none, settings: SolverSettings::exact() };
    let target = 0.97 * imager.data.depth.len() as f64;
    let blank = Start::blank(&imager.entropy, imager.grid.len(), 1e-6);
    let solution = solver.solve(&mut problem, Goal::Chi2 { target, largest_lambda: 1.0 }, blank);
    assert_eq!(solution.termination, Termination::Converged);
    assert!((solution.chi2 - target).abs() < 1e-5);
    let s = imager.entropy.image(&solution.image.coordinates);
    let mut misfit = vec![0.0; s.len()];
    problem.linearise(&s);
    problem.gradient(&mut misfit);
    let order = imager.entropy.gradient(&solution.image.coordinates, &imager.grid.area);
    // the gradient of -S + (lambda/2) chi2 vanishes, in the entropy's metric, against either of its terms
    let norm = |g: &[f64]| g.iter().zip(&s).map(|(g, s)| g * g * s * (1.0 - s)).sum::<f64>().sqrt();
    let sum: Vec<f64> = order.iter().zip(&misfit).map(|(a, b)| a + solution.image.lambda * b).collect();
    assert!(norm(&sum) < 1e-6 * norm(&order), "{:e} of {:e}", norm(&sum), norm(&order));
    let area: f64 = s.iter().zip(&imager.grid.area).map(|(s, a)| s * a).sum();
    assert!((area / solution.spottedness - 1.0).abs() < 1e-12);
}

fn same(a: &Solution, b: &Solution, tolerance: f64) {
    assert!((a.spottedness / b.spottedness - 1.0).abs() < tolerance, "{} {}", a.spottedness, b.spottedness);
    assert!((a.image.lambda / b.image.lambda - 1.0).abs() < 100.0 * tolerance);
}

#[test]
fn the_answer_does_not_depend_on_start_and_preconditioner() {
    let oracle = oracle();
    let imager = imager(&oracle);
    let truth = values(&oracle.json["results"]["fixed_lambda"][0]["theta"], 3.0);
    let mut elsewhere = truth;
    elsewhere.set(Parameter::K, 0.13);
    elsewhere.set(Parameter::Inclination, 38.5);
    let here = reference(&oracle, &imager);
    let there = Reference::build(&imager, elsewhere, 0.97).unwrap();
    let mut problem = problem(&oracle, &imager);
    let settings = SolverSettings::exact();
    let solver = Solver { entropy: imager.entropy, preconditioner: &there.preconditioner, settings };
    let goal = Goal::Chi2 { target: here.chi2_target, largest_lambda: 1.0 };
    same(&solver.solve(&mut problem, goal, there.start()), &here.solution, 1e-6);
}

/// A pixel of next to nothing that should have something: its gradient, in a metric that has shrunk with it, is next to
/// nothing, too.
#[test]
fn a_pixel_in_the_dark_is_not_taken_for_solved() {
    let oracle = oracle();
    let imager = imager(&oracle);
    let reference = reference(&oracle, &imager);
    let mut start = reference.start();
    let pixel = start.image.coordinates.iter().position(|u| (-9.5..-8.5).contains(u)).expect("a faint pixel");
    start.image.coordinates[pixel] = -29.0;
    let mut problem = problem(&oracle, &imager);
    let settings = SolverSettings { tolerance: 1e-7, ..SolverSettings::default() };
    let solver = Solver { entropy: imager.entropy, preconditioner: &reference.preconditioner, settings };
    let goal = Goal::Chi2 { target: reference.chi2_target, largest_lambda: 1.0 };
    let solution = solver.solve(&mut problem, goal, start);
    assert_eq!(solution.termination, Termination::Converged);
    let worth = 0.5 * solution.chi2_slope / solution.spottedness_slope;
    let error = (solution.spottedness - reference.solution.spottedness) * worth;
    // spottedness goes with the root of the merit; in the dark, the pixel makes 8e-4
    assert!(error.abs() < 3e-4, "{error:e} after {} steps", solution.newton_steps);
}

#[test]
fn a_target_out_of_reach_is_said_so_with_the_floor() {
    let oracle = oracle();
    let imager = imager(&oracle);
    let truth = values(&oracle.json["results"]["fixed_lambda"][0]["theta"], 3.0);
    let error = Reference::build(&imager, truth, 0.5).unwrap_err().to_string();
    assert!(error.contains("below the reachable floor"), "{error}");
    let error = Reference::build(&imager, truth, 1e6).unwrap_err().to_string();
    assert!(error.contains("without spots already fits"), "{error}");
}
