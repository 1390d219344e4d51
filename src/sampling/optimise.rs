//! The maximum of a log-density and its curvature: a trust-region Newton method (argmin; Nocedal & Wright 2006, chapter
//! 4) in scaled sampling coordinates, with Hessians from differences of gradients. A coordinate at its bound is fixed
//! there, while the others continue.
//!
//! Depends only on [`Gradient`].

use crate::numerics::once;
use crate::sampling::log_density::{Evaluation, Gradient};
use argmin::core::{
    CostFunction, Error, Executor, Gradient as ArgminGradient, Hessian, IterState, KV, Problem, Solver, State,
    TerminationReason, TerminationStatus,
};
use argmin::solver::trustregion::{Steihaug, TrustRegion};
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

type Vector = DVector<f64>;
type Matrix = DMatrix<f64>;

/// A local maximum.
#[derive(Clone, Debug)]
pub struct Optimum {
    /// The point, in physical coordinates.
    pub theta: Vec<f64>,
    /// The evaluation there.
    pub evaluation: Evaluation,
    /// Minus the Hessian of the log-probability in sampling coordinates.
    pub curvature: Matrix,
    /// Inverse of the curvature. Unconstrained directions (curvature not positive) get a large variance instead.
    pub covariance: Matrix,
    /// The covariance in physical coordinates, to first order.
    pub written_covariance: Matrix,
    /// Whether the curvature is positive definite: a proper maximum, not an edge or a saddle.
    pub well_defined: bool,
    /// Whether the search met its tolerance.
    pub converged: bool,
    /// Evaluations of the density, including those for gradients.
    pub evaluations: usize,
    /// Trust-region steps.
    pub iterations: u64,
}

/// Why a search failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OptimiseError {
    /// The density is zero where the search starts.
    #[error("the log-probability at the start is minus infinity ({0:?})")]
    Start(crate::sampling::log_density::Status),
    /// The optimiser itself failed.
    #[error("the optimiser stopped: {0}")]
    Solver(String),
}

/// Largest number of trust-region steps.
const ITERATIONS: u64 = 25;

/// A search ends when a Newton step would gain less than this in log-probability.
const GAIN: f64 = 2e-3;

/// Step of differences of gradients, in natural scales of the coordinate.
const HESSIAN_STEP: f64 = 0.25;

/// Directions in which the curvature is less than this, in units of 1 / (natural scale)^2, count as unconstrained.
const OPEN_CURVATURE: f64 = 1e-3;

/// Climbs from `start` (physical coordinates) to a local maximum of `density`; `tick` is called at every evaluation.
///
/// # Errors
/// If the log-probability at the start is minus infinity.
pub fn climb<D: Gradient>(density: &D, start: &[f64], tick: &(dyn Fn() + Sync)) -> Result<Optimum, OptimiseError> {
    let scales = density.scales();
    let scaled = |((low, high), scale): ((f64, f64), &f64)| (low / scale, high / scale);
    let bounds = density.bounds().into_iter().zip(&scales).map(scaled).collect();
    let landscape = Landscape { density, scales, bounds, evaluations: AtomicUsize::new(0), tick };
    let first = landscape.evaluate(start);
    if first.log_prob == f64::NEG_INFINITY {
        return Err(OptimiseError::Start(first.status));
    }
    let solver = Patient(
        TrustRegion::new(Steihaug::new().with_max_iters(3 * start.len() as u64))
            .with_radius(2.0)
            .and_then(|solver| solver.with_max_radius(50.0))
            .map_err(|e| OptimiseError::Solver(e.to_string()))?,
    );
    let x = landscape.scaled(start);
    let result = Executor::new(&landscape, solver)
        .configure(|state| state.param(x).cost(-first.log_prob).max_iters(ITERATIONS))
        .run()
        .map_err(|e| OptimiseError::Solver(e.to_string()))?;
    let state = result.state;
    let (Some(x), Some(hessian)) = (state.get_param(), state.get_hessian()) else {
        return Err(OptimiseError::Solver("no point was kept".into()));
    };
    // including coordinates on their bounds, as if free
    let hessian = &if landscape.on_bounds(x) { landscape.bend(x) } else { hessian.clone() };
    let theta = landscape.written(x);
    let covariance = bounded_inverse(hessian);
    let unscale = Matrix::from_diagonal(&Vector::from_column_slice(&landscape.scales));
    let rescale = unscale.map_diagonal(|s| 1.0 / s);
    let rescale = Matrix::from_diagonal(&rescale);
    let covariance = &unscale * covariance * &unscale;
    let jacobian = landscape.jacobian(&theta);
    Ok(Optimum {
        evaluation: landscape.evaluate(&theta),
        curvature: &rescale * hessian * &rescale,
        written_covariance: symmetric(&(&jacobian * &covariance * jacobian.transpose())),
        covariance,
        well_defined: Cholesky::new(hessian.clone()).is_some(),
        converged: matches!(
            state.get_termination_status(),
            TerminationStatus::Terminated(TerminationReason::SolverConverged)
        ),
        evaluations: landscape.evaluations.load(Ordering::Relaxed),
        iterations: state.get_iter(),
        theta,
    })
}

