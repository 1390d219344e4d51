//! ln L of a reconstruction by the three objectives (`docs/method.md` section 3, step 3), without the prior.
//!
//! The posterior adds the prior; a likelihood grid shows ln L alone.

use super::posterior::{CHI2, Posterior, SPOTTEDNESS};
use super::tradeoff::Measure;
use crate::maxent::{Goal, Problem, Solution, Termination};
use crate::sampling::log_density::{Evaluation, Status};
use crate::surface::objective::ObjectiveKind;

/// A chi2 this many times the target is far from any fit.
const FAR: f64 = 1.05;

/// Names of the values beside ln L.
pub const NUMBERS: [&str; 4] = [SPOTTEDNESS, "entropy", CHI2, "lambda"];

impl Posterior {
    /// ln L at `theta` (physical coordinates), with the values [`NUMBERS`]. The log-probability there is that plus the
    /// logarithm of the prior.
    pub fn likelihood(&self, theta: &[f64]) -> Evaluation {
        if !self.is_physical(theta) {
            return Evaluation::rejected(Status::NonFinite);
        }
        let (solution, problem) = self.reconstruct(theta);
        let numbers = [self.spottedness(&solution), solution.entropy, solution.chi2, solution.image.lambda];
        self.judged(&solution, numbers.to_vec(), problem.model_applications())
    }

    /// ln L of a reconstruction with so many model applications, with the values `numbers`.
    pub(super) fn judged(&self, solution: &Solution, numbers: Vec<f64>, model_applications: u32) -> Evaluation {
        match self.judge(solution) {
            Ok((log_likelihood, status)) => {
                Evaluation { log_prob: log_likelihood, numbers, model_applications, status }
            }
            Err(status) => Evaluation { model_applications, ..Evaluation::rejected(status) },
        }
    }

    /// ln L of a reconstruction, and the derivative of chi2 on the trade-off curve with respect to its measure.
    pub(super) fn log_likelihood(&self, solution: &Solution) -> (f64, f64) {
        let measure = match self.kind() {
            ObjectiveKind::RegularisedLikelihood | ObjectiveKind::MarginalLikelihood => {
                let lambda = solution.image.lambda;
                return (solution.entropy / lambda - 0.5 * solution.chi2, 0.0);
            }
            ObjectiveKind::Spottedness => Measure::Spottedness,
            ObjectiveKind::Entropy => Measure::NegativeEntropy,
        };
        let target = self.reference().chi2_target;
        // where the target is out of reach, its misfit counts
        let (to_target, misfit) = match solution.termination {
            Termination::Converged => (target - solution.chi2, 0.0),
            _ => (0.0, solution.chi2 - target),
        };
        let value = match measure {
            Measure::Spottedness => self.spottedness(solution),
            Measure::NegativeEntropy => -solution.entropy - 0.5 * solution.image.lambda * to_target,
        };
        let (on_curve, slope) = self.reference().tradeoff.chi2_at(measure, value);
        (-0.5 * (target - on_curve + misfit), slope)
    }

    /// Spottedness of a reconstruction; at the target chi2 a first-order forecast of the solver's next steps (along the
    /// path alone where spottedness is not the objective).
    pub(super) fn spottedness(&self, solution: &Solution) -> f64 {
        match (self.goal(), solution.termination) {
            (Goal::Chi2 { target, .. }, Termination::Converged) => {
                let moved = (target - solution.chi2) * solution.spottedness_slope / solution.chi2_slope;
                solution.spottedness + moved + solution.spottedness_left
            }
            _ => solution.spottedness,
        }
    }

    /// ln L of a reconstruction and its status, or the status of its failure.
    fn judge(&self, solution: &Solution) -> Result<(f64, Status), Status> {
        let status = match solution.termination {
            Termination::Converged => Status::Converged,
            Termination::Unreachable => Status::Unreachable,
            Termination::StepLimit if solution.chi2 < FAR * self.reference().chi2_target => {
                return Err(Status::StoppedShort);
            }
            // a lower bound of the log-probability, sufficient where it is hundreds below the best
            Termination::StepLimit => Status::Unreachable,
            Termination::NonFinite => return Err(Status::NonFinite),
        };
        let log_likelihood = self.log_likelihood(solution).0;
        if log_likelihood.is_finite() { Ok((log_likelihood, status)) } else { Err(Status::NonFinite) }
    }
}
