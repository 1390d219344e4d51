//! The sampler from outside: threads, starts, wraps, and a chain cut and resumed through its journal.

use dimcmc::internals::data::io::journal::{self, Journal};
use dimcmc::internals::sampling::chain::{Chain, ParameterKind, Record, Shape, summarise};
use dimcmc::internals::sampling::ensemble::moves::{DifferentialEvolution, Stretch};
use dimcmc::internals::sampling::ensemble::{
    EnsembleError, Mix, Positions, Sampler, SamplerSettings, StartDraw, StopPolicy, StopReason, draw_start, run,
};
use dimcmc::internals::sampling::log_density::{Evaluation, Evaluator, LogDensity, Status, Threads};
use nalgebra::DMatrix;
use std::cell::Cell;
use std::convert::Infallible;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// An orbit's (K, phi, v): K and phi move as (x, y). Gaussian in K around 0.1, von Mises in phi around 0.97, so that
/// the posterior lies across the wrap; uniform prior in K from 0 to 0.3. Some places fail, in every way there is.
struct Orbit {
    names: Vec<String>,
    /// Whether some evaluations fail.
    fails: bool,
}

impl Orbit {
    fn new(fails: bool) -> Self {
        Orbit { names: ["k_kms", "phi", "vsys_kms"].map(str::to_owned).to_vec(), fails }
    }
}

impl LogDensity for Orbit {
    fn names(&self) -> &[String] {
        &self.names
    }
    fn number_names(&self) -> &[&str] {
        &["spottedness", "chi2"]
    }
    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        let [k, phi, v] = [theta[0], theta[1], theta[2]];
        if k > 0.3 {
            return Evaluation::rejected(Status::OutsidePrior);
        }
        let log_prob = -0.5 * ((k - 0.1) / 0.05).powi(2) + 3.0 * (TAU * (phi - 0.97)).cos() - 0.5 * (v / 8.0).powi(2);
        let (log_prob, status) = match (v.abs() * 1000.0) as u64 % 17 {
            3 if self.fails => (f64::NAN, Status::Converged),
            5 if self.fails => (log_prob, Status::StoppedShort),
            7 if self.fails => (log_prob, Status::Unreachable),
            _ => (log_prob, Status::Converged),
        };
        let numbers = vec![0.06 + 1e-3 * k, 2764.5 - v];
        Evaluation { log_prob, numbers, model_applications: 20 + (v.abs() as u32), status }
    }
    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        vec![theta[0] * (TAU * theta[1]).cos(), theta[0] * (TAU * theta[1]).sin(), theta[2]]
    }
    fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        let phi = (internal[1].atan2(internal[0]) / TAU).rem_euclid(1.0);
        vec![internal[0].hypot(internal[1]), if phi < 1.0 { phi } else { 0.0 }, internal[2]]
    }
    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        -(TAU * theta[0]).ln()
    }
}

/// One evaluation after the other: for densities that cost less than handing them to a thread.
struct Serial<'a>(&'a dyn LogDensity);

impl Evaluator for Serial<'_> {
    fn evaluate(&self, batch: &[Vec<f64>]) -> Vec<Evaluation> {
        batch.iter().map(|theta| self.0.evaluate(theta)).collect()
    }
}

const KINDS: [ParameterKind; 3] = [ParameterKind::Amplitude, ParameterKind::Periodic, ParameterKind::Linear];

fn settings(ensembles: usize, walkers: usize, steps: usize) -> SamplerSettings {
    SamplerSettings { ensembles, walkers: Some(walkers), steps, seed: 5, ..SamplerSettings::default() }
}

fn shape(density: &dyn LogDensity, settings: &SamplerSettings) -> Shape {
    Shape::of(density, settings.ensembles, settings.walkers())
}

fn start(density: &dyn LogDensity, settings: &SamplerSettings) -> Positions {
    let covariance = DMatrix::from_diagonal(&nalgebra::dvector![0.03f64.powi(2), 0.03f64.powi(2), 64.0]);
    let SamplerSettings { ensembles, seed, .. } = *settings;
    let walkers = settings.walkers();
    let centre = [0.1, 0.97, 0.0];
    let draw = StartDraw { centre: &centre, covariance: &covariance, scale: 1.5, ensembles, walkers, seed };
    let fine = |theta: &[f64]| {
        let evaluation = density.evaluate(theta);
        evaluation.log_prob.is_finite() && !evaluation.status.is_failure()
    };
    draw_start(density, &draw, &fine).unwrap()
}

