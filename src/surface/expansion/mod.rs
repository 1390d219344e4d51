//! The regularised likelihood to second order around a reference, in the velocities of the profiles and in the stellar
//! parameters (`docs/method.md` section 4).
//!
//! `ln L(x) = max_s [alpha S(s) - chi2(s, x)/2]` at the alpha of the reference is very nearly a quadratic in the
//! velocity of every profile: it is valid where the best-fitting map responds linearly to the change of a velocity. Its
//! gradient and curvature take one preconditioned solve per profile. Evolving maps fill the same [`Expansion`] with ln
//! Z.

mod marginal;
mod model;

use crate::maxent::{Solver, SolverSettings};
use crate::model::{FreeParameter, Parameter, ParameterValues};
use crate::surface::imaging::Imager;
use crate::surface::static_map::Reference;
use model::DisplacedModel;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::LazyLock;

pub use marginal::{Nuisance, nuisances, of_the_star};
pub use model::{VELOCITY_STEP_KMS, stellar_step, velocity_slopes};

/// The stellar parameters that an expansion may contain beside the velocities, which include the systemic velocity.
pub static STELLAR: LazyLock<Vec<Parameter>> =
    LazyLock::new(|| Parameter::ALL.into_iter().filter(|p| p.is_stellar()).collect());

/// The free stellar parameters.
pub fn free_stellar(free: &[FreeParameter]) -> Vec<Parameter> {
    STELLAR.iter().copied().filter(|p| free.iter().any(|f| f.parameter == *p)).collect()
}

/// The regularised likelihood to second order. Coordinates: the velocity of each profile (km/s; orbit and systemic
/// velocity together), then the stellar parameters in the units of their names; those of the field in the sampling
/// coordinates ([`Parameter::to_sampling`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Expansion {
    /// The parameters of the expansion.
    pub values: ParameterValues,
    /// Rotation cycle of each profile.
    pub cycles: Vec<f64>,
    /// The stellar parameters among the coordinates.
    pub stellar: Vec<Parameter>,
    /// ln L at the centre: `alpha S - chi2/2`.
    pub log_likelihood: f64,
    /// Coordinates of the centre.
    pub centre: DVector<f64>,
    /// Derivative of ln L at the centre.
    pub gradient: DVector<f64>,
    /// Minus the second derivative.
    pub information: DMatrix<f64>,
    /// Covariance of the gradient by photon noise, and by unresolved spots where they are counted as noise. Otherwise
    /// it is smaller than the information, which also counts possible spots.
    pub noise: DMatrix<f64>,
}

/// Precision of the solves, and approximate relative precision of the information.
const CG_TOLERANCE: f64 = 1e-4;

impl Expansion {
    /// Around `reference`, in the velocities of all profiles and the given `stellar` parameters.
    ///
    /// With the data weights W, the residual r, `D_x = dD/dx`, `C_x = d/dx` of the gradient of chi2/2 with respect to
    /// the map and `M = alpha Hess(-S) + Hess(chi2/2)`: `g_x = -r W D_x` and `I_xy = D_x W D_y + r W D_xy - C_x M^-1
    /// C_y`. Noise n in the data changes the gradient by `(D_x - J M^-1 C_x) W n`, J the derivative of the model with
    /// respect to the map.
    pub fn of(imager: &Imager, reference: &Reference, stellar: &[Parameter]) -> Self {
        let model = DisplacedModel::new(imager, reference, stellar);
        let lambda = reference.solution.image.lambda;
        let profiles = model.profiles();
        let (count, data) = (profiles + stellar.len(), imager.data.depth.len());
        let solver = Solver {
            entropy: imager.entropy,
            preconditioner: &reference.preconditioner,
            settings: SolverSettings { cg_tolerance: CG_TOLERANCE, ..SolverSettings::patient() },
        };
        let pulls: Vec<Vec<f64>> = (0..count).into_par_iter().map(|x| model.pull(x)).collect();
        // M^-1 C_x, and the resulting change of the model's depths
        let answer = |pull: &Vec<f64>| {
            let mut problem = model.problem();
            let mut map = solver.apply_inverse(&mut problem, &reference.solution.image, pull);
            map.iter_mut().for_each(|m| *m *= lambda);
            let mut depths = vec![0.0; data];
            problem.model_change(&map, &mut depths);
            (map, depths)
        };
        let answers: Vec<(Vec<f64>, Vec<f64>)> = pulls.par_iter().map(answer).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut information = model.curvature();
        for (x, pull) in pulls.iter().enumerate() {
            for (y, (map, _)) in answers.iter().enumerate() {
                // both halves, so that the remaining error of the solves is symmetric
                let share = 0.5 * dot(pull, map);
                information[(x, y)] -= share;
                information[(y, x)] -= share;
            }
        }
        let mut unanswered = model.tangents();
        for (mut column, (_, depths)) in unanswered.column_iter_mut().zip(&answers) {
            column.iter_mut().zip(depths).for_each(|(c, d)| *c -= d);
        }
        let unanswered = model.weigh_root(&unanswered);
        let solution = &reference.solution;
        Expansion {
            values: reference.values,
            cycles: model.cycles().to_vec(),
            stellar: stellar.to_vec(),
            log_likelihood: solution.entropy / lambda - 0.5 * solution.chi2,
            centre: coordinates(&reference.values, model.cycles(), stellar),
            gradient: model.slope(),
            noise: unanswered.tr_mul(&unanswered),
            information,
        }
    }

    /// Number of profiles.
    pub fn profiles(&self) -> usize {
        self.cycles.len()
    }

    /// The coordinates of a point of parameter space.
    pub fn coordinates(&self, values: &ParameterValues) -> DVector<f64> {
        coordinates(values, &self.cycles, &self.stellar)
    }

    /// Derivatives of the coordinates with the systemic velocity or one of the stellar parameters among them.
    pub fn direction(&self, parameter: Parameter) -> DVector<f64> {
        let mut direction = DVector::zeros(self.centre.len());
        match self.stellar.iter().position(|&p| p == parameter) {
            Some(s) => direction[self.profiles() + s] = 1.0,
            None => {
                assert_eq!(parameter, Parameter::Vsys, "a coordinate of the expansion");
                direction.rows_mut(0, self.profiles()).fill(1.0);
            }
        }
        direction
    }

    /// The same quadratic, written around other values.
    pub fn recentred(&self, values: &ParameterValues) -> Self {
        let centre = self.coordinates(values);
        let gradient = &self.gradient - &self.information * (&centre - &self.centre);
        Expansion { values: *values, log_likelihood: self.log_likelihood_at(values), centre, gradient, ..self.clone() }
    }

    /// ln L there, to second order.
    pub fn log_likelihood_at(&self, values: &ParameterValues) -> f64 {
        let step = self.coordinates(values) - &self.centre;
        self.log_likelihood + self.gradient.dot(&step) - 0.5 * step.dot(&(&self.information * &step))
    }
}

/// Velocities of the profiles at these rotation cycles, and stellar parameters.
pub fn coordinates(values: &ParameterValues, cycles: &[f64], stellar: &[Parameter]) -> DVector<f64> {
    let state = values.state();
    let velocities = state.motion.velocities_kms(cycles).map(|orbit| state.vsys_kms + orbit);
    DVector::from_vec(velocities.chain(stellar.iter().map(|&p| p.to_sampling(values[p]))).collect())
}