fn symmetric(matrix: &Matrix) -> Matrix {
    0.5 * (matrix + matrix.transpose())
}

/// Inverse of a symmetric matrix, symmetric to the last bit, its eigenvalues kept above [`OPEN_CURVATURE`].
fn bounded_inverse(hessian: &Matrix) -> Matrix {
    let eigen = SymmetricEigen::new(hessian.clone());
    let inverse = eigen.eigenvalues.map(|e| 1.0 / e.max(OPEN_CURVATURE));
    symmetric(&(&eigen.eigenvectors * Matrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose()))
}

/// Minus the log-density over scaled sampling coordinates, for argmin.
struct Landscape<'a, D: Gradient> {
    density: &'a D,
    scales: Vec<f64>,
    bounds: Vec<(f64, f64)>,
    evaluations: AtomicUsize,
    tick: &'a (dyn Fn() + Sync),
}

impl<D: Gradient> Landscape<'_, D> {
    fn count(&self) {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        (self.tick)();
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.count();
        self.density.evaluate(theta)
    }

    fn scaled(&self, theta: &[f64]) -> Vector {
        let internal = self.density.to_sampling(theta);
        Vector::from_iterator(theta.len(), internal.iter().zip(&self.scales).map(|(x, s)| x / s))
    }

    /// The nearest point within the bounds.
    fn inside(&self, x: &Vector) -> Vector {
        Vector::from_iterator(x.len(), x.iter().zip(&self.bounds).map(|(x, (low, high))| x.clamp(*low, *high)))
    }

    /// Whether a coordinate is on its bound, or beyond.
    fn on_bounds(&self, x: &Vector) -> bool {
        x.iter().zip(&self.bounds).any(|(x, (low, high))| x <= low || x >= high)
    }

    /// Whether the cost falls outwards in coordinate j, which is on its bound.
    fn is_pressed(&self, j: usize, x: &Vector, slope: &Vector) -> bool {
        let (low, high) = self.bounds[j];
        (x[j] <= low && slope[j] > 0.0) || (x[j] >= high && slope[j] < 0.0)
    }

    /// The cost at the nearest point within the bounds.
    fn written(&self, x: &Vector) -> Vec<f64> {
        let internal: Vec<f64> = self.inside(x).iter().zip(&self.scales).map(|(x, s)| x * s).collect();
        self.density.to_physical(&internal)
    }

    /// Gradient of the cost; `None` where the density is zero.
    fn slope(&self, x: &Vector) -> Option<Vector> {
        self.count();
        let (_, gradient) = self.density.evaluate_with_gradient(&self.written(x));
        if gradient.is_empty() || gradient.iter().any(|g| !g.is_finite()) {
            return None;
        }
        Some(Vector::from_iterator(x.len(), gradient.iter().zip(&self.scales).map(|(g, s)| -g * s)))
    }

    /// Hessian of the cost, by differences of gradients.
    fn bend(&self, x: &Vector) -> Matrix {
        let x = &self.inside(x);
        let at = |j: usize, h: f64| {
            let mut shifted = x.clone();
            shifted[j] += h;
            let shifted = self.inside(&shifted);
            (shifted[j] != x[j]).then(|| Some((shifted[j] - x[j], self.slope(&shifted)?))).flatten()
        };
        let here = std::sync::OnceLock::new();
        let columns: Vec<Vector> = (0..x.len())
            .into_par_iter()
            .map(|j| {
                let middle = || once::found(&here, || self.slope(x).unwrap_or_else(|| Vector::zeros(x.len()))).clone();
                match (at(j, HESSIAN_STEP), at(j, -HESSIAN_STEP)) {
                    (Some((h, plus)), Some((back, minus))) => (plus - minus) / (h - back),
                    (Some((h, there)), None) | (None, Some((h, there))) => (there - middle()) / h,
                    (None, None) => Vector::zeros(x.len()),
                }
            })
            .collect();
        symmetric(&Matrix::from_columns(&columns))
    }

    /// d(written) / d(internal), by differences that respect periodic coordinates.
    fn jacobian(&self, theta: &[f64]) -> Matrix {
        let internal = self.density.to_sampling(theta);
        let mut jacobian = Matrix::zeros(theta.len(), theta.len());
        for j in 0..theta.len() {
            let h = 1e-4 * self.scales[j];
            let shifted = |h: f64| {
                let mut x = internal.clone();
                x[j] += h;
                self.density.to_physical(&x)
            };
            for (i, (plus, minus)) in shifted(h).into_iter().zip(shifted(-h)).enumerate() {
                let difference = plus - minus;
                // only a coordinate of period 1 can change that much
                let wrapped = if difference.abs() > 0.5 { difference - difference.round() } else { difference };
                jacobian[(i, j)] = wrapped / (2.0 * h);
            }
        }
        jacobian
    }
}

