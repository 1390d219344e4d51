//! The quadratic at one period: a Gaussian in all other coordinates.
//!
//! With `x = T y + o` the coordinates of the expansion, y the linear ones (K cos, K sin, systemic velocity, stellar
//! parameters) and T's first two columns the cosine and sine of the orbit's angle: `ln L = c + b y - y A y / 2`.

use crate::posterior::expansion::Expansion;
use crate::posterior::objective::{Parameter, ParameterSpace, Prior};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::{Rng, RngCore};
use rand_distr::{ChiSquared, StandardNormal};
use std::f64::consts::TAU;

/// Degrees of freedom of the distribution that the linear coordinates are drawn from.
const DEGREES: f64 = 8.0;

/// What the quadratics of all periods have in common.
#[derive(Clone, Debug)]
pub(super) struct LinearModel {
    /// Rotation cycles from mid-time.
    cycles: Vec<f64>,
    information: DMatrix<f64>,
    /// Gradient of ln L and ln L itself at `y = 0`.
    gradient: DVector<f64>,
    constant: f64,
    /// Columns of T but for the orbit's two, and the information times these.
    columns: DMatrix<f64>,
    informed: DMatrix<f64>,
    /// Positions of the linear coordinates in a vector of internal ones: K cos, K sin, then those of `columns`.
    linear: Vec<usize>,
    /// Position of the period, or its value where it is fixed.
    period: Result<usize, f64>,
    dimension: usize,
    correction: Option<Correction>,
    /// Precision and pull of the normal priors of linear coordinates.
    prior_precision: DVector<f64>,
    prior_pull: DVector<f64>,
}

/// What is added to ln L at every period: `constant + gradient (y - centre) - (y - centre) information (y - centre) /
/// 2`.
#[derive(Clone, Debug)]
pub(super) struct Correction {
    pub centre: DVector<f64>,
    pub constant: f64,
    pub gradient: DVector<f64>,
    pub information: DMatrix<f64>,
}

/// The quadratic at one period.
pub(super) struct Conditional {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    constant: f64,
    /// Of what is drawn from: with the normal priors, at the temperature.
    factor: Cholesky<f64, Dyn>,
    mode: DVector<f64>,
    log_determinant: f64,
}

impl LinearModel {
    /// Of an expansion whose stellar coordinates are those that `space` leaves free.
    pub fn new(expansion: &Expansion, space: &ParameterSpace, mid_cycle: f64) -> Self {
        let (n, all) = (expansion.profiles(), expansion.centre.len());
        let position = |p: Parameter| space.free().iter().position(|f| f.parameter == p);
        let fixed = space.values_at(&space.start());
        let polar = [Parameter::K, Parameter::Phi].map(|p| position(p).expect("K and phi are free"));
        let others: Vec<usize> = (0..space.dimension())
            .filter(|i| !polar.contains(i) && space.free()[*i].parameter != Parameter::PorbOverProt)
            .collect();
        let mut columns = DMatrix::zeros(all, others.len());
        let mut offset = -&expansion.centre;
        for (mut column, &i) in columns.column_iter_mut().zip(&others) {
            column.copy_from(&expansion.direction(space.free()[i].parameter));
        }
        if position(Parameter::Vsys).is_none() {
            offset.rows_mut(0, n).add_scalar_mut(fixed[Parameter::Vsys]);
        }
        let linear: Vec<usize> = polar.into_iter().chain(others).collect();
        let normal = |&i: &usize| match space.free()[i].prior {
            Prior::Normal { mean, sd, .. } if !polar.contains(&i) => {
                // in the coordinate that is sampled, to first order
                let p = space.free()[i].parameter;
                let sd = sd * (-p.log_jacobian(mean)).exp();
                (sd.powi(-2), p.to_sampling(mean) * sd.powi(-2))
            }
            _ => (0.0, 0.0),
        };
        let normals: Vec<(f64, f64)> = linear.iter().map(normal).collect();
        let pushed = &expansion.information * &offset;
        LinearModel {
            cycles: expansion.cycles.iter().map(|e| e - mid_cycle).collect(),
            gradient: &expansion.gradient - &pushed,
            constant: expansion.log_likelihood + expansion.gradient.dot(&offset) - 0.5 * offset.dot(&pushed),
            informed: &expansion.information * &columns,
            information: expansion.information.clone(),
            columns,
            period: position(Parameter::PorbOverProt).ok_or(fixed[Parameter::PorbOverProt]),
            dimension: space.dimension(),
            correction: None,
            prior_precision: DVector::from_iterator(linear.len(), normals.iter().map(|n| n.0)),
            prior_pull: DVector::from_iterator(linear.len(), normals.iter().map(|n| n.1)),
            linear,
        }
    }

    /// With a correction to ln L in place of the one that there is.
    pub fn with_correction(self, correction: Correction) -> Self {
        LinearModel { correction: Some(correction), ..self }
    }

