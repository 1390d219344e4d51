//! What a posterior becomes where the spots that the map leaves over are counted as noise, their size unknown.
//!
//! With x the coordinates of an expansion relative to its centre, its gradient g there scatters around `I x` with the covariance
//! `S = noise + f (I - noise)`, f the size of spots left over in variance (`spots`). Close to the rotation period, an orbit can
//! stand for spots left over and they for an orbit: which of them it is is not settled by the size that is most probable with
//! one or the other, so that the size is integrated over, uniform in its logarithm:
//! `p(x) = sum_f |S_f|^-1/2 exp(-(g - I x) S_f^-1 (g - I x) / 2)`.
//!
//! ln L as the objective has it is more than the quadratic q, the more so the farther from the reference. For one size, spots
//! left over temper a likelihood: they leave the share `rho = x I S_f^-1 I x / x I x`, at most 1, of what the quadratic falls by
//! along x, and of all that ln L does beyond it as well. So every term of the sum has `rho_f (ln L - q)` in its exponent besides.
//! Left out: where the reference is.

use super::spots::SPOTS_LEFT;
use super::{Expansion, free_stellar, nuisances};
use crate::log_density::{Evaluation, Status};
use crate::objective::{Parameter, ParameterSpace, ParameterValues, Posterior};
use nalgebra::{DMatrix, DVector};

/// Sizes that are integrated over, for each factor of ten.
const SIZES_PER_DECADE: f64 = 4.0;

/// What a posterior becomes where spots left over count as noise.
#[derive(Clone, Debug)]
pub struct SpotsCounted {
    /// ln L as the objective has it at the reference.
    at_reference: f64,
    entropy: Expansion,
    cautious: Expansion,
    sizes: Vec<Size>,
}

/// The density of the gradient for one size of the spots left over: with `S = L L^t`, `L^-1 I`, `L^-1 g` and `ln |S|^-1/2`.
#[derive(Clone, Debug)]
struct Size {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    ln_norm: f64,
}

impl SpotsCounted {
    /// Of `posterior`, to second order around its reference; `None` where there is no such size.
    pub fn new(posterior: &Posterior) -> Option<Self> {
        let free = posterior.space().free();
        let reference = posterior.reference();
        let entropy = Expansion::of(posterior.imager(), reference, &free_stellar(free));
        let mut without_planet = reference.values;
        without_planet[Parameter::K] = 0.0;
        // an orbit that stands for spots left over makes them look small
        let size = [reference.values, without_planet]
            .iter()
            .filter_map(|values| entropy.recentred(values).spots_left(&nuisances(free)))
            .reduce(f64::max)?;
        let cautious = entropy.with_spots_left(size)?;
        let places = (SIZES_PER_DECADE * (SPOTS_LEFT.1 / SPOTS_LEFT.0).log10()).ceil() as i32;
        let factor = |place: i32| SPOTS_LEFT.0 * 10f64.powf(f64::from(place) / SIZES_PER_DECADE);
        let sizes = (0..=places).filter_map(|place| Size::new(&entropy, factor(place))).collect();
        let theta = posterior.space().theta_of(&reference.values);
        let at_reference = posterior.likelihood(&theta).likelihood?.log_likelihood;
        Some(SpotsCounted { at_reference, entropy, cautious, sizes })
    }

    /// ln L at the reference to second order, with spots left over of the larger of the sizes that are most probable with the
    /// reference's orbit and without a planet: what a surrogate is made of.
    pub fn expansion(&self) -> &Expansion {
        &self.cautious
    }

    /// ln L with spots left over counted, where it is `log_likelihood` with spots as the entropy has them.
    pub fn log_likelihood(&self, values: &ParameterValues, log_likelihood: f64) -> f64 {
        let step = self.entropy.coordinates(values) - &self.entropy.centre;
        let quadratic = self.entropy.log_likelihood_at(values) - self.entropy.log_likelihood;
        let beyond = log_likelihood - self.at_reference - quadratic;
        let nowhere = DVector::zeros(step.len());
        self.at_reference + self.ln_density(&step, beyond) - self.ln_density(&nowhere, 0.0)
    }

    /// ln of the density of the gradient, the size integrated over, where ln L is so much `beyond` the quadratic.
    fn ln_density(&self, step: &DVector<f64>, beyond: f64) -> f64 {
        let whole = step.dot(&(&self.entropy.information * step));
        let terms: Vec<f64> = self.sizes.iter().map(|size| size.ln_density(step, whole, beyond)).collect();
        let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        largest + terms.iter().map(|term| (term - largest).exp()).sum::<f64>().ln()
    }

    /// The posterior's `evaluation` at `theta`, spots left over counted.
    pub fn recount(&self, space: &ParameterSpace, theta: &[f64], evaluation: Evaluation) -> Evaluation {
        if !evaluation.log_prob.is_finite() {
            return evaluation;
        }
        let log_prior = space.log_prior(theta);
        let log_likelihood = self.log_likelihood(&space.values_at(theta), evaluation.log_prob - log_prior);
        if log_likelihood.is_nan() {
            return Evaluation { passes: evaluation.passes, ..Evaluation::rejected(Status::NonFinite) };
        }
        Evaluation { log_prob: log_prior + log_likelihood, ..evaluation }
    }
}

impl Size {
    /// Of spots left over `factor` times as large in variance as the entropy expects; `None` where that is no covariance.
    fn new(expansion: &Expansion, factor: f64) -> Option<Self> {
        let lower = expansion.covariance_with_spots_left(factor).cholesky()?.unpack();
        Some(Size {
            information: lower.solve_lower_triangular(&expansion.information)?,
            gradient: lower.solve_lower_triangular(&expansion.gradient)?,
            ln_norm: -lower.diagonal().iter().map(|l| l.ln()).sum::<f64>(),
        })
    }

    /// `whole` is what the entropy's information makes of the step.
    fn ln_density(&self, step: &DVector<f64>, whole: f64, beyond: f64) -> f64 {
        let moved = &self.information * step;
        let left = moved.norm_squared();
        // rounding may make more of it than there is, or of nothing something
        let share = if left < whole { left / whole } else { 1.0 };
        self.ln_norm - 0.5 * (&self.gradient - moved).norm_squared() + share * beyond
    }
}
