//! Forward model and maximum entropy against an independent implementation.

use crate::common::{json, numbers, oracle, values};
use dimcmc::internals::maxent::entropy::Entropy;
use dimcmc::internals::maxent::{Goal, Preconditioner, Problem, Solution, Solver, SolverSettings, Start, Termination};
use dimcmc::internals::star::spots::filling_at;
use dimcmc::internals::star::{Quadrature, Response, Sampling, Spot, SurfaceGrid};
use dimcmc::internals::surface::imaging::ImagingProblem;
use serde_json::Value;

/// Relative accuracy asked for against the oracle's numbers.
const ORACLE_TOLERANCE: f64 = 1e-5;

fn compare(what: &str, got: f64, wanted: &Value) {
    let wanted = wanted.as_f64().unwrap();
    let error = (got / wanted - 1.0).abs();
    println!("{what:30} {got:18.10} {wanted:18.10} {error:9.1e}");
    assert!(error < ORACLE_TOLERANCE, "{what}: {got} instead of {wanted}");
}

#[test]
fn profiles_of_the_oracle_star_on_20000_pixels() {
    let oracle = oracle();
    let forward = json("forward.json");
    let spots: Vec<Spot> = forward["spots_deg_lon_lat_radius_filling"]
        .as_array()
        .unwrap()
        .iter()
        .map(|spot| {
            let x = numbers(spot);
            let [longitude, latitude, radius] = [x[0], x[1], x[2]].map(f64::to_radians);
            Spot { longitude, latitude, radius, filling: x[3], life: None }
        })
        .collect();
    let grid = SurfaceGrid::equal_area(20_000, Quadrature::Gauss2x2);
    let filling = grid.pixel_means(8, |l, b| filling_at(&spots, l, b));
    let brightness: Vec<f64> = filling.iter().map(|s| 1.0 - (1.0 - oracle.star.contrast) * s).collect();
    let velocity = numbers(&forward["velocity_kms"]);
    let cycles = numbers(&forward["cycles"]);
    let profiles = cycles.iter().map(|e| (e * oracle.star.rotation_period_d, velocity[0], velocity.len())).collect();
    let sampling = Sampling { step_kms: velocity[1] - velocity[0], profiles };
    let state = values(&forward["theta"], oracle.star.rotation_period_d).state();
    let depths = Response::new(&grid, &oracle.star, &state, &sampling).depths(&brightness);
    let wanted = forward["intensity"].as_array().unwrap().iter().flat_map(numbers);
    let worst = depths.iter().zip(wanted).map(|(d, i)| (1.0 - d - i).abs()).fold(0.0, f64::max);
    println!("largest difference {worst:.2e}");
    // the reference is right to 3e-5 and 20,000 pixels to 1e-4
    assert!(worst < 1e-4, "largest difference {worst:.2e}");
}

fn solve(oracle: &super::common::Oracle, theta: &Value, goal: Goal) -> Solution {
    let state = values(theta, oracle.star.rotation_period_d).state();
    let response = Response::new(&oracle.grid, &oracle.star, &state, &oracle.sampling);
    let mut problem = ImagingProblem::new(&oracle.grid.area, &oracle.data, response, oracle.star.contrast);
    let none = Preconditioner::identity();
    let solver =
        Solver { entropy: Entropy::new(oracle.default_spot), preconditioner: &none, settings: SolverSettings::exact() };
    let solution = solver.solve(&mut problem, goal, Start::blank(&solver.entropy, oracle.grid.len(), 1e-6));
    let (steps, applications) = (solution.newton_steps, problem.model_applications());
    println!("{theta}: {:?} {steps} Newton steps, {applications} model applications", solution.termination);
    assert_eq!(solution.termination, Termination::Converged);
    solution
}

#[test]
fn every_number_at_fixed_lambda() {
    let oracle = oracle();
    for case in oracle.json["results"]["fixed_lambda"].as_array().unwrap() {
        let lambda = case["lam"].as_f64().unwrap();
        let solution = solve(&oracle, &case["theta"], Goal::Lambda(lambda));
        compare("chi2", solution.chi2, &case["chi2"]);
        compare("entropy", solution.entropy, &case["entropy"]);
        compare("spottedness", solution.spottedness, &case["spottedness"]);
        compare("Q", solution.entropy / lambda - solution.chi2 / 2.0, &case["Q"]);
    }
}

#[test]
fn every_number_at_fixed_chi2() {
    let oracle = oracle();
    for case in oracle.json["results"]["fixed_chi2"].as_array().unwrap() {
        let target = case["chi2_target"].as_f64().unwrap();
        let solution = solve(&oracle, &case["theta"], Goal::Chi2 { target, largest_lambda: 1.0 });
        compare("chi2", solution.chi2, &case["chi2"]);
        compare("lambda", solution.image.lambda, &case["lam"]);
        compare("entropy", solution.entropy, &case["entropy"]);
        compare("spottedness", solution.spottedness, &case["spottedness"]);
    }
}