    /// Number of linear coordinates.
    pub fn linear_count(&self) -> usize {
        self.linear.len()
    }

    /// The fixed period, if it is.
    pub fn fixed_period(&self) -> Option<f64> {
        self.period.err()
    }

    pub fn period_of(&self, position: &[f64]) -> f64 {
        self.period.map_or_else(|fixed| fixed, |i| position[i])
    }

    pub fn linear_of(&self, position: &[f64]) -> DVector<f64> {
        DVector::from_iterator(self.linear.len(), self.linear.iter().map(|&i| position[i]))
    }

    /// Internal coordinates of a period and linear ones.
    pub fn position(&self, period: f64, linear: &DVector<f64>) -> Vec<f64> {
        let mut position = vec![0.0; self.dimension];
        if let Ok(i) = self.period {
            position[i] = period;
        }
        self.linear.iter().zip(linear.iter()).for_each(|(&i, x)| position[i] = *x);
        position
    }

    /// The quadratic at `period`, drawn from as if ln L were divided by `temperature`; `None` where it has no maximum.
    pub fn at(&self, period: f64, temperature: f64) -> Option<Conditional> {
        let (all, count) = (self.gradient.len(), self.linear.len());
        let mut orbit = DMatrix::zeros(all, 2);
        for (k, cycle) in self.cycles.iter().enumerate() {
            // K cos(angle + angle at mid-time)
            let (sin, cos) = (TAU * cycle / period).sin_cos();
            (orbit[(k, 0)], orbit[(k, 1)]) = (cos, -sin);
        }
        let informed_orbit = &self.information * &orbit;
        let mut information = DMatrix::zeros(count, count);
        information.view_mut((0, 0), (2, 2)).copy_from(&orbit.tr_mul(&informed_orbit));
        let across = orbit.tr_mul(&self.informed);
        information.view_mut((0, 2), (2, count - 2)).copy_from(&across);
        information.view_mut((2, 0), (count - 2, 2)).copy_from(&across.transpose());
        information.view_mut((2, 2), (count - 2, count - 2)).copy_from(&self.columns.tr_mul(&self.informed));
        let mut gradient = DVector::zeros(count);
        gradient.rows_mut(0, 2).copy_from(&orbit.tr_mul(&self.gradient));
        gradient.rows_mut(2, count - 2).copy_from(&self.columns.tr_mul(&self.gradient));
        let mut constant = self.constant;
        if let Some(Correction { centre, constant: at_centre, gradient: slope, information: bend }) = &self.correction {
            let bent = bend * centre;
            constant += at_centre - slope.dot(centre) - 0.5 * centre.dot(&bent);
            gradient += slope + bent;
            information += bend;
        }
        let mut drawn = &information / temperature;
        drawn.set_diagonal(&(drawn.diagonal() + &self.prior_precision));
        let factor = drawn.cholesky()?;
        let mode = factor.solve(&(&gradient / temperature + &self.prior_pull));
        let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>();
        Some(Conditional { information, gradient, constant, factor, mode, log_determinant })
    }
}

impl Conditional {
    /// ln L at the linear coordinates `y`.
    pub fn log_likelihood(&self, y: &DVector<f64>) -> f64 {
        self.constant + self.gradient.dot(y) - 0.5 * y.dot(&(&self.information * y))
    }

    /// Where the drawn distribution is densest.
    pub fn mode(&self) -> DVector<f64> {
        self.mode.clone()
    }

    /// Standard error of K cos and K sin, all else known.
    pub fn amplitude_error(&self) -> f64 {
        (2.0 / (self.information[(0, 0)] + self.information[(1, 1)])).sqrt()
    }

    /// ln of the determinant of its information.
    pub fn log_determinant(&self) -> f64 {
        self.log_determinant
    }

    /// Linear coordinates drawn from a t distribution around the mode, and ln of the density there.
    pub fn draw(&self, rng: &mut dyn RngCore) -> (DVector<f64>, f64) {
        let normal = DVector::from_fn(self.mode.len(), |_, _| rng.sample::<f64, _>(StandardNormal));
        let chi2: f64 = rng.sample(ChiSquared::new(DEGREES).expect("positive"));
        let scaled = normal * (DEGREES / chi2).sqrt();
        let log_density = self.log_t(scaled.norm_squared());
        let step =
            self.factor.l_dirty().tr_solve_lower_triangular(&scaled).expect("a factor has no zero on its diagonal");
        (&self.mode + step, log_density)
    }

    /// ln of the density with which [`Conditional::draw`] gives `y`.
    pub fn log_density(&self, y: &DVector<f64>) -> f64 {
        self.log_t((self.factor.l_dirty().lower_triangle().tr_mul(&(y - &self.mode))).norm_squared())
    }

    fn log_t(&self, distance_squared: f64) -> f64 {
        let degrees = DEGREES + self.mode.len() as f64;
        0.5 * self.log_determinant - 0.5 * degrees * (distance_squared / DEGREES).ln_1p()
    }
}
