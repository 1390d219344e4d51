//! The loop of steps, and when it ends: goals reached, step limit, or a request.
//!
//! The goals are checked at fixed intervals and depend only on the chain's content, so an interrupted and resumed chain
//! ends at the same step as an uninterrupted one.

use crate::sampling::chain::{Chain, ChainError, Convergence, Goals, ParameterKind, Record, Shape, Summary, summarise};
use crate::sampling::ensemble::{EnsembleError, Sampler, SamplerSettings, State};
use crate::sampling::log_density::{LogDensity, Threads};
use std::convert::Infallible;
use std::sync::atomic::AtomicBool;

/// Stopping criteria.
#[derive(Clone, Debug, PartialEq)]
pub struct StopPolicy {
    /// Step limit: the number of the last step.
    pub steps: usize,
    /// Goals for every parameter.
    pub goals: Goals,
    /// The goals are checked at multiples of this step; before twice as many steps, at multiples of a fifth of it.
    pub every: usize,
    /// Minimum number of steps: the goals end no chain before this step (for `--extend`).
    pub least: usize,
}

/// A chain ends early only if its kept steps are this many autocorrelation times long.
const EARLY_TIMES: f64 = 10.0;

/// No chain ends before this step: with fewer, stuck walkers look like others.
const EARLIEST: usize = 20;

/// The callback for each step: the records, and the diagnostics when due.
pub type OnStep<'a, E> = dyn FnMut(&[Record], Option<&Convergence>) -> Result<(), E> + 'a;

/// Why a chain ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// Every parameter has reached the goals.
    Converged,
    /// The step limit is reached and the goals are not.
    StepLimit,
    /// A stop was requested; the chain can be resumed.
    Interrupted,
}

/// Errors of [`run`].
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
    /// The policy of the settings, checking the goals every 50 steps, and every 10 steps from step 20 to 100.
    pub fn new(settings: &SamplerSettings) -> Self {
        let goals = Goals { rhat: settings.rhat, ess: settings.ess };
        StopPolicy { steps: settings.steps, goals, every: 50, least: 0 }
    }

    /// Whether the chain ends at its present step, with the diagnostics if computed.
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
/// `chain` contains at least step 0 ([`Sampler::start`]) or the steps read from a file. Each step is passed to
/// `on_step` (which writes it, and shows progress) together with the diagnostics when due, before the next one begins.
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
/// `[ensemble][walker][parameter]`, until the goals or the step limit of `settings`. The surrogate move is not used.
/// The same seed gives the same chain, whatever the number of threads.
///
/// # Errors
/// [`EnsembleError`]: settings that are impossible for this density, or an invalid start.
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

/// Why a chain accepts the output of the sampler.
const OURS: &str = "records are the sampler's own";