/// Runs from the start, or from what the file holds, to the end of the policy, through the journal.
fn through_journal(path: &Path, density: &Orbit, settings: &SamplerSettings, stop_after: Option<usize>) -> StopReason {
    let evaluator = Threads(density);
    let sampler = Sampler::new(density, &evaluator, settings).unwrap();
    let (mut journal, mut chain) = if path.exists() {
        Journal::recover(path, shape(density, settings)).unwrap()
    } else {
        let shape = shape(density, settings);
        (Journal::create(path, shape.clone(), false).unwrap(), Chain::new(shape))
    };
    if chain.steps() == 0 {
        let (_, records) = sampler.start(&start(density, settings)).unwrap();
        journal.append(&records).unwrap();
        chain.push_step(&records).unwrap();
    }
    let stop = AtomicBool::new(false);
    let mut done = 0;
    let policy = StopPolicy::new(settings);
    run(&sampler, &mut chain, &KINDS, &policy, &stop, &mut |records, _| {
        done += 1;
        stop.store(Some(done) == stop_after, Ordering::Relaxed);
        journal.append(records)
    })
    .unwrap()
}

#[test]
fn cut_anywhere_and_resumed_is_the_uninterrupted_chain() {
    let folder = tempfile::tempdir().unwrap();
    let (density, settings) = (Orbit::new(true), settings(2, 6, 40));
    let whole = folder.path().join("whole.jsonl");
    assert_eq!(through_journal(&whole, &density, &settings, None), StopReason::StepLimit);
    let bytes = std::fs::read(&whole).unwrap();
    assert_eq!(bytes.iter().filter(|byte| **byte == b'\n').count(), 2 * 6 * 41);
    for cut in [0, 1, 500, bytes.len() / 3, bytes.len() / 2 + 7, 54321, 100_003, bytes.len() - 1, bytes.len()] {
        let path = folder.path().join(format!("cut{cut}.jsonl"));
        std::fs::write(&path, &bytes[..cut]).unwrap();
        through_journal(&path, &density, &settings, None);
        assert!(std::fs::read(&path).unwrap() == bytes, "cut at byte {cut} of {}", bytes.len());
    }
    let path = folder.path().join("stopped.jsonl");
    assert_eq!(through_journal(&path, &density, &settings, Some(7)), StopReason::Interrupted);
    assert_eq!(through_journal(&path, &density, &settings, Some(1)), StopReason::Interrupted);
    assert_eq!(through_journal(&path, &density, &settings, None), StopReason::StepLimit);
    assert!(std::fs::read(&path).unwrap() == bytes, "stopped and resumed");
}

#[test]
fn a_resumed_chain_converges_at_the_same_step() {
    let folder = tempfile::tempdir().unwrap();
    let settings = SamplerSettings { ess: 150.0, rhat: 1.1, ..settings(3, 8, 2000) };
    let density = Orbit::new(false);
    let whole = folder.path().join("whole.jsonl");
    assert_eq!(through_journal(&whole, &density, &settings, None), StopReason::Converged);
    let bytes = std::fs::read(&whole).unwrap();
    let cut = folder.path().join("cut.jsonl");
    for share in [0.37, 0.71, 0.999, 1.0] {
        std::fs::write(&cut, &bytes[..(share * bytes.len() as f64) as usize]).unwrap();
        assert_eq!(through_journal(&cut, &density, &settings, None), StopReason::Converged);
        assert!(std::fs::read(&cut).unwrap() == bytes, "cut at {share}");
    }
    // An extension goes on although the goals are reached.
    let (_, mut chain) = Journal::recover(&cut, shape(&density, &settings)).unwrap();
    let last = chain.steps() - 1;
    let evaluator = Serial(&density);
    let sampler = Sampler::new(&density, &evaluator, &settings).unwrap();
    let policy = StopPolicy { steps: last + 30, least: last + 30, ..StopPolicy::new(&settings) };
    let mut none = |_: &[Record], _: Option<&_>| Ok::<(), Infallible>(());
    run(&sampler, &mut chain, &KINDS, &policy, &AtomicBool::new(false), &mut none).unwrap();
    assert_eq!(chain.steps() - 1, last + 30);
}

