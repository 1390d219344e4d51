//! The sampler: independent ensembles, moved half by half, every half of all of them evaluated as one batch.
//!
//! Source: Goodman & Weare 2010 (ensemble), Foreman-Mackey et al. 2013, section 2 (halves in turn). The split into
//! halves is drawn again at each step. Positions are kept in *written* coordinates and a proposal is written ->
//! internal -> move -> written, so a resumed chain is bit-identical. Random numbers are counter-based (`streams`).

use crate::sampling::chain::{Chain, MoveKind, Record};
use crate::sampling::ensemble::streams::{Purpose, random_numbers, stream};
use crate::sampling::ensemble::{EnsembleError, Mix, Move, Proposal, SamplerSettings, describe, start};
use crate::sampling::log_density::{Evaluation, Evaluator, LogDensity, Status};
use rand::Rng;
use rand::seq::SliceRandom;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// One walker.
#[derive(Clone, Debug, PartialEq)]
pub struct Walker {
    /// Position in physical coordinates.
    pub theta: Vec<f64>,
    /// Its evaluation (`model_applications` are lost on resuming and not used).
    pub evaluation: Evaluation,
}

/// All walkers after a step.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// The step they are at; 0 is the start.
    pub step: usize,
    /// Walkers, `[ensemble][walker]`.
    pub ensembles: Vec<Vec<Walker>>,
}

/// Moves ensembles on a density.
pub struct Sampler<'a> {
    density: &'a dyn LogDensity,
    evaluator: &'a dyn Evaluator,
    ensembles: usize,
    walkers: usize,
    seed: u64,
    mix: Mix,
}

/// A proposal within a half-step.
struct Trial {
    ensemble: usize,
    walker: usize,
    theta: Vec<f64>,
    log_factor: f64,
    log_uniform: f64,
    by: MoveKind,
    /// Set where there is nothing to evaluate.
    refused: Option<Status>,
}

/// The result of a step for a walker.
#[derive(Clone, Copy)]
struct Outcome {
    accepted: bool,
    proposed: Status,
    model_applications: u32,
    by: Option<MoveKind>,
}

impl<'a> Sampler<'a> {
    /// A sampler of `density`, whose batches are evaluated by `evaluator`.
    ///
    /// # Errors
    /// [`EnsembleError::Setting`] when the settings are impossible for this density.
    pub fn new(
        density: &'a dyn LogDensity,
        evaluator: &'a dyn Evaluator,
        settings: &SamplerSettings,
    ) -> Result<Self, EnsembleError> {
        settings.validate(density.names().len())?;
        let SamplerSettings { ensembles, seed, .. } = *settings;
        let walkers = settings.walkers();
        Ok(Sampler { density, evaluator, ensembles, walkers, seed, mix: settings.moves.mix() })
    }

    /// The same sampler with one more move, its weight relative to those of the settings.
    pub fn with_move(self, weight: f64, one: Box<dyn Move>) -> Self {
        Sampler { mix: self.mix.with(weight, one), ..self }
    }

    /// The same sampler with other moves.
    pub fn with_mix(self, mix: Mix) -> Self {
        Sampler { mix, ..self }
    }

    /// Step 0: evaluates the start, positions `[ensemble][walker]` in physical coordinates.
    ///
    /// # Errors
    /// [`EnsembleError`] when the start has the wrong shape, is degenerate in sampling coordinates (naming the
    /// parameter), a walker has no finite log-probability, or the evaluator stopped.
    pub fn start(&self, positions: &[Vec<Vec<f64>>]) -> Result<(State, Vec<Record>), EnsembleError> {
        start::check_shape(positions, [self.ensembles, self.walkers, self.density.names().len()])?;
        start::check_spread(self.density, positions)?;
        let evaluations = self.evaluate(positions.iter().flatten().cloned().collect()).ok_or(EnsembleError::Stopped)?;
        let walkers: Vec<Walker> = positions
            .iter()
            .flatten()
            .zip(evaluations)
            .map(|(theta, evaluation)| Walker { theta: theta.clone(), evaluation })
            .collect();
        if let Some(index) = walkers.iter().position(|walker| !self.target(walker).is_finite()) {
            return Err(EnsembleError::StartForbidden {
                ensemble: index / self.walkers,
                walker: index % self.walkers,
                status: walkers[index].evaluation.status,
                position: describe(self.density.names(), &walkers[index].theta),
            });
        }
        let outcomes: Vec<Outcome> = walkers
            .iter()
            .map(|Walker { evaluation, .. }| Outcome {
                accepted: true,
                proposed: evaluation.status,
                model_applications: evaluation.model_applications,
                by: None,
            })
            .collect();
        let ensembles = walkers.chunks(self.walkers).map(<[Walker]>::to_vec).collect();
        let state = State { step: 0, ensembles };
        let records = records(&state, &outcomes);
        Ok((state, records))
    }

