//! A chain in memory: every ensemble, step and walker, by whole steps.
//!
//! Values lie in the order of the journal (step, ensemble, walker). Step 0 is the start, so a chain of `n` steps holds
//! steps 0 to n - 1.

use crate::sampling::chain::{ChainError, Record, Shape};
use crate::sampling::log_density::Status;

/// A chain of whole steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    shape: Shape,
    records: Vec<Record>,
}

/// The values of one quantity, `[ensemble][walker][step]`.
pub type Series = Vec<Vec<Vec<f64>>>;

impl Chain {
    /// A chain without steps.
    ///
    /// # Panics
    /// If the shape has no ensemble or no walker (a programming error: settings are validated before).
    #[doc(hidden)]
    pub fn new(shape: Shape) -> Self {
        assert!(shape.size() > 0, "a chain needs at least one ensemble and one walker");
        Chain { shape, records: Vec::new() }
    }

    /// Names, number of ensembles and of walkers.
    #[doc(hidden)]
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Names of the parameters.
    pub fn names(&self) -> &[String] {
        &self.shape.names
    }

    /// Number of steps held, including the start (step 0).
    pub fn steps(&self) -> usize {
        self.records.len() / self.shape.size()
    }

    /// Adds the next step.
    ///
    /// # Errors
    /// [`ChainError`] when the records are not exactly the next step in order, and complete; nothing is added then.
    #[doc(hidden)]
    pub fn push_step(&mut self, step: &[Record]) -> Result<(), ChainError> {
        if step.len() != self.shape.size() {
            return Err(ChainError::StepSize { expected: self.shape.size(), found: step.len() });
        }
        let first = self.records.len();
        for (index, record) in step.iter().enumerate() {
            self.shape.check(first + index, record)?;
        }
        self.records.extend_from_slice(step);
        Ok(())
    }

    /// All records, in the order step, ensemble, walker.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The records of one step; `None` beyond the end.
    pub fn step(&self, step: usize) -> Option<&[Record]> {
        self.records.chunks_exact(self.shape.size()).nth(step)
    }

    /// The records of the last step; `None` for an empty chain.
    #[doc(hidden)]
    pub fn last_step(&self) -> Option<&[Record]> {
        self.steps().checked_sub(1).and_then(|last| self.step(last))
    }

    /// Values of any quantity from step `discard` on.
    #[doc(hidden)]
    pub fn series_of(&self, discard: usize, quantity: impl Fn(&Record) -> f64) -> Series {
        let Shape { ensembles, walkers, .. } = self.shape;
        let kept = self.steps().saturating_sub(discard);
        let mut series = vec![vec![Vec::with_capacity(kept); walkers]; ensembles];
        for record in self.records.iter().skip(discard * self.shape.size()) {
            series[record.ensemble][record.walker].push(quantity(record));
        }
        series
    }

    /// Values of one parameter from step `discard` on.
    pub fn series(&self, parameter: usize, discard: usize) -> Series {
        self.series_of(discard, |record| record.theta[parameter])
    }

    /// The record of the highest log-probability (the first of equals); `None` for an empty chain.
    pub fn best(&self) -> Option<&Record> {
        self.records.iter().reduce(|best, record| if record.log_prob > best.log_prob { record } else { best })
    }

    /// Number of evaluations: proposals that were inside the prior, including the start.
    pub fn evaluations(&self) -> usize {
        self.records.iter().filter(|record| record.proposed != Status::OutsidePrior).count()
    }

    /// Number of evaluations that failed.
    pub fn failures(&self) -> usize {
        self.records.iter().filter(|record| record.proposed.is_failure()).count()
    }
}
