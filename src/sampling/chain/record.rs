//! One line of a chain: where a walker of an ensemble stands at a step, and what became of the proposal made for it.
//!
//! The sampler makes these, the journal writes them and the store keeps them; this file belongs to none of the three.

use crate::sampling::chain::ChainError;
use crate::sampling::log_density::Status;
use serde::{Deserialize, Serialize};

/// How a proposal was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MoveKind {
    /// The stretch move.
    Stretch,
    /// Differential evolution.
    DifferentialEvolution,
    /// A draw of the surrogate posterior.
    Surrogate,
}

impl MoveKind {
    /// All of them, in the order of tables.
    pub const ALL: [MoveKind; 3] = [MoveKind::Stretch, MoveKind::DifferentialEvolution, MoveKind::Surrogate];

    /// The name used in the chain and in tables.
    pub fn name(self) -> &'static str {
        match self {
            MoveKind::Stretch => "stretch",
            MoveKind::DifferentialEvolution => "differential-evolution",
            MoveKind::Surrogate => "surrogate",
        }
    }
}

/// A walker at a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Which of the independent ensembles, from 0.
    pub ensemble: usize,
    /// The step; step 0 is the start.
    pub step: usize,
    /// Which walker of the ensemble, from 0.
    pub walker: usize,
    /// Whether the position is new at this step (true for every walker of step 0).
    pub accepted: bool,
    /// Log-probability of the position, in physical coordinates; always finite.
    pub log_prob: f64,
    /// The position, in physical coordinates, in the order of the names.
    pub theta: Vec<f64>,
    /// Spottedness of the reconstruction at the position.
    pub spottedness: f64,
    /// chi2 of the reconstruction at the position.
    pub chi2: f64,
    /// How the evaluation of the position ended.
    pub status: Status,
    /// How the evaluation of this step's proposal ended, accepted or not.
    pub proposed: Status,
    /// Applications of the response that the evaluation of this step's proposal took.
    pub passes: u32,
    /// How this step's proposal was made; `None` at step 0.
    pub by: Option<MoveKind>,
}

/// What every step of a chain looks like: names of the parameters, number of ensembles, walkers of each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Names of the parameters, in the order of every vector.
    pub names: Vec<String>,
    /// Number of independent ensembles.
    pub ensembles: usize,
    /// Walkers of an ensemble.
    pub walkers: usize,
}

impl Shape {
    /// Lines of one step.
    pub fn size(&self) -> usize {
        self.ensembles * self.walkers
    }

    /// Checks that `record` is line `index` of a chain (counted from 0; order: step, ensemble, walker) and whole.
    ///
    /// # Errors
    /// [`ChainError::Order`], [`ChainError::Dimension`] or [`ChainError::NotFinite`].
    pub fn check(&self, index: usize, record: &Record) -> Result<(), ChainError> {
        let step = index / self.size();
        let (ensemble, walker) = (index % self.size() / self.walkers, index % self.walkers);
        if (record.step, record.ensemble, record.walker) != (step, ensemble, walker) {
            return Err(ChainError::Order {
                expected: [step, ensemble, walker],
                found: [record.step, record.ensemble, record.walker],
            });
        }
        if record.theta.len() != self.names.len() {
            return Err(ChainError::Dimension { expected: self.names.len(), found: record.theta.len() });
        }
        let derived = [("log_prob", record.log_prob), ("spottedness", record.spottedness), ("chi2", record.chi2)];
        let parameters = self.names.iter().map(String::as_str).zip(record.theta.iter().copied());
        match parameters.chain(derived).find(|(_, value)| !value.is_finite()) {
            Some((name, _)) => Err(ChainError::NotFinite { name: name.to_owned(), step, ensemble, walker }),
            None => Ok(()),
        }
    }
}