    /// The state at the last step of a chain, to resume.
    ///
    /// # Errors
    /// [`EnsembleError`] when the chain has no step, or not the ensembles, walkers and parameters of this sampler.
    pub fn resume(&self, chain: &Chain) -> Result<State, EnsembleError> {
        let shape = chain.shape();
        let counts = [("ensembles", self.ensembles, shape.ensembles), ("walkers", self.walkers, shape.walkers)];
        if let Some((what, expected, found)) = counts.into_iter().find(|(_, expected, found)| expected != found) {
            return Err(EnsembleError::Shape { what: format!("{what} of the chain"), expected, found });
        }
        if chain.names() != self.density.names() {
            let (expected, found) = (self.density.names().to_vec(), chain.names().to_vec());
            return Err(EnsembleError::Names { expected, found });
        }
        if shape.numbers != self.density.number_names() {
            let expected = self.density.number_names().iter().map(|name| (*name).to_owned()).collect();
            return Err(EnsembleError::Numbers { expected, found: shape.numbers.clone() });
        }
        let last = chain.last_step().ok_or(EnsembleError::NothingToResume)?;
        let walker = |record: &Record| {
            let Record { log_prob, ref numbers, status, .. } = *record;
            let evaluation = Evaluation { log_prob, numbers: numbers.clone(), model_applications: 0, status };
            Walker { theta: record.theta.clone(), evaluation }
        };
        let ensembles = last.chunks(self.walkers).map(|records| records.iter().map(walker).collect()).collect();
        Ok(State { step: chain.steps() - 1, ensembles })
    }

    /// Moves every walker once. `None`, with the state unchanged, when `stop` was set before the last half was begun,
    /// or the evaluator stopped within a half.
    pub fn step(&self, state: &mut State, stop: &AtomicBool) -> Option<Vec<Record>> {
        let step = state.step + 1;
        let mut next = State { step, ensembles: state.ensembles.clone() };
        let mut outcomes = vec![None; self.ensembles * self.walkers];
        let splits: Vec<Vec<usize>> = (0..self.ensembles).map(|ensemble| self.split(ensemble, step)).collect();
        for half in 0..2 {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let trials = self.propose(&next, &splits, half);
            let batch =
                trials.iter().filter(|trial| trial.refused.is_none()).map(|trial| trial.theta.clone()).collect();
            let mut evaluations = self.evaluate(batch)?.into_iter();
            for trial in trials {
                let evaluation = match trial.refused {
                    Some(status) => Evaluation::rejected(status),
                    None => evaluations.next().expect("an evaluation for every trial of the batch"),
                };
                let index = trial.ensemble * self.walkers + trial.walker;
                outcomes[index] = Some(self.decide(&mut next, trial, evaluation));
            }
        }
        *state = next;
        let outcomes: Vec<Outcome> = outcomes.into_iter().map(|one| one.expect("every walker is in a half")).collect();
        Some(records(state, &outcomes))
    }

    /// The proposals for one half of every ensemble.
    fn propose(&self, state: &State, splits: &[Vec<usize>], half: usize) -> Vec<Trial> {
        let Sampler { density, mix, seed, walkers: count, .. } = self;
        let each = state.ensembles.iter().zip(splits).enumerate().map(|(ensemble, (walkers, split))| {
            let internal = |&walker: &usize| density.to_sampling(&walkers[walker].theta);
            let (first, second) = split.split_at(count / 2);
            let (moved, others) = if half == 0 { (first, second) } else { (second, first) };
            let complement: Vec<Vec<f64>> = others.iter().map(internal).collect();
            // a proposal of the surrogate takes a tenth of an evaluation
            let of_ensemble: Vec<Trial> = moved
                .par_iter()
                .map(|&walker| {
                    let mut rng = random_numbers(*seed, stream(Purpose::Walker, ensemble, walker), state.step);
                    let here = internal(&walker);
                    let proposal = mix.propose(&here, &complement, &mut rng);
                    let theta = density.to_physical(&proposal.position);
                    let refused = match proposal.position == here {
                        // no new evaluation needed
                        true => Some(Status::OutsidePrior),
                        false => refuse(*density, &proposal.position, &theta, proposal.translation),
                    };
                    let log_uniform = rng.random::<f64>().ln();
                    let Proposal { log_factor, by, .. } = proposal;
                    Trial { ensemble, walker, theta, log_factor, log_uniform, by, refused }
                })
                .collect();
            of_ensemble
        });
        each.flatten().collect()
    }

