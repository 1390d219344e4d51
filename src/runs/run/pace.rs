//! The progress of a growing chain, for its user.

use super::Run;
use crate::sampling::chain::advice::growth_needed;
use crate::sampling::chain::{Convergence, Goals, Record};
use crate::sampling::log_density::Status;
use std::time::{Duration, Instant};

/// The cost of a chain, estimated before its second step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Steps until every parameter should have reached its goals; the step limit if unknown.
    pub steps: usize,
    /// Whether that is the limit.
    pub is_limit: bool,
    /// Evaluations of a step.
    pub evaluations: usize,
    /// Their duration in the first step.
    pub of_a_step: Duration,
}

/// With a smaller accepted fraction, a surrogate does not predict the length of a chain.
const TELLING: f64 = 0.3;

/// Discarded steps at the beginning, and effective samples per evaluation over the square of the accepted fraction,
/// from chains of simulated stars.
const LEFT_OUT: f64 = 10.0;
const EFFICIENCY: f64 = 0.7;

impl Cost {
    /// For a run after its first step.
    pub fn of(run: &Run) -> Self {
        let evaluations = run.chain.shape().size();
        let accepted = run.surrogate.as_ref().map_or(0.0, |(_, accepted)| *accepted);
        let of_goals = run.policy.goals.ess / (EFFICIENCY * accepted.powi(2) * evaluations as f64);
        let (needed, limit) = ((LEFT_OUT + of_goals).ceil(), run.policy.steps);
        let is_limit = accepted < TELLING || needed > limit as f64;
        Cost { steps: if is_limit { limit } else { needed as usize }, is_limit, evaluations, of_a_step: run.first_step }
    }

    /// Total duration.
    pub fn time(&self) -> Duration {
        self.of_a_step.mul_f64(self.steps as f64)
    }
}

/// Measures the progress of a chain.
pub struct Meter {
    names: Vec<String>,
    goals: Goals,
    began: Instant,
    first_step: usize,
    last_step: usize,
    evaluations: usize,
    accepted: usize,
    moved: usize,
    /// R-hat and ESS of the parameters farthest from their goals, at the last check.
    convergence: Option<String>,
    /// The step at which the goals should be reached, if it can be estimated.
    goal_step: Option<f64>,
}

/// The progress of a chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    /// The last step made.
    pub step: usize,
    /// The step at which the run ends if its goals are not reached before.
    pub last_step: usize,
    /// The step at which it should end: that of the goals if it can be estimated, otherwise the last one.
    pub end: f64,
    /// Whether the step of the goals can be estimated.
    pub in_sight: bool,
    /// Time left until then.
    pub left: Duration,
    /// Evaluations per second.
    pub rate: f64,
    /// Accepted fraction of the proposals.
    pub acceptance: f64,
    /// R-hat and effective sample size at the last check, as text.
    pub convergence: Option<String>,
}

impl Meter {
    /// For a run that is about to continue.
    pub fn new(run: &Run) -> Self {
        Meter {
            names: run.chain.names().to_vec(),
            goals: *run.goals(),
            began: Instant::now(),
            first_step: run.chain.steps().saturating_sub(1),
            last_step: run.last_step(),
            evaluations: 0,
            accepted: 0,
            moved: 0,
            convergence: None,
            goal_step: None,
        }
    }

    /// Counts a step, and the `convergence` where it was checked.
    pub fn step(&mut self, records: &[Record], convergence: Option<&Convergence>) -> Pace {
        self.evaluations += records.iter().filter(|r| r.proposed != Status::OutsidePrior).count();
        self.accepted += records.iter().filter(|r| r.accepted).count();
        self.moved += records.len();
        let step = records.first().map_or(0, |r| r.step);
        if let Some(convergence) = convergence {
            self.look(step, convergence);
        }
        let elapsed = self.began.elapsed().as_secs_f64();
        let per_step = elapsed / step.saturating_sub(self.first_step).max(1) as f64;
        let limit = self.last_step as f64;
        let end = self.goal_step.map_or(limit, |goal| goal.min(limit));
        Pace {
            step,
            last_step: self.last_step,
            end,
            in_sight: self.goal_step.is_some(),
            left: Duration::from_secs_f64(per_step * (end - step as f64).max(0.0)),
            rate: self.evaluations as f64 / elapsed.max(1e-9),
            acceptance: self.accepted as f64 / self.moved as f64,
            convergence: self.convergence.clone(),
        }
    }

    /// The parameter that is farthest from its goals.
    fn look(&mut self, step: usize, convergence: &Convergence) {
        let named = || convergence.diagnostics.iter().zip(&self.names);
        let rhat = named().filter_map(|(d, name)| Some((d.rhat?, name))).max_by(|a, b| a.0.total_cmp(&b.0));
        let ess = named().filter_map(|(d, _)| d.ess).reduce(f64::min);
        if let Some(((rhat, name), ess)) = rhat.zip(ess) {
            self.convergence = Some(format!("R-hat {rhat:.3} ({name}), ESS {ess:.0} of {:.0}", self.goals.ess));
            self.goal_step = growth_needed(convergence, &self.goals).map(|growth| growth * step as f64);
        }
    }
}