impl<D: Gradient> CostFunction for &Landscape<'_, D> {
    type Param = Vector;
    type Output = f64;
    fn cost(&self, x: &Vector) -> Result<f64, Error> {
        Ok(-self.evaluate(&self.written(x)).log_prob)
    }
}

impl<D: Gradient> ArgminGradient for &Landscape<'_, D> {
    type Param = Vector;
    type Gradient = Vector;
    fn gradient(&self, x: &Vector) -> Result<Vector, Error> {
        let slope = self.slope(x).unwrap_or_else(|| Vector::zeros(x.len()));
        let free = |j, _| if self.is_pressed(j, x, &slope) { 0.0 } else { slope[j] };
        Ok(Vector::from_fn(x.len(), free))
    }
}

impl<D: Gradient> Hessian for &Landscape<'_, D> {
    type Param = Vector;
    type Hessian = Matrix;
    fn hessian(&self, x: &Vector) -> Result<Matrix, Error> {
        let mut hessian = self.bend(x);
        if let Some(slope) = self.on_bounds(x).then(|| self.slope(x)).flatten() {
            for j in (0..x.len()).filter(|j| self.is_pressed(*j, x, &slope)) {
                hessian.column_mut(j).fill(0.0);
                hessian.row_mut(j).fill(0.0);
                hessian[(j, j)] = 1.0;
            }
        }
        Ok(hessian)
    }
}

/// argmin's trust region with a stopping criterion: it stops when the predicted gain is negligible.
#[derive(Clone)]
struct Patient<S>(S);

