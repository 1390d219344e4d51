//! The loop of steps, and when it ends: goals reached, step limit, or asked to.
//!
//! The goals are looked at every so many steps and depend on the chain's content alone, so a chain that was interrupted
//! and resumed ends at the same step as one that was not.

use crate::sampling::chain::{Chain, ChainError, Convergence, Goals, ParameterKind, Record, Shape, Summary, summarise};
use crate::sampling::ensemble::{EnsembleError, Sampler, SamplerSettings, State};
use crate::sampling::log_density::{LogDensity, Threads};
use std::convert::Infallible;
use std::sync::atomic::AtomicBool;

/// When to end.
#[derive(Clone, Debug, PartialEq)]
pub struct StopPolicy {
    /// Step limit: the number of the last step.
    pub steps: usize,
    /// What every parameter must reach.
    pub goals: Goals,
    /// The goals are looked at when the step is a multiple of this; before twice as many steps, of a fifth of it.
    pub every: usize,
    /// Steps to make in any case: the goals end no chain before this step (for `--extend`).
    pub least: usize,
}

/// A chain ends early only if what is kept of it is so many autocorrelation times long.
const EARLY_TIMES: f64 = 10.0;

/// No chain ends before this step: with fewer, walkers that are stuck look like others.
const EARLIEST: usize = 20;

/// What is done with each step: the records, and the diagnostics when they were due.
pub type OnStep<'a, E> = dyn FnMut(&[Record], Option<&Convergence>) -> Result<(), E> + 'a;

/// Why a chain ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// Every parameter has reached the goals.
    Converged,
    /// The step limit is reached and the goals are not.
    StepLimit,
    /// It was asked to stop; the chain can be resumed.
    Interrupted,
}

/// What can go wrong in [`run`].
#[derive(Debug, thiserror::Error)]
pub enum RunError<E> {
    /// The sampler refused.
    #[error(transparent)]
    Ensemble(#[from] EnsembleError),
    /// The chain refused a step.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The caller's callback failed.
    #[error("{0}")]
    Callback(E),
}

impl StopPolicy {
    /// The policy of the settings, looking at the goals every 50 steps, and every 10 steps from step 20 to 100.
    pub fn new(settings: &SamplerSettings) -> Self {
        let goals = Goals { rhat: settings.rhat, ess: settings.ess };
        StopPolicy { steps: settings.steps, goals, every: 50, least: 0 }
    }

    /// Whether the chain ends where it is now, with the diagnostics if they were made.
    ///
    /// # Errors
    /// [`ChainError::Kinds`] when `kinds` does not match the chain.
    pub fn verdict(
        &self,
        chain: &Chain,
        kinds: &[ParameterKind],
    ) -> Result<(Option<StopReason>, Option<Convergence>), ChainError> {
        let Some(step) = chain.steps().checked_sub(1) else { return Ok((None, None)) };
        let due = step > 0 && (step.is_multiple_of(self.every.max(1)) || step >= self.steps);
        // early on five times as often
        let early = step > 0 && step < 2 * self.every && step.is_multiple_of((self.every / 5).max(1));
        let convergence = if due || early { Some(Convergence::of(chain, kinds)?) } else { None };
        let reason = match &convergence {
            Some(convergence)
                if (due || (step >= EARLIEST && convergence.kept_times() >= EARLY_TIMES))
                    && step >= self.least
                    && convergence.reached(&self.goals) =>
            {
                Some(StopReason::Converged)
            }
            _ if step >= self.steps => Some(StopReason::StepLimit),
            _ => None,
        };
        Ok((reason, convergence))
    }
}

/// Steps from the end of `chain` until the policy or `stop` says so.
///
/// `chain` holds step 0 at least ([`Sampler::start`]) or whatever was read back. Each step is handed to `on_step`
/// (which writes it, and shows progress) together with the diagnostics when they were due, before the next one begins.
///
/// # Errors
/// [`RunError`]: a chain that does not fit the sampler, or a callback that failed.
pub fn run<E>(
    sampler: &Sampler,
    chain: &mut Chain,
    kinds: &[ParameterKind],
    policy: &StopPolicy,
    stop: &AtomicBool,
    on_step: &mut OnStep<E>,
) -> Result<StopReason, RunError<E>> {
    let mut state: State = sampler.resume(chain)?;
    if let (Some(reason), _) = policy.verdict(chain, kinds)? {
        return Ok(reason);
    }
    loop {
        let Some(records) = sampler.step(&mut state, stop) else { return Ok(StopReason::Interrupted) };
        chain.push_step(&records)?;
        let (reason, convergence) = policy.verdict(chain, kinds)?;
        on_step(&records, convergence.as_ref()).map_err(RunError::Callback)?;
        if let Some(reason) = reason {
            return Ok(reason);
        }
    }
}

/// A chain of `density` in memory, on all threads, and its summary: from `start`, positions
/// `[ensemble][walker][parameter]`, until the goals or the step limit of `settings`. The surrogate among its moves has
/// no part in it. The same seed gives the same chain, whatever the number of threads.
///
/// # Errors
/// [`EnsembleError`]: settings that are impossible for this density, or a start that is none.
pub fn sample(
    density: &dyn LogDensity,
    settings: &SamplerSettings,
    start: &[Vec<Vec<f64>>],
) -> Result<(Chain, Summary), EnsembleError> {
    let evaluator = Threads(density);
    let sampler = Sampler::new(density, &evaluator, settings)?;
    let (_, first) = sampler.start(start)?;
    let shape = Shape::of(density, settings.ensembles, settings.walkers());
    let kinds = vec![ParameterKind::Linear; shape.names.len()];
    let mut chain = Chain::new(shape);
    chain.push_step(&first).expect(OURS);
    let policy = StopPolicy::new(settings);
    let nothing = &mut |_: &[Record], _: Option<&Convergence>| Ok::<(), Infallible>(());
    match run(&sampler, &mut chain, &kinds, &policy, &AtomicBool::new(false), nothing) {
        Ok(_) => {
            let summary = summarise(&chain, &kinds, &policy.goals).expect(OURS);
            Ok((chain, summary))
        }
        Err(RunError::Ensemble(error)) => Err(error),
        Err(RunError::Chain(error)) => panic!("{OURS}: {error}"),
        Err(RunError::Callback(never)) => match never {},
    }
}

/// Why a chain takes what the sampler hands to it.
const OURS: &str = "records are the sampler's own";
