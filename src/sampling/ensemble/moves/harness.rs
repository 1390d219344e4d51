//! One test for every move: densities of known moments and quantiles, recovered within Monte Carlo error.
//!
//! The error is measured by the scatter between independent ensembles.

use crate::sampling::ensemble::{Mix, Positions, Sampler, SamplerSettings};
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity, Status};
use std::sync::atomic::AtomicBool;

const ENSEMBLES: usize = 16;
const STEPS: usize = 3000;
const DISCARD: usize = 300;

/// A log-density given as a function.
pub(crate) struct Toy<F> {
    names: Vec<String>,
    log_prob: F,
}

impl<F: Fn(&[f64]) -> f64 + Sync> Toy<F> {
    pub(crate) fn new(dimension: usize, log_prob: F) -> Self {
        Toy { names: (0..dimension).map(|i| format!("x{i}")).collect(), log_prob }
    }
}

impl<F: Fn(&[f64]) -> f64 + Sync> LogDensity for Toy<F> {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        let log_prob = (self.log_prob)(theta);
        let status = if log_prob == f64::NEG_INFINITY { Status::OutsidePrior } else { Status::Converged };
        Evaluation { status, ..Evaluation::of(log_prob) }
    }
}

/// A function of a position.
type Function = Box<dyn Fn(&[f64]) -> f64>;

/// One evaluation after the other: for densities cheaper than the overhead of a thread.
struct Serial<'a>(&'a dyn LogDensity);

impl Evaluator for Serial<'_> {
    fn evaluate(&self, batch: &[Vec<f64>]) -> Vec<Evaluation> {
        batch.iter().map(|theta| self.0.evaluate(theta)).collect()
    }
}

/// An expectation of known value.
struct Truth {
    what: String,
    value: f64,
    of: Function,
}

fn truth(what: &str, value: f64, of: impl Fn(&[f64]) -> f64 + 'static) -> Truth {
    Truth { what: what.to_owned(), value, of: Box::new(of) }
}

/// Checks a move (or mix) on a correlated Gaussian and on a skewed density with hard walls.
pub(crate) fn check(mix: impl Fn() -> Mix) -> Result<(), String> {
    gaussian(mix())?;
    skewed(mix())
}

/// Three coordinates of very different scales, correlations 0.9 and -0.6.
fn gaussian(mix: Mix) -> Result<(), String> {
    // x = mean + L z
    const MEAN: [f64; 3] = [5.0, -300.0, 0.01];
    const L: [[f64; 3]; 3] = [[2.0, 0.0, 0.0], [90.0, 43.6, 0.0], [-6e-4, 2e-4, 7.7e-4]];
    let standard = |x: &[f64]| {
        let z0 = (x[0] - MEAN[0]) / L[0][0];
        let z1 = (x[1] - MEAN[1] - L[1][0] * z0) / L[1][1];
        [z0, z1, (x[2] - MEAN[2] - L[2][0] * z0 - L[2][1] * z1) / L[2][2]]
    };
    let density = Toy::new(3, move |x| -0.5 * standard(x).iter().map(|z| z * z).sum::<f64>());
    let mut truths = Vec::new();
    for i in 0..3 {
        truths.push(truth(&format!("mean of z{i}"), 0.0, move |x| standard(x)[i]));
        for j in 0..=i {
            let identity = if i == j { 1.0 } else { 0.0 };
            truths.push(truth(&format!("covariance of z{i}, z{j}"), identity, move |x| {
                let z = standard(x);
                z[i] * z[j]
            }));
        }
        // Quantiles of the marginal of x_i, at -1.644854, -0.674490, 0, ... standard deviations.
        let sd = L[i].iter().map(|l| l * l).sum::<f64>().sqrt();
        for (p, z) in [(0.05, -1.644854), (0.25, -0.674490), (0.5, 0.0), (0.75, 0.674490), (0.95, 1.644854)] {
            truths.push(truth(&format!("share below quantile {p} of x{i}"), p, move |x| below(x[i], MEAN[i] + z * sd)));
        }
    }
    let start = |u: [f64; 3]| (0..3).map(|i| MEAN[i] + 3.0 * L[i][i] * u[i]).collect();
    recover("gaussian", &density, mix, &truths, &start)
}