impl<O, S> Solver<O, IterState<Vector, Vector, (), Matrix, (), f64>> for Patient<S>
where
    S: Solver<O, IterState<Vector, Vector, (), Matrix, (), f64>>,
{
    fn name(&self) -> &str {
        self.0.name()
    }

    fn init(
        &mut self,
        problem: &mut Problem<O>,
        state: IterState<Vector, Vector, (), Matrix, (), f64>,
    ) -> Result<(IterState<Vector, Vector, (), Matrix, (), f64>, Option<KV>), Error> {
        self.0.init(problem, state)
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<O>,
        state: IterState<Vector, Vector, (), Matrix, (), f64>,
    ) -> Result<(IterState<Vector, Vector, (), Matrix, (), f64>, Option<KV>), Error> {
        self.0.next_iter(problem, state)
    }

    fn terminate(&mut self, state: &IterState<Vector, Vector, (), Matrix, (), f64>) -> TerminationStatus {
        let gain = state.get_gradient().zip(state.get_hessian()).and_then(|(gradient, hessian)| {
            let step = Cholesky::new(hessian.clone())?.solve(gradient);
            Some(0.5 * gradient.dot(&step))
        });
        match gain {
            Some(gain) if gain < GAIN => TerminationStatus::Terminated(TerminationReason::SolverConverged),
            _ => TerminationStatus::NotTerminated,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::log_density::{LogDensity, Status};

    /// A curved valley within bounds: ln p = -(1 - a)^2 / 2 - 2 (b - a^2)^2.
    struct Rosenbrock(Vec<String>, [(f64, f64); 2]);

    const OPEN: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

    impl LogDensity for Rosenbrock {
        fn names(&self) -> &[String] {
            &self.0
        }
        fn evaluate(&self, x: &[f64]) -> Evaluation {
            if x.iter().zip(&self.1).any(|(x, (low, high))| x < low || x > high) {
                return Evaluation::rejected(Status::OutsidePrior);
            }
            Evaluation::of(-0.5 * (1.0 - x[0]).powi(2) - 2.0 * (x[1] - x[0] * x[0]).powi(2))
        }
    }

    impl Gradient for Rosenbrock {
        fn evaluate_with_gradient(&self, x: &[f64]) -> (Evaluation, Vec<f64>) {
            let across = x[1] - x[0] * x[0];
            (self.evaluate(x), vec![1.0 - x[0] + 8.0 * across * x[0], -4.0 * across])
        }
        fn scales(&self) -> Vec<f64> {
            vec![0.1, 0.1]
        }
        fn bounds(&self) -> Vec<(f64, f64)> {
            self.1.to_vec()
        }
    }

    #[test]
    fn finds_the_maximum_and_its_covariance() {
        let density = Rosenbrock(vec!["a".into(), "b".into()], [OPEN; 2]);
        let optimum = climb(&density, &[-1.2, 1.0], &|| ()).unwrap();
        assert!(optimum.converged && optimum.well_defined);
        assert!((optimum.theta[0] - 1.0).abs() < 0.07 && (optimum.theta[1] - 1.0).abs() < 0.14, "{optimum:?}");
        // curvature at (1, 1) is [[17, -8], [-8, 4]]: variances 1 and 4.25; the search may end 0.06 sigma away, in a
        // curved valley
        assert!((optimum.covariance[(0, 0)] - 1.0).abs() < 0.4, "{}", optimum.covariance);
        assert!((optimum.covariance[(1, 1)] - 4.25).abs() < 1.0);
    }

    /// From the bound, from inside, and where the path follows the bound and leaves it again.
    #[test]
    fn what_is_pressed_against_a_bound_is_held_there_while_the_rest_goes_on() {
        let density = Rosenbrock(vec!["a".into(), "b".into()], [OPEN, (-1.0, 0.25)]);
        for start in [[-1.2, 0.25], [0.0, 0.0], [1.5, 0.25]] {
            let optimum = climb(&density, &start, &|| ()).unwrap();
            assert!(optimum.converged, "{optimum:?}");
            // 1 + a = 8 a^3
            assert!((optimum.theta[0] - 0.5827).abs() < 0.03 && optimum.theta[1] == 0.25, "{optimum:?}");
            // the curvature is that of both: [[12 a^2 + ..], [4]]
            assert!((optimum.curvature[(1, 1)] - 4.0).abs() < 0.1, "{}", optimum.curvature);
        }
        let density = Rosenbrock(vec!["a".into(), "b".into()], [OPEN, (0.2, 9.0)]);
        let optimum = climb(&density, &[0.1, 0.2], &|| ()).unwrap();
        assert!(optimum.converged && (optimum.theta[0] - 1.0).abs() < 0.07, "{optimum:?}");
    }
}
