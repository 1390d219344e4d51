//! How far a growing chain has come, for those who wait for it.

use super::Run;
use crate::sampling::chain::advice::growth_needed;
use crate::sampling::chain::{Convergence, Goals, Record};
use crate::sampling::log_density::Status;
use std::time::{Duration, Instant};

/// What a chain will cost, guessed before its second step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Steps until every parameter should have reached its goals; where one cannot tell, the step limit.
    pub steps: usize,
    /// Whether that is the limit.
    pub is_limit: bool,
    /// Evaluations of a step.
    pub evaluations: usize,
    /// How long they took in the first step.
    pub of_a_step: Duration,
}

/// A surrogate of which a smaller share is accepted does not tell how long a chain takes.
const TELLING: f64 = 0.3;

/// Steps that are left out at the beginning, and effective samples of an evaluation over the square of the share
/// accepted, as chains of simulated stars had them.
const LEFT_OUT: f64 = 10.0;
const EFFICIENCY: f64 = 0.7;

impl Cost {
    /// Of a run that has made its first step.
    pub fn of(run: &Run) -> Self {
        let evaluations = run.chain.shape().size();
        let accepted = run.surrogate.as_ref().map_or(0.0, |(_, accepted)| *accepted);
        let of_goals = run.policy.goals.ess / (EFFICIENCY * accepted.powi(2) * evaluations as f64);
        let (needed, limit) = ((LEFT_OUT + of_goals).ceil(), run.policy.steps);
        let is_limit = accepted < TELLING || needed > limit as f64;
        Cost { steps: if is_limit { limit } else { needed as usize }, is_limit, evaluations, of_a_step: run.first_step }
    }

    /// How long all of it takes.
    pub fn time(&self) -> Duration {
        self.of_a_step.mul_f64(self.steps as f64)
    }
}

/// Watches a chain grow.
pub struct Meter {
    names: Vec<String>,
    goals: Goals,
    began: Instant,
    first_step: usize,
    last_step: usize,
    evaluations: usize,
    accepted: usize,
    moved: usize,
    /// R-hat and ESS of the parameters farthest from their goals, at the last look.
    convergence: Option<String>,
    /// The step at which the goals should be reached, if one can tell.
    goal_step: Option<f64>,
}

/// How far a chain has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    /// The last step made.
    pub step: usize,
    /// The step at which the run ends if its goals are not reached before.
    pub last_step: usize,
    /// The step at which it should end: that of the goals where they are in sight, or else the last one.
    pub end: f64,
    /// Whether the goals are in sight.
    pub in_sight: bool,
    /// Time left until then.
    pub left: Duration,
    /// Evaluations a second.
    pub rate: f64,
    /// Accepted share of the proposals.
    pub acceptance: f64,
    /// R-hat and effective sample size at the last look, in words.
    pub convergence: Option<String>,
}

impl Meter {
    /// Of a run that is about to go on.
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

    /// Counts a step, and the `convergence` where it was looked at.
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