#[test]
fn the_number_of_threads_does_not_show() {
    let folder = tempfile::tempdir().unwrap();
    let (density, settings) = (Orbit::new(true), settings(3, 8, 60));
    let of_threads = |threads: usize| {
        let path = folder.path().join(format!("{threads}.jsonl"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| through_journal(&path, &density, &settings, None));
        std::fs::read(path).unwrap()
    };
    assert!(of_threads(1) == of_threads(2));
}

#[test]
fn an_orbit_is_recovered_and_failures_are_counted() {
    let (density, settings) = (Orbit::new(true), SamplerSettings { ess: 8000.0, ..settings(4, 16, 6000) });
    let evaluator = Serial(&density);
    let sampler = Sampler::new(&density, &evaluator, &settings).unwrap();
    let mut chain = Chain::new(shape(&density, &settings));
    chain.push_step(&sampler.start(&start(&density, &settings)).unwrap().1).unwrap();
    let policy = StopPolicy { every: 500, ..StopPolicy::new(&settings) };
    let mut none = |_: &[Record], _: Option<&_>| Ok::<(), Infallible>(());
    let reason = run(&sampler, &mut chain, &KINDS, &policy, &AtomicBool::new(false), &mut none).unwrap();
    assert_eq!(reason, StopReason::Converged);
    let summary = summarise(&chain, &KINDS, &policy.goals).unwrap();
    assert!(summary.converged);
    // Mean and variance of the Gaussian of K, cut at 0 and 0.3, i.e. -2 and +4 sigma: mean from the densities at the
    // walls.
    let (lower, mass) = ((-2.0f64).powi(2), 0.977250 - 3.17e-5);
    let density_at = |square: f64| (-0.5 * square).exp() / TAU.sqrt();
    let mean = 0.1 + 0.05 * (density_at(lower) - density_at(16.0)) / mass;
    // ESS of 8000 or more: errors of 1/90 of a standard deviation, times 4.
    let k = &summary.parameters["k_kms"];
    assert!((k.mean - mean).abs() < 4.0 * k.sd / 90.0, "{} against {mean}", k.mean);
    let phi = &summary.parameters["phi"];
    assert!((phi.median - 0.97).abs() < 4.0 * 1.25 * phi.sd / 90.0, "{phi:?}");
    assert!(phi.ci95[0] < 0.97 && phi.ci95[1] > 1.0, "{phi:?}");
    // Von Mises of concentration 3: the mean cosine is I1(3) / I0(3).
    let cosines = chain.series_of(summary.discarded_steps, |record| (TAU * (record.theta[1] - 0.97)).cos());
    let cosines: Vec<f64> = cosines.into_iter().flatten().flatten().collect();
    let found = cosines.iter().sum::<f64>() / cosines.len() as f64;
    assert!((found - 3.953370 / 4.880793).abs() < 0.012, "{found}");
    let count = |status| chain.records().iter().filter(|record| record.proposed == status).count();
    assert_eq!(summary.failures, count(Status::NonFinite) + count(Status::StoppedShort));
    assert!(count(Status::NonFinite) > 0 && count(Status::StoppedShort) > 0 && count(Status::Unreachable) > 0);
    assert_eq!(summary.evaluations, chain.records().len() - count(Status::OutsidePrior));
    assert!(count(Status::OutsidePrior) > 0);
    assert!(chain.records().iter().all(|record| !record.status.is_failure() && record.log_prob.is_finite()));
}

/// A phase alone, wrapped into [0, 1): von Mises of concentration 1 around 0.1.
struct Phase(Vec<String>);

impl LogDensity for Phase {
    fn names(&self) -> &[String] {
        &self.0
    }
    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        assert!((0.0..1.0).contains(&theta[0]), "positions are written wrapped");
        Evaluation::of((TAU * (theta[0] - 0.1)).cos())
    }
    fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        vec![internal[0].rem_euclid(1.0).min(1.0 - f64::EPSILON)]
    }
}

