//! The values at the nodes, in the order of the grid.

use super::grid::Grid;
use crate::sampling::log_density::{Evaluation, Status};

/// A node with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Index of the node in the grid.
    pub index: usize,
    /// Its coordinates, in the order of the axes.
    pub theta: Vec<f64>,
    /// ln L there, and other values.
    pub evaluation: Evaluation,
}

/// A likelihood grid, perhaps unfinished: the values at the first nodes of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Landscape {
    grid: Grid,
    numbers: Vec<String>,
    nodes: Vec<Node>,
}

/// A node that is not the next one of a likelihood grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LandscapeError {
    /// The grid has no more nodes.
    #[error("the grid has no more than {0} nodes")]
    Full(usize),
    /// It is another node.
    #[error("expected node {expected} but found node {found}")]
    Order {
        /// The next node.
        expected: usize,
        /// The node found.
        found: usize,
    },
    /// Its coordinates differ.
    #[error("node {index} is at {expected:?}, not at {found:?}")]
    Place {
        /// The node.
        index: usize,
        /// Its coordinates by the grid.
        expected: Vec<f64>,
        /// The coordinates found.
        found: Vec<f64>,
    },
    /// Its status and its values contradict each other.
    #[error("node {index} has the status {status:?}, which does not go with its values")]
    Values {
        /// The node.
        index: usize,
        /// The status.
        status: Status,
    },
}

impl Landscape {
    /// A likelihood grid without values, for ln L and `numbers` with these names.
    pub fn new(grid: Grid, numbers: Vec<String>) -> Self {
        Landscape { grid, numbers, nodes: Vec::new() }
    }

    /// Adds the next node.
    ///
    /// # Errors
    /// [`LandscapeError`] when it is not the next one, or its values are incomplete.
    pub fn push(&mut self, node: Node) -> Result<(), LandscapeError> {
        let expected = self.nodes.len();
        if expected == self.grid.len() {
            return Err(LandscapeError::Full(expected));
        }
        if node.index != expected {
            return Err(LandscapeError::Order { expected, found: node.index });
        }
        let theta = self.grid.theta(expected);
        if node.theta != theta {
            return Err(LandscapeError::Place { index: expected, expected: theta, found: node.theta });
        }
        let status = node.evaluation.status;
        let failed = status.is_failure() || status == Status::OutsidePrior;
        let is_whole = node.evaluation.is_finite() && node.evaluation.numbers.len() == self.numbers.len();
        if is_whole == failed {
            return Err(LandscapeError::Values { index: expected, status });
        }
        self.nodes.push(node);
        Ok(())
    }

    /// The grid of nodes.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Names of the values besides ln L.
    pub fn numbers(&self) -> &[String] {
        &self.numbers
    }

    /// The value of that name at a node.
    pub fn number(&self, node: &Node, name: &str) -> Option<f64> {
        let place = self.numbers.iter().position(|number| number == name)?;
        node.evaluation.numbers.get(place).copied()
    }

    /// The nodes so far, in order.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Whether every node of the grid has been evaluated.
    pub fn is_whole(&self) -> bool {
        self.nodes.len() == self.grid.len()
    }

    /// The nodes with a value.
    pub fn valued(&self) -> impl Iterator<Item = &Node> {
        self.nodes.iter().filter(|node| node.evaluation.log_prob.is_finite())
    }

    /// The node of the largest ln L (the first of equals); `None` if there is none with a value.
    pub fn best(&self) -> Option<&Node> {
        self.valued().reduce(|best, node| if node.evaluation.log_prob > best.evaluation.log_prob { node } else { best })
    }

    /// Number of nodes whose evaluation ended with that status.
    pub fn count(&self, is: impl Fn(Status) -> bool) -> usize {
        self.nodes.iter().filter(|node| is(node.evaluation.status)).count()
    }

    /// Median number of model applications of those evaluations that were begun (the upper one of two); 0 without any.
    pub fn model_applications_median(&self) -> u32 {
        let all = self.nodes.iter().map(|node| node.evaluation.model_applications);
        let mut counts: Vec<u32> = all.filter(|count| *count > 0).collect();
        counts.sort_unstable();
        counts.get(counts.len() / 2).copied().unwrap_or(0)
    }
}
