//! A prediction of image and lambda from a known solution by their derivatives with each parameter (`docs/method.md`
//! section 2), to first or to second order.
//!
//! The solution moves with a parameter x as `H dz = -lambda dg/dx - lambda g dlnlambda`, with the last term set so that
//! chi2 stays at the target (or omitted at a fixed lambda). The residual is estimated from neighbouring solutions. The
//! prediction starts an evaluation and saves it a Newton step or two; the result does not depend on it beyond the
//! solver's tolerance.

use crate::maxent::{Goal, Image, Preconditioner, Problem, Solution, Solver, SolverSettings, Start};
use crate::model::ParameterSpace;
use crate::numerics::vector::linear::axpy;
use crate::star::Response;
use crate::surface::imaging::Imager;
use crate::surface::objective::ObjectiveKind;

/// Derivatives of a solution with respect to sampling coordinates.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Internal coordinates of the solution.
    origin: Vec<f64>,
    /// Its image, which would otherwise take a hundredth of each evaluation.
    map: Vec<f64>,
    /// Natural scales of the coordinates.
    scales: Vec<f64>,
    /// Image step per natural scale of each coordinate.
    image: Vec<Vec<f32>>,
    /// Change of ln(lambda) per natural scale of each coordinate.
    ln_lambda: Vec<f64>,
    /// Adjoint of spottedness at fixed chi2, as [`Start::adjoint`]; empty where spottedness is not used.
    adjoint: Vec<f32>,
    /// Second order, pair by pair of coordinates; empty where it is not known.
    bends: Vec<Bend>,
}

/// The residual of the first order, per product of two coordinates in natural scales.
#[derive(Clone, Debug)]
struct Bend {
    coordinates: [usize; 2],
    /// Change of the image's coordinates, followed by that of ln(lambda).
    change: Vec<f32>,
}

/// Step of numerical derivatives, as a fraction of a coordinate's natural scale.
const STEP: f64 = 0.05;

/// Predictions reach this many natural scales in any coordinate; beyond, they are constant.
const REACH: f64 = 3.0;

/// Distance of the solutions for the second order, in natural scales.
const BEND_STEP: f64 = 0.4;

/// The second order reaches no farther than this many natural scales: beyond, it costs model applications instead of
/// saving them.
const BEND_REACH: f64 = 1.5;

/// Largest change of a coordinate of the image by either order.
const LARGEST_STEP: f32 = 1.0;

/// A change of an image per natural scale beyond this is invalid.
const LARGEST_CHANGE: f32 = 1e30;

/// Largest predicted change of ln(lambda).
const LN_LAMBDA_REACH: f64 = 1.0;

/// A solution, its position, and its settings.
#[derive(Clone, Copy)]
pub struct Solved<'a> {
    /// Physical coordinates.
    pub theta: &'a [f64],
    /// The response there.
    pub response: &'a Response,
    /// The goal of the solver; at the bound of lambda, the image at that lambda.
    pub goal: Goal,
    /// The solution.
    pub solution: &'a Solution,
    /// Approximate inverse of the Newton system there.
    pub preconditioner: &'a Preconditioner,
}