/// A half-normal (wall at 0), a gamma of shape 2 (wall at 0) and a box (walls at 0 and 1).
fn skewed(mix: Mix) -> Result<(), String> {
    let density = Toy::new(3, |x: &[f64]| {
        let inside = x[0] > 0.0 && x[1] > 0.0 && (0.0..1.0).contains(&x[2]);
        if inside { -0.5 * x[0] * x[0] + x[1].ln() - x[1] } else { f64::NEG_INFINITY }
    });
    let mut truths = vec![
        truth("mean of the half-normal", (2.0 / std::f64::consts::PI).sqrt(), |x| x[0]),
        truth("second moment of the half-normal", 1.0, |x| x[0] * x[0]),
        truth("mean of the gamma", 2.0, |x| x[1]),
        truth("second moment of the gamma", 6.0, |x| x[1] * x[1]),
        truth("mean of the box", 0.5, |x| x[2]),
    ];
    for (p, q) in [(0.05, 0.062707), (0.25, 0.318639), (0.5, 0.674490), (0.75, 1.150349), (0.95, 1.959964)] {
        truths.push(truth(&format!("share below quantile {p} of the half-normal"), p, move |x| below(x[0], q)));
        truths.push(truth(&format!("share below {p} of the box"), p, move |x| below(x[2], p)));
    }
    for q in [0.3f64, 1.0, 1.7, 3.0, 5.0] {
        let share = 1.0 - (-q).exp() * (1.0 + q);
        truths.push(truth(&format!("share of the gamma below {q}"), share, move |x| below(x[1], q)));
    }
    let start = |u: [f64; 3]| vec![1.0 + 0.9 * u[0], 2.0 + 1.9 * u[1], 0.5 + 0.49 * u[2]];
    recover("skewed", &density, mix, &truths, &start)
}

fn below(x: f64, limit: f64) -> f64 {
    if x < limit { 1.0 } else { 0.0 }
}

/// Runs the mix from a start spread by low-discrepancy numbers in (-1, 1) and compares every truth.
fn recover<F: Fn(&[f64]) -> f64 + Sync>(
    target: &str,
    density: &Toy<F>,
    mix: Mix,
    truths: &[Truth],
    start: &dyn Fn([f64; 3]) -> Vec<f64>,
) -> Result<(), String> {
    let settings = SamplerSettings { ensembles: ENSEMBLES, walkers: Some(12), seed: 7, ..SamplerSettings::default() };
    let evaluator = Serial(density);
    let sampler = Sampler::new(density, &evaluator, &settings).map_err(|e| e.to_string())?.with_mix(mix);
    let unit = |n: usize, root: f64| 2.0 * ((n as f64 + 1.0) * root).fract() - 1.0;
    let place = |n: usize| start([unit(n, 0.754878), unit(n, 0.569840), unit(n, 0.414214)]);
    let positions: Positions =
        (0..ENSEMBLES).map(|e| (0..settings.walkers()).map(|w| place(e * settings.walkers() + w)).collect()).collect();
    let (mut state, _) = sampler.start(&positions).map_err(|e| e.to_string())?;
    let mut sums = vec![[0.0; ENSEMBLES]; truths.len()];
    for step in 0..STEPS {
        let records = sampler.step(&mut state, &AtomicBool::new(false)).expect("no stop is requested");
        for record in records.iter().filter(|_| step >= DISCARD) {
            sums.iter_mut().zip(truths).for_each(|(sum, truth)| sum[record.ensemble] += (truth.of)(&record.theta));
        }
    }
    let count = ((STEPS - DISCARD) * settings.walkers()) as f64;
    for (sum, Truth { what, value, .. }) in sums.iter().zip(truths) {
        let mean = sum.iter().sum::<f64>() / (count * ENSEMBLES as f64);
        let variance = sum.iter().map(|s| (s / count - mean).powi(2)).sum::<f64>() / (ENSEMBLES as f64 - 1.0);
        let error = (variance / ENSEMBLES as f64).sqrt();
        // Student's t of 15 degrees of freedom exceeds 4.5 once in 2000 times; some 70 truths are tested.
        if (mean - value).abs() > 4.5 * error || error > 0.05 * value.abs().max(1.0) {
            return Err(format!("{target}: {what} is {mean} +- {error}, but should be {value}"));
        }
    }
    Ok(())
}
