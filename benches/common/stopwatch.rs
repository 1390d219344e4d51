//! Timing of candidates that are compared: in turn within one run, so that other load of the machine slows all of them
//! alike.

use std::hint::black_box;
use std::time::Instant;

/// A candidate for timing.
pub struct Candidate<'a> {
    pub name: &'static str,
    pub run: Box<dyn FnMut() + 'a>,
}

impl<'a> Candidate<'a> {
    pub fn new<R>(name: &'static str, mut run: impl FnMut() -> R + 'a) -> Self {
        Candidate { name, run: Box::new(move || drop(black_box(run()))) }
    }
}

/// Seconds taken by `f`.
pub fn seconds<R>(f: impl FnOnce() -> R) -> f64 {
    let began = Instant::now();
    black_box(f());
    began.elapsed().as_secs_f64()
}

/// Seconds of a run of every candidate, `[candidate][round]`. In a round each runs once untimed and then `runs` times:
/// the caches then hold what they hold in a sequence of passes.
pub fn in_turn(candidates: &mut [Candidate], rounds: usize, runs: usize) -> Vec<Vec<f64>> {
    let mut times = vec![Vec::with_capacity(rounds); candidates.len()];
    for _ in 0..rounds {
        for (candidate, times) in candidates.iter_mut().zip(&mut times) {
            (candidate.run)();
            times.push(seconds(|| (0..runs).for_each(|_| (candidate.run)())) / runs as f64);
        }
    }
    times
}

/// The value below which a fraction `p` of the values lies.
pub fn quantile(values: &[f64], p: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let position = p * (sorted.len() - 1) as f64;
    let (below, share) = (position.floor() as usize, position.fract());
    sorted[below] + share * (sorted[position.ceil() as usize] - sorted[below])
}

/// The time in the least disturbed round on a shared machine.
pub fn fastest(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Slope of ln(cost) against ln(size), by least squares.
pub fn exponent(sizes: &[f64], costs: &[f64]) -> f64 {
    let mean = |x: &[f64]| x.iter().map(|x| x.ln()).sum::<f64>() / x.len() as f64;
    let (mean_size, mean_cost) = (mean(sizes), mean(costs));
    let (mut product, mut square) = (0.0, 0.0);
    for (size, cost) in sizes.iter().zip(costs) {
        let x = size.ln() - mean_size;
        product += x * (cost.ln() - mean_cost);
        square += x * x;
    }
    product / square
}