impl Prediction {
    /// For the solutions around `solved` for `kind`, with `response(theta)` at points of `space` (physical
    /// coordinates).
    pub fn new(
        imager: &Imager,
        space: &ParameterSpace,
        solved: Solved,
        kind: ObjectiveKind,
        response: impl Fn(&[f64]) -> Response,
    ) -> Self {
        let Solved { solution, goal, preconditioner, .. } = solved;
        let origin = space.to_sampling(solved.theta);
        let scales = space.scales();
        let settings = SolverSettings { cg_tolerance: 0.01, ..SolverSettings::patient() };
        let solver = Solver { entropy: imager.entropy, preconditioner, settings };
        let map = imager.entropy.image(&solution.image.coordinates);
        let scale = imager.entropy.metric(&map, &imager.areas);
        let n = map.len();
        let mut problem = imager.problem(solved.response.clone());
        problem.linearise(&map);
        let mut gradient = vec![0.0; n];
        problem.gradient(&mut gradient);
        let adjoint = match kind {
            ObjectiveKind::Entropy | ObjectiveKind::RegularisedLikelihood | ObjectiveKind::MarginalLikelihood => {
                Vec::new()
            }
            ObjectiveKind::Spottedness => {
                let weights = imager.entropy.spottedness_gradient(&map, &imager.areas);
                let inverse = solver.apply_inverse(&mut problem, &solution.image, &weights);
                let along_path = 2.0 * solution.spottedness_slope / (solution.chi2_slope * solution.image.lambda);
                let adjoint = inverse.iter().zip(&scale).zip(&solution.path);
                let adjoint = adjoint.map(|((y, scale), path)| {
                    (y / f64::from(*scale) + along_path * f64::from(*path)) / f64::from(*scale)
                });
                adjoint.map(|y| y as f32).collect()
            }
        };
        let (mut image, mut ln_lambda) = (Vec::new(), Vec::new());
        for (i, scale_i) in scales.iter().enumerate() {
            let h = STEP * scale_i;
            let at = |h: f64| {
                let mut x = origin.clone();
                x[i] += h;
                let mut problem = imager.problem(response(&space.to_physical(&x)));
                let chi2 = problem.linearise(&map);
                let mut gradient = vec![0.0; n];
                problem.gradient(&mut gradient);
                (chi2, gradient)
            };
            let ((chi2_plus, plus), (chi2_minus, minus)) = (at(h), at(-h));
            let pull = |(p, m): (&f64, &f64)| -solution.image.lambda * (p - m) / (2.0 * h);
            let right: Vec<f64> = plus.iter().zip(&minus).map(pull).collect();
            let mut step = solver.apply_inverse(&mut problem, &solution.image, &right);
            let mut along = 0.0;
            if let Goal::Chi2 { .. } = goal {
                let chi2_step: f64 = 2.0 * gradient.iter().zip(&step).map(|(g, s)| g * s).sum::<f64>();
                let chi2_change = (chi2_plus - chi2_minus) / (2.0 * h) + chi2_step;
                along = -chi2_change / solution.chi2_slope;
                let path = solution.path.iter().zip(&scale).map(|(z, d)| f64::from(*z) * f64::from(*d));
                step.iter_mut().zip(path).for_each(|(s, p)| *s += along * p);
            }
            image.push(step.iter().map(|step| (scale_i * step) as f32).collect());
            ln_lambda.push(scale_i * along);
        }
        Prediction { origin, map, scales, image, ln_lambda, adjoint, bends: Vec::new() }
    }

    /// The same to second order, with `solve` returning the images at sampling coordinates around that of the solution
    /// and `known` as in [`Prediction::start`]; to first order where an image is missing.
    pub fn with_second_order(self, imager: &Imager, known: &Start, solve: impl Fn(&[f64]) -> Option<Image>) -> Self {
        let is_finite = |bend: &Bend| bend.change.iter().all(|x| x.is_finite());
        let found = self.find_bends(imager, known, solve);
        let bends = found.filter(|bends| bends.iter().all(is_finite)).unwrap_or_default();
        Prediction { bends, ..self }
    }