#[test]
fn a_wrapped_coordinate_keeps_the_balance_of_every_move() {
    let density = Phase(vec!["phi".to_owned()]);
    let evaluator = Serial(&density);
    let settings = settings(8, 10, 1);
    let positions: Positions =
        (0..8).map(|e| (0..10).map(|w| vec![((e * 10 + w) as f64 * 0.618034).fract()]).collect()).collect();
    let mixes = [
        Mix::default().with(1.0, Box::new(Stretch::default())),
        Mix::default().with(1.0, Box::new(DifferentialEvolution::default())),
    ];
    for (which, mix) in mixes.into_iter().enumerate() {
        let sampler = Sampler::new(&density, &evaluator, &settings).unwrap().with_mix(mix);
        let (mut state, _) = sampler.start(&positions).unwrap();
        let (mut cosine, mut sine, mut count) = (0.0, 0.0, 0.0);
        for _ in 0..6000 {
            for record in sampler.step(&mut state, &AtomicBool::new(false)).unwrap() {
                cosine += (TAU * (record.theta[0] - 0.1)).cos();
                sine += (TAU * (record.theta[0] - 0.1)).sin();
                count += 1.0;
            }
        }
        // I1(1) / I0(1); 480,000 draws of autocorrelation time 10 or so: 0.004.
        assert!((cosine / count - 0.446398).abs() < 0.015, "mix {which}: {}", cosine / count);
        assert!((sine / count).abs() < 0.015, "mix {which}: {}", sine / count);
    }
}

#[test]
fn degenerate_and_forbidden_starts_name_the_culprit() {
    let density = Orbit::new(false);
    let evaluator = Threads(&density);
    let settings = settings(2, 8, 10);
    let sampler = Sampler::new(&density, &evaluator, &settings).unwrap();
    let good = start(&density, &settings);
    let refused = |change: &dyn Fn(&mut Positions)| {
        let mut positions = good.clone();
        change(&mut positions);
        sampler.start(&positions).unwrap_err()
    };
    assert!(sampler.start(&good).is_ok());
    let equal = refused(&|p| p[1].iter_mut().for_each(|theta| theta[2] = 1.5));
    assert_eq!(equal, EnsembleError::StartNoSpread { ensemble: 1, name: "vsys_kms".to_owned() });
    let plane = refused(&|p| {
        p[0].iter_mut().for_each(|theta| {
            let internal = density.to_sampling(theta);
            theta[2] = 20.0 * internal[0] - 70.0 * internal[1] + 2.0;
        });
    });
    assert!(matches!(&plane, EnsembleError::StartDependent { ensemble: 0, name, .. } if name == "vsys_kms"), "{plane}");
    let forbidden = refused(&|p| p[1][3][0] = 0.4);
    let message = forbidden.to_string();
    assert!(message.contains("ensemble 1, walker 3") && message.contains("k_kms = 0.4"), "{message}");
    let not_finite = refused(&|p| p[0][2][2] = f64::NAN);
    assert!(matches!(&not_finite, EnsembleError::StartNotFinite { walker: 2, name, .. } if name == "vsys_kms"));
    assert!(matches!(refused(&|p| drop(p[1].pop())), EnsembleError::Shape { expected: 8, found: 7, .. }));
    assert!(matches!(refused(&|p| drop(p.pop())), EnsembleError::Shape { expected: 2, found: 1, .. }));
    // The pole of the Jacobian is no place to start from.
    assert!(matches!(refused(&|p| p[0][0][0] = 0.0), EnsembleError::StartForbidden { walker: 0, .. }));
}

#[test]
fn a_start_is_deterministic_wide_and_allowed() {
    let density = Orbit::new(false);
    let covariance = DMatrix::from_diagonal(&nalgebra::dvector![0.01f64.powi(2), 0.01f64.powi(2), 4.0]);
    let centre = [0.1, 0.97, 3.0];
    let draw = StartDraw { centre: &centre, covariance: &covariance, scale: 1.5, ensembles: 4, walkers: 500, seed: 9 };
    let allowed = |theta: &[f64]| theta[2] > 3.0;
    let positions = draw_start(&density, &draw, &allowed).unwrap();
    assert_eq!(positions, draw_start(&density, &draw, &allowed).unwrap());
    assert_ne!(positions, draw_start(&density, &StartDraw { seed: 10, ..draw.clone() }, &allowed).unwrap());
    let all: Vec<&Vec<f64>> = positions.iter().flatten().collect();
    assert!(all.iter().all(|theta| allowed(theta) && (0.0..1.0).contains(&theta[1])));
    let spread = (all.iter().map(|theta| (theta[2] - 3.0).powi(2)).sum::<f64>() / 2000.0).sqrt();
    // Half a Gaussian of 1.5 x 2: its rms is 3, known from 2000 draws to 1.6 %.
    assert!((spread - 3.0).abs() < 0.2, "{spread}");
    let error = draw_start(&density, &draw, &|_| false).unwrap_err().to_string();
    assert!(error.contains("ensemble 0, walker 0") && error.contains("priors"), "{error}");
    let flat = DMatrix::zeros(3, 3);
    let error = draw_start(&density, &StartDraw { covariance: &flat, ..draw }, &allowed).unwrap_err();
    assert_eq!(error, EnsembleError::StartCovariance { dimension: 3 });
}

