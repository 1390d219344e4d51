//! One line of a chain: the position of a walker of an ensemble at a step, and the result of its proposal.
//!
//! The sampler makes these, the journal writes them and the store keeps them; this file is independent of all three.

use crate::sampling::chain::ChainError;
use crate::sampling::log_density::{LogDensity, Status};
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
    /// Index of the independent ensemble, from 0.
    pub ensemble: usize,
    /// The step; step 0 is the start.
    pub step: usize,
    /// Index of the walker in the ensemble, from 0.
    pub walker: usize,
    /// Whether the position is new at this step (true for every walker of step 0).
    pub accepted: bool,
    /// Log-probability of the position, in physical coordinates; always finite.
    pub log_prob: f64,
    /// The position, in physical coordinates, in the order of the names.
    pub theta: Vec<f64>,
    /// Other values of the evaluation, in the order of their names.
    pub numbers: Vec<f64>,
    /// How the evaluation of the position ended.
    pub status: Status,
    /// How the evaluation of this step's proposal ended, accepted or not.
    pub proposed: Status,
    /// Applications of the model in the evaluation of this step's proposal.
    pub model_applications: u32,
    /// How this step's proposal was made; `None` at step 0.
    pub by: Option<MoveKind>,
}

/// The shape of every step of a chain: names of the parameters and of the other values, number of ensembles, walkers of
/// each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Names of the parameters, in the order of every vector.
    pub names: Vec<String>,
    /// Names of the other values.
    pub numbers: Vec<String>,
    /// Number of independent ensembles.
    pub ensembles: usize,
    /// Walkers of an ensemble.
    pub walkers: usize,
}

impl Shape {
    /// The shape of a chain of `density`.
    pub fn of(density: &dyn LogDensity, ensembles: usize, walkers: usize) -> Self {
        let numbers = density.number_names().iter().map(|name| (*name).to_owned()).collect();
        Shape { names: density.names().to_vec(), numbers, ensembles, walkers }
    }

    /// Lines of one step.
    pub fn size(&self) -> usize {
        self.ensembles * self.walkers
    }

    /// Parameters and other values of a record, by name.
    fn named<'a>(&'a self, record: &'a Record) -> impl Iterator<Item = (&'a str, &'a f64)> {
        let values = record.theta.iter().chain(&record.numbers);
        self.names.iter().chain(&self.numbers).map(String::as_str).zip(values)
    }

    /// Checks that `record` is line `index` of a chain (counted from 0; order: step, ensemble, walker) and complete.
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
        for (names, values) in [(&self.names, &record.theta), (&self.numbers, &record.numbers)] {
            if values.len() != names.len() {
                return Err(ChainError::Dimension { expected: names.len(), found: values.len() });
            }
        }
        let log_prob = [("log_prob", &record.log_prob)];
        match self.named(record).chain(log_prob).find(|(_, value)| !value.is_finite()) {
            Some((name, _)) => Err(ChainError::NotFinite { name: name.to_owned(), step, ensemble, walker }),
            None => Ok(()),
        }
    }
}