    fn find_bends(&self, imager: &Imager, known: &Start, solve: impl Fn(&[f64]) -> Option<Image>) -> Option<Vec<Bend>> {
        // the residual of the first order after a step forwards or backwards along some of the coordinates
        let left_over = |moves: &[(usize, f64)]| {
            let mut x = self.origin.clone();
            moves.iter().for_each(|(i, sign)| x[*i] += sign * BEND_STEP * self.scales[*i]);
            let (there, predicted) = (solve(&x)?, self.start(imager, known, &x).image);
            let mut left: Vec<f64> = there.coordinates.iter().zip(&predicted.coordinates).map(|(a, b)| a - b).collect();
            left.push((there.lambda / predicted.lambda).ln());
            Some(left)
        };
        let (mut bends, mut forwards): (Vec<Bend>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        for i in 0..self.scales.len() {
            let mut bend = |j: usize, change: &dyn Fn(usize) -> f64| {
                let change = (0..=self.map.len()).map(|p| (change(p) / BEND_STEP.powi(2)) as f32).collect();
                bends.push(Bend { coordinates: [i, j], change });
            };
            let (forward, backward) = (left_over(&[(i, 1.0)])?, left_over(&[(i, -1.0)])?);
            bend(i, &|p| 0.5 * (forward[p] + backward[p]));
            for (j, other) in forwards.iter().enumerate() {
                let both = left_over(&[(i, 1.0), (j, 1.0)])?;
                bend(j, &|p| both[p] - forward[p] - other[p]);
            }
            forwards.push(forward);
        }
        Some(bends)
    }

    /// Whether all its values are finite and within bounds; those of the second order always are.
    pub fn is_finite(&self) -> bool {
        // sums in single precision must be finite, too
        let image = self.image.iter().flatten().all(|x| x.abs() < LARGEST_CHANGE);
        image && self.ln_lambda.iter().all(|x| x.is_finite()) && self.adjoint.iter().all(|x| x.is_finite())
    }

    /// Approximate size in memory (bytes); the second order, which only the reference has, is not counted.
    pub fn bytes(&self) -> usize {
        let image: usize = self.image.iter().map(|step| size_of_val(&step[..])).sum();
        image + size_of_val(&self.map[..]) + size_of_val(&self.adjoint[..])
    }

    /// The start of an evaluation at the sampling coordinates `x`, if one at the known solution starts from `known`.
    pub fn start(&self, imager: &Imager, known: &Start, x: &[f64]) -> Start {
        let away = x.iter().zip(&self.origin).zip(&self.scales);
        let shifts: Vec<f64> = away.map(|((x, x0), scale)| (x - x0) / scale).collect();
        let farthest = shifts.iter().fold(0.0, |farthest: f64, shift| farthest.max(shift.abs()));
        let shrink = (REACH / farthest).min(1.0);
        let n = self.map.len();
        let (mut coordinates, mut step, mut ln_lambda) = (vec![0.0; n], vec![0.0f32; n], 0.0);
        for ((shift, image), along) in shifts.iter().zip(&self.image).zip(&self.ln_lambda) {
            ln_lambda += shrink * shift * along;
            axpy(shrink * shift, image, &mut step);
        }
        let here = &known.image.coordinates;
        imager.entropy.step(here, &self.map, &step, LARGEST_STEP, &mut coordinates);
        if !self.bends.is_empty() {
            let mut change = vec![0.0f32; n + 1];
            let shrink = (BEND_REACH / farthest).min(1.0);
            let bent: Vec<f64> = shifts.iter().map(|shift| shrink * shift).collect();
            for Bend { coordinates: [i, j], change: per_product } in &self.bends {
                axpy(bent[*i] * bent[*j], per_product, &mut change);
            }
            let lowest = imager.entropy.lowest_coordinate();
            for (u, change) in coordinates.iter_mut().zip(&change) {
                *u = (*u + f64::from(change.clamp(-LARGEST_STEP, LARGEST_STEP))).clamp(lowest, -lowest);
            }
            ln_lambda += f64::from(change[n]);
        }
        let lambda = known.image.lambda * ln_lambda.clamp(-LN_LAMBDA_REACH, LN_LAMBDA_REACH).exp();
        let &Start { ref path, chi2_slope, best, .. } = known;
        Start {
            image: Image { coordinates, lambda },
            path: path.clone(),
            chi2_slope,
            adjoint: self.adjoint.clone(),
            best,
        }
    }
}
