//! What the solver is asked and what it answers: goal, precision, start, image, and why it stopped.

use super::entropy::Entropy;

/// What to solve for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// The image at this Lagrange multiplier.
    Lambda(f64),
    /// The image at this chi2; where that takes more than `largest_lambda`, the image at that lambda.
    Chi2 {
        /// Target of chi2.
        target: f64,
        /// Bound of the Lagrange multiplier.
        largest_lambda: f64,
    },
}

/// Precision and effort.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings {
    /// Error allowed in `S/lambda - chi2/2`, or in the chi2/2 that spottedness is worth where chi2 is the goal: by the
    /// solver's estimate, which is no bound (`results/performance.md`: up to six times it over the bulk of a
    /// posterior).
    pub tolerance: f64,
    /// Error allowed besides far below the best solution, over the distance to it: a chain never sees it, and a
    /// landscape shows it as a small part of its depth.
    pub leniency: f64,
    /// Residual of the Newton systems over their right-hand side, before a last step that takes no pass; from 3e-3 on
    /// they are solved in single precision, below in double precision for numbers that are in single precision.
    pub cg_tolerance: f64,
    /// Most iterations of conjugate gradients for one Newton system.
    pub cg_iterations: usize,
    /// Most Newton steps.
    pub newton_steps: usize,
}

impl Default for SolverSettings {
    fn default() -> Self {
        SolverSettings { tolerance: 5e-5, leniency: 0.005, cg_tolerance: 0.08, cg_iterations: 40, newton_steps: 60 }
    }
}

/// Solutions this far below the best, in units of log-likelihood, are granted half of [`SolverSettings::leniency`],
/// those within a quarter of it next to nothing.
const LENIENT_FROM: f64 = 40.0;

impl SolverSettings {
    /// The error allowed to a solution that is `drop` below the best in log-likelihood.
    pub fn tolerance_at(&self, drop: f64) -> f64 {
        let far = (drop.max(0.0) / LENIENT_FROM).powi(4);
        self.tolerance + self.leniency * drop.max(0.0) * far / (1.0 + far)
    }

    /// As many iterations as it takes: for systems that the preconditioner is not made for.
    pub fn patient() -> Self {
        SolverSettings { cg_iterations: 300, ..SolverSettings::default() }
    }

    /// To rounding error rather than to what a chain needs: for references and tests.
    pub fn exact() -> Self {
        SolverSettings { tolerance: 1e-9, leniency: 0.0, cg_tolerance: 1e-3, ..SolverSettings::patient() }
    }
}

/// Why the solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// The goal was met.
    Converged,
    /// The target chi2 takes a lambda beyond the bound; the image is the one at the bound.
    Unreachable,
    /// The number of Newton steps ran out.
    StepLimit,
    /// A number that is not finite appeared.
    NonFinite,
}

/// An image where the solver starts or stops: coordinates of its pixels and the Lagrange multiplier.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Coordinate of every pixel, as its entropy has it.
    pub coordinates: Vec<f64>,
    /// Lagrange multiplier of chi2/2.
    pub lambda: f64,
}

/// Where the solver starts.
#[derive(Clone, Debug)]
pub struct Start {
    /// Image and lambda.
    pub image: Image,
    /// A guess of `dz / d ln(lambda)` in the entropy's metric, which saves model applications where it is good; empty
    /// for none. With an adjoint it is taken for that of a solution near by, and not solved for again in the first
    /// steps.
    pub path: Vec<f32>,
    /// A guess of `d chi2 / d ln(lambda)` to go with it.
    pub chi2_slope: f64,
    /// The adjoint of spottedness at fixed chi2: how much of it a residual of the Newton system is worth. In the
    /// entropy's metric, over the scale of the metric. Empty for none: then what is left of spottedness when the solver
    /// stops is not forecast.
    pub adjoint: Vec<f32>,
    /// The best solution there is, so that effort is spared far below it; none to be precise everywhere.
    pub best: Option<Best>,
}

/// The best solution of a family of problems: what others are compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Best {
    /// Its spottedness.
    pub spottedness: f64,
    /// Its `S/lambda - chi2/2`.
    pub merit: f64,
}

impl Start {
    /// An image without data: every pixel at the default, and a lambda for which data begin to matter.
    pub fn blank(entropy: &Entropy, pixels: usize, lambda: f64) -> Self {
        Start {
            image: Image { coordinates: vec![entropy.default_coordinate(); pixels], lambda },
            path: Vec::new(),
            chi2_slope: 0.0,
            adjoint: Vec::new(),
            best: None,
        }
    }
}

/// What the solver found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Why it stopped.
    pub termination: Termination,
    /// The image.
    pub image: Image,
    /// chi2 of the image.
    pub chi2: f64,
    /// Entropy of the image.
    pub entropy: f64,
    /// Spottedness, as its entropy has it.
    pub spottedness: f64,
    /// First-order forecast of what spottedness has still to change at this chi2, from the start's adjoint.
    pub spottedness_left: f64,
    /// `d chi2 / d ln(lambda)` along `path` (0 if the goal was a lambda).
    pub chi2_slope: f64,
    /// `d spottedness / d ln(lambda)` along `path` (0 if the goal was a lambda).
    pub spottedness_slope: f64,
    /// `dz / d ln(lambda)`: that of the start if it came with one and an adjoint, or if there was no step; else as last
    /// computed, before the last step, in the entropy's metric there. Where `find_path` was asked, as it is at the
    /// image. Of no meaning if the goal was a lambda.
    pub path: Vec<f32>,
    /// Newton steps taken.
    pub newton_steps: usize,
}
