//! The response against the plain loop that the benches compare it with.

#[path = "../common/plain_loop.rs"]
mod plain_loop;

use crate::common::{oracle, values};
use dimcmc::internals::star::{Quadrature, Response, SurfaceGrid};
use plain_loop::PlainLoop;

fn noise(n: usize, a: f64) -> Vec<f64> {
    (0..n).map(|i| (a * (i * i) as f64).sin()).collect()
}

/// Largest difference over the largest value.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    let largest = |x: &mut dyn Iterator<Item = f64>| x.fold(0.0, |m: f64, x| m.max(x.abs()));
    largest(&mut a.iter().zip(b).map(|(a, b)| a - b)) / largest(&mut b.iter().copied())
}

/// Of lines, continua and transposes, on the oracle's star with planet and shear.
fn differences<const WINDOW: usize>() -> [f64; 3] {
    let oracle = oracle();
    let mut state = values(&oracle.json["results"]["fixed_lambda"][6]["theta"], 3.0).state();
    state.rotation.domega_rad_d = 0.05;
    state.vsys_kms = 0.3;
    let grid = SurfaceGrid::equal_area(1500, Quadrature::Centre);
    let response = Response::new(&grid, &oracle.star, &state, &oracle.sampling);
    let plain = PlainLoop::<WINDOW>::new(&grid, &oracle.star, &state, &oracle.sampling);
    assert_eq!(response.pairs(), plain.pairs());

    let x: Vec<f64> = noise(grid.len(), 0.7).iter().map(|r| 1.0 + 0.5 * r).collect();
    let profiles = || (vec![f64::NAN; response.data_len()], vec![f64::NAN; response.profiles()]);
    let ((mut line, mut continuum), (mut plain_line, mut plain_continuum)) = (profiles(), profiles());
    response.apply(&x, &mut line, &mut continuum);
    plain.apply(&x, &mut plain_line, &mut plain_continuum);

    let (y, z) = (noise(response.data_len(), 1.3), noise(response.profiles(), 2.1));
    let (mut back, mut plain_back) = (vec![f64::NAN; grid.len()], vec![f64::NAN; grid.len()]);
    response.apply_transpose(&y, &z, &mut back);
    plain.apply_transpose(&y, &z, &mut plain_back);

    [difference(&line, &plain_line), difference(&continuum, &plain_continuum), difference(&back, &plain_back)]
}

#[test]
fn the_response_is_that_of_the_plain_loop() {
    let differences = differences::<24>();
    println!("line, continuum, transpose: {differences:?}");
    // aliasing of the deposit, and weights in single precision
    assert!(differences.iter().all(|d| *d < 1e-6), "{differences:?}");
}

#[test]
fn the_window_of_the_benches_holds_the_line() {
    let differences = differences::<16>();
    println!("line, continuum, transpose: {differences:?}");
    // what is left out lies beyond 4.5 standard deviations, where the line has 3e-5 of its depth
    assert!(differences.iter().all(|d| *d < 3e-5), "{differences:?}");
}
