//! Input and output of the solver: goal, precision, start, image, and why it stopped.

use super::entropy::Entropy;

/// The goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// The image at this Lagrange multiplier.
    Lambda(f64),
    /// The image at this chi2; where that requires more than `largest_lambda`, the image at that lambda.
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
    /// Error allowed in `S/lambda - chi2/2`, or in the chi2/2 equivalent of spottedness where chi2 is the goal: by the
    /// solver's estimate, which is not a bound (`results/performance.md`: up to six times that over the bulk of a
    /// posterior).
    pub tolerance: f64,
    /// Additional error allowed far below the best solution, over the distance to it: it does not affect a chain, and
    /// is a small fraction of the depth of a likelihood grid.
    pub leniency: f64,
    /// Residual of the Newton systems over their right-hand side, before a last step without a pass; from 3e-3 on they
    /// are solved in single precision, below in double precision with single-precision input.
    pub cg_tolerance: f64,
    /// Largest number of iterations of conjugate gradients for one Newton system.
    pub cg_iterations: usize,
    /// Largest number of Newton steps.
    pub newton_steps: usize,
}

impl Default for SolverSettings {
    fn default() -> Self {
        SolverSettings { tolerance: 5e-5, leniency: 0.005, cg_tolerance: 0.08, cg_iterations: 40, newton_steps: 60 }
    }
}

/// Solutions this far below the best, in units of log-likelihood, are allowed half of [`SolverSettings::leniency`],
/// those within a quarter of this almost nothing.
const LENIENT_FROM: f64 = 40.0;

impl SolverSettings {
    /// The error allowed to a solution that is `drop` below the best in log-likelihood.
    pub fn tolerance_at(&self, drop: f64) -> f64 {
        let far = (drop.max(0.0) / LENIENT_FROM).powi(4);
        self.tolerance + self.leniency * drop.max(0.0) * far / (1.0 + far)
    }

    /// Practically unlimited iterations: for systems that the preconditioner does not fit.
    pub fn patient() -> Self {
        SolverSettings { cg_iterations: 300, ..SolverSettings::default() }
    }

    /// To rounding error rather than to the precision of a chain: for references and tests.
    pub fn exact() -> Self {
        SolverSettings { tolerance: 1e-9, leniency: 0.0, cg_tolerance: 1e-3, ..SolverSettings::patient() }
    }
}

/// Why the solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Termination {
    /// The goal was met.
    Converged,
    /// The target chi2 requires a lambda beyond the bound; the image is the one at the bound.
    Unreachable,
    /// The number of Newton steps is exhausted.
    StepLimit,
    /// A number that is not finite appeared.
    NonFinite,
}

/// An image where the solver starts or stops: coordinates of its pixels and the Lagrange multiplier.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Coordinate of every pixel, as defined by its entropy.
    pub coordinates: Vec<f64>,
    /// Lagrange multiplier of chi2/2.
    pub lambda: f64,
}

/// Where the solver starts.
#[derive(Clone, Debug)]
pub struct Start {
    /// Image and lambda.
    pub image: Image,
    /// A guess of `dz / d ln(lambda)` in the entropy's metric, which saves model applications if accurate; empty for
    /// none. With an adjoint it counts as that of a nearby solution, and is not solved for again in the first steps.
    pub path: Vec<f32>,
    /// A guess of `d chi2 / d ln(lambda)` to go with it.
    pub chi2_slope: f64,
    /// The adjoint of spottedness at fixed chi2: its change per residual of the Newton system. In the entropy's metric,
    /// over the scale of the metric. Empty for none: then the remaining change of spottedness is not forecast.
    pub adjoint: Vec<f32>,
    /// The best known solution, to save effort far below it; none for full precision everywhere.
    pub best: Option<Best>,
}

/// The best solution of a family of problems: the reference for others.
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
    /// Spottedness, as defined by its entropy.
    pub spottedness: f64,
    /// First-order forecast of the remaining change of spottedness at this chi2, from the start's adjoint.
    pub spottedness_left: f64,
    /// `d chi2 / d ln(lambda)` along `path` (0 if the goal was a lambda).
    pub chi2_slope: f64,
    /// `d spottedness / d ln(lambda)` along `path` (0 if the goal was a lambda).
    pub spottedness_slope: f64,
    /// `dz / d ln(lambda)`: that of the start if it came with one and an adjoint, or if there was no step; else as last
    /// computed, before the last step, in the entropy's metric there. After `find_path`, that at the image. Meaningless
    /// if the goal was a lambda.
    pub path: Vec<f32>,
    /// Newton steps taken.
    pub newton_steps: usize,
}