    /// Accepts or rejects a trial.
    fn decide(&self, state: &mut State, trial: Trial, evaluation: Evaluation) -> Outcome {
        let Evaluation { status: proposed, model_applications, .. } = evaluation;
        let by = trial.by;
        let current = &mut state.ensembles[trial.ensemble][trial.walker];
        let candidate = Walker { theta: trial.theta, evaluation };
        let log_ratio = self.target(&candidate) - self.target(current) + trial.log_factor;
        // A NaN ratio, or a target of plus infinity (a Jacobian's pole), is never accepted.
        let accepted = self.target(&candidate).is_finite() && trial.log_uniform < log_ratio;
        if accepted {
            *current = candidate;
        }
        Outcome { accepted, proposed, model_applications, by: Some(by) }
    }

    /// ln of the density in sampling coordinates, up to a constant.
    fn target(&self, walker: &Walker) -> f64 {
        if walker.evaluation.log_prob == f64::NEG_INFINITY {
            return f64::NEG_INFINITY;
        }
        walker.evaluation.log_prob + self.density.log_jacobian(&walker.theta)
    }

    /// Evaluates a batch; `None` if the evaluation was stopped. Unusable numbers become rejections here, where they
    /// enter the sampler.
    fn evaluate(&self, batch: Vec<Vec<f64>>) -> Option<Vec<Evaluation>> {
        let mut evaluations = if batch.is_empty() { Vec::new() } else { self.evaluator.evaluate(&batch) };
        assert!(evaluations.len() <= batch.len(), "an evaluator answers no more than it is asked");
        if evaluations.len() < batch.len() {
            return None;
        }
        for evaluation in &mut evaluations {
            let usable = evaluation.is_finite();
            if !usable && evaluation.log_prob != f64::NEG_INFINITY {
                evaluation.status = Status::NonFinite;
            }
            if !usable || evaluation.status.is_failure() || evaluation.status == Status::OutsidePrior {
                evaluation.log_prob = f64::NEG_INFINITY;
            }
        }
        Some(evaluations)
    }

    /// The walkers of an ensemble in the order of this step's halves, each half sorted.
    fn split(&self, ensemble: usize, step: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.walkers).collect();
        order.shuffle(&mut random_numbers(self.seed, stream(Purpose::Split, ensemble, 0), step));
        let (first, second) = order.split_at_mut(self.walkers / 2);
        first.sort_unstable();
        second.sort_unstable();
        order
    }
}

/// Why a proposal need not be evaluated: it is not finite, or lies beyond the wrap of a periodic coordinate.
fn refuse(density: &dyn LogDensity, position: &[f64], theta: &[f64], translation: bool) -> Option<Status> {
    if position.iter().chain(theta).any(|x| !x.is_finite()) {
        return Some(Status::NonFinite);
    }
    if translation {
        return None;
    }
    // Rounding is some 1e-16 of the largest coordinate; a wrap is by a period.
    let largest = position.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let back = density.to_sampling(theta);
    let wrapped = position.iter().zip(&back).any(|(x, y)| (x - y).abs() > 1e-6 * largest);
    wrapped.then_some(Status::OutsidePrior)
}

/// The records of a state, given the result for each walker (`ensemble * walkers + walker`).
fn records(state: &State, outcomes: &[Outcome]) -> Vec<Record> {
    let walkers = state.ensembles.iter().enumerate();
    let indexed = walkers.flat_map(|(e, ensemble)| ensemble.iter().enumerate().map(move |(w, walker)| (e, w, walker)));
    indexed
        .zip(outcomes)
        .map(|((ensemble, walker, Walker { theta, evaluation }), outcome)| {
            assert!(evaluation.log_prob.is_finite(), "a walker stands where the log-probability is finite");
            Record {
                ensemble,
                step: state.step,
                walker,
                accepted: outcome.accepted,
                log_prob: evaluation.log_prob,
                theta: theta.clone(),
                numbers: evaluation.numbers.clone(),
                status: evaluation.status,
                proposed: outcome.proposed,
                model_applications: outcome.model_applications,
                by: outcome.by,
            }
        })
        .collect()
}