/// Raises the flag once it has evaluated so many batches.
struct Raises<'a> {
    density: &'a Orbit,
    flag: &'a AtomicBool,
    left: Cell<usize>,
    sizes: &'a std::cell::RefCell<Vec<usize>>,
}

impl Evaluator for Raises<'_> {
    fn evaluate(&self, batch: &[Vec<f64>]) -> Vec<Evaluation> {
        self.sizes.borrow_mut().push(batch.len());
        self.left.set(self.left.get() - 1);
        self.flag.store(self.left.get() == 0, Ordering::Relaxed);
        batch.iter().map(|theta| self.density.evaluate(theta)).collect()
    }
}

#[test]
fn a_flag_between_the_halves_stops_and_leaves_the_state_alone() {
    let (density, flag, sizes) = (Orbit::new(false), AtomicBool::new(false), Default::default());
    let evaluator = Raises { density: &density, flag: &flag, left: Cell::new(4), sizes: &sizes };
    let settings = settings(3, 8, 10);
    let sampler = Sampler::new(&density, &evaluator, &settings).unwrap();
    let (mut state, _) = sampler.start(&start(&density, &settings)).unwrap();
    assert!(sampler.step(&mut state, &flag).is_some());
    let before = state.clone();
    assert_eq!(sampler.step(&mut state, &flag), None);
    assert_eq!(state, before);
    // The start is one batch; so is each half of all three ensembles.
    assert_eq!(*sizes.borrow(), [24, 12, 12, 12]);
}

#[test]
fn a_chain_of_another_run_is_not_resumed() {
    let density = Orbit::new(false);
    let evaluator = Threads(&density);
    let sampler = Sampler::new(&density, &evaluator, &settings(2, 8, 10)).unwrap();
    let good = shape(&density, &settings(2, 8, 10));
    assert_eq!(sampler.resume(&Chain::new(good.clone())), Err(EnsembleError::NothingToResume));
    let other = Shape { walkers: 6, ..good.clone() };
    assert!(sampler.resume(&Chain::new(other)).unwrap_err().to_string().contains("walkers of the chain: 8 expected"));
    let other = Shape { names: vec!["k_kms".to_owned()], ..good.clone() };
    assert!(matches!(sampler.resume(&Chain::new(other)), Err(EnsembleError::Names { .. })));
    let other = Shape { numbers: vec!["log_evidence".to_owned()], ..good };
    let error = sampler.resume(&Chain::new(other)).unwrap_err().to_string();
    assert!(error.contains("log_evidence") && error.contains("spottedness"), "{error}");
}

#[test]
fn reading_while_writing_is_allowed_and_writing_twice_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chain.jsonl");
    let (density, settings) = (Orbit::new(false), settings(2, 8, 5));
    let evaluator = Threads(&density);
    let sampler = Sampler::new(&density, &evaluator, &settings).unwrap();
    let shape = shape(&density, &settings);
    let mut journal = Journal::create(&path, shape.clone(), false).unwrap();
    journal.append(&sampler.start(&start(&density, &settings)).unwrap().1).unwrap();
    assert_eq!(journal::read(&path, &shape).unwrap().steps(), 1);
    let error = Journal::recover(&path, shape.clone()).unwrap_err().to_string();
    assert!(error.contains("another process is writing"), "{error}");
    drop(journal);
    assert!(Journal::recover(&path, shape.clone()).is_ok());
    assert!(Journal::create(&path, shape, false).is_err(), "nothing is overwritten");
}
