//! ln Z to second order around a reference in all free parameters: velocities, stellar parameters, and the field
//! (`docs/method.md` section 9).
//!
//! Second derivatives in velocities and stellar parameters are those of the model linearised at the most probable maps.
//! Those maps follow the field, and the determinant follows them: derivatives of the field, and the slopes and second
//! derivatives along each stellar parameter, are differences of ln Z with recomputed maps. Where spots evolve these are
//! smaller than those of the linearised model, along rotation and shear by factors of 1.4 to 30.

use super::{Marginal, MarginalPosterior};
use crate::field::FieldError;
use crate::model::{Parameter, ParameterSpace};
use crate::numerics::once;
use crate::sampling::log_density::{Evaluation, Gradient, LogDensity, Status};
use crate::surface::expansion::{Expansion, STELLAR, stellar_step};
use nalgebra::DVector;
use rayon::prelude::*;

/// Step of the field's parameters, in the sampling coordinates.
const FIELD_STEP: f64 = 0.15;

/// Step of a stellar parameter, in its conditional standard errors.
const STAR_STEP: f64 = 0.7;

/// Second derivatives of ln Z along a stellar parameter over those of the linearised model: at least this.
const LEAST_BEND: f64 = 0.03;
const MOST_BEND: f64 = 4.0;

/// Standard deviation of an unconstrained parameter of the field, in standard deviations of its prior.
const OPEN: f64 = 0.5;

/// ln Z at a displaced point, with its slopes in the velocities and the stellar parameters if they were requested.
struct Displaced {
    ln_evidence: f64,
    slopes: Option<DVector<f64>>,
}

impl MarginalPosterior {
    /// ln Z around the reference, to second order. Coordinates: velocities, then the free parameters of star and field.
    ///
    /// # Errors
    /// [`FieldError`], where ln Z cannot be evaluated near the reference.
    pub fn expansion(&self) -> Result<&Expansion, FieldError> {
        once::found(&self.expansion, || self.expand()).as_ref().map_err(|error| *error)
    }

    fn expand(&self) -> Result<Expansion, FieldError> {
        let all = self.coordinates();
        let (star, field): (Vec<Parameter>, Vec<Parameter>) = all.iter().partition(|p| STELLAR.contains(p));
        let own = self.reference.expansion(&self.imager, &star)?;
        let (profiles, known) = (own.profiles(), own.centre.len());
        let mut information = own.information.clone().resize(known + field.len(), known + field.len(), 0.0);
        let mut gradient = own.gradient.clone().resize_vertically(known + field.len(), 0.0);
        let star_steps = self.star_steps(&own, &star);
        let ends: Vec<[f64; 2]> = star
            .par_iter()
            .zip(&star_steps)
            .map(|(p, h)| {
                let [above, below] = [*h, -*h].map(|h| self.displaced(&[(*p, h)], None));
                Ok([above?.ln_evidence, below?.ln_evidence])
            })
            .collect::<Result<_, FieldError>>()?;
        let beside: Vec<[Displaced; 2]> = field
            .par_iter()
            .map(|p| {
                let [above, below] = [FIELD_STEP, -FIELD_STEP].map(|h| self.displaced(&[(*p, h)], Some(&star)));
                Ok([above?, below?])
            })
            .collect::<Result<_, FieldError>>()?;
        for (q, [above, below]) in beside.iter().enumerate() {
            let at = known + q;
            gradient[at] = (above.ln_evidence - below.ln_evidence) / (2.0 * FIELD_STEP);
            let bend = 2.0 * own.log_likelihood - above.ln_evidence - below.ln_evidence;
            information[(at, at)] = bend / FIELD_STEP.powi(2);
            if let (Some(above), Some(below)) = (&above.slopes, &below.slopes) {
                let across = (below - above) / (2.0 * FIELD_STEP);
                information.view_mut((0, at), (known, 1)).copy_from(&across);
                information.view_mut((at, 0), (1, known)).copy_from(&across.transpose());
            }
        }
        let pairs: Vec<(usize, usize)> = (0..field.len()).flat_map(|q| (0..q).map(move |r| (q, r))).collect();
        let mixed: Vec<f64> = pairs
            .par_iter()
            .map(|(q, r)| {
                let both = |h: f64| self.displaced(&[(field[*q], h), (field[*r], h)], None);
                let ends = both(FIELD_STEP)?.ln_evidence + both(-FIELD_STEP)?.ln_evidence;
                let single: f64 = [q, r].iter().flat_map(|i| &beside[**i]).map(|d| d.ln_evidence).sum();
                Ok((single - ends - 2.0 * own.log_likelihood) / (2.0 * FIELD_STEP.powi(2)))
            })
            .collect::<Result<_, FieldError>>()?;
        for ((q, r), bend) in pairs.into_iter().zip(mixed) {
            information[(known + q, known + r)] = bend;
            information[(known + r, known + q)] = bend;
        }
        for (s, ([above, below], h)) in ends.iter().zip(&star_steps).enumerate() {
            let at = profiles + s;
            gradient[at] = (above - below) / (2.0 * h);
            // the curvature of ln Z along the parameter, with unchanged correlations
            let bend = (2.0 * own.log_likelihood - above - below) / h.powi(2);
            let linear = information[(at, at)];
            if linear > 0.0 {
                let factor = (bend / linear).clamp(LEAST_BEND, MOST_BEND).sqrt();
                information.column_mut(at).scale_mut(factor);
                information.row_mut(at).scale_mut(factor);
            }
        }
        for (q, p) in field.iter().enumerate() {
            self.close(*p, known + q, &mut information);
        }
        let centre = crate::surface::expansion::coordinates(&own.values, &own.cycles, &all);
        Ok(Expansion { stellar: all, centre, gradient, noise: information.clone(), information, ..own })
    }

    /// Steps of the stellar parameters.
    fn star_steps(&self, own: &Expansion, star: &[Parameter]) -> Vec<f64> {
        let time_base_d = self.imager.time_base_cycles() * self.imager.star.rotation_period_d;
        let step = |(s, p): (usize, &Parameter)| {
            let at = own.profiles() + s;
            let usual = stellar_step(*p, &own.values, time_base_d);
            (STAR_STEP / own.information[(at, at)].max(0.0).sqrt()).clamp(0.1 * usual, 10.0 * usual)
        };
        star.iter().enumerate().map(step).collect()
    }

    /// ln Z with some parameters displaced in the sampling coordinates.
    fn displaced(&self, moves: &[(Parameter, f64)], slopes: Option<&[Parameter]>) -> Result<Displaced, FieldError> {
        let mut values = self.reference.values;
        for (p, h) in moves {
            values.set(*p, p.to_physical(p.to_sampling(values[*p]) + h));
        }
        let star = moves.iter().any(|(p, _)| STELLAR.contains(p));
        let here: Marginal = self.marginal_at(values, star)?;
        match slopes {
            None => {
                let ln_evidence = here.ln_evidence_of_sets(&self.imager)?;
                Ok(Displaced { ln_evidence, slopes: None })
            }
            Some(star) => {
                let expansion = here.expansion(&self.imager, star)?;
                Ok(Displaced { ln_evidence: expansion.log_likelihood, slopes: Some(expansion.gradient) })
            }
        }
    }

    /// Replaces an unconstrained parameter of the field by its prior, independent of all else.
    fn close(&self, parameter: Parameter, at: usize, information: &mut nalgebra::DMatrix<f64>) {
        let (low, high) = parameter.widest();
        let width = parameter.to_sampling(high) - parameter.to_sampling(low);
        let least = (OPEN * width / 12.0_f64.sqrt()).powi(-2);
        if information[(at, at)] < least {
            information.column_mut(at).fill(0.0);
            information.row_mut(at).fill(0.0);
            information[(at, at)] = least;
        }
    }
}

/// The posterior from an expansion of ln L: searches climb it at no cost.
#[derive(Clone, Debug)]
pub struct Forecast<'a> {
    /// The parameters and their priors.
    pub space: &'a ParameterSpace,
    /// ln L.
    pub expansion: &'a Expansion,
}

/// Steps of numerical derivatives, as a fraction of a coordinate's natural scale.
const DERIVATIVE_STEP: f64 = 0.01;

impl LogDensity for Forecast<'_> {
    fn names(&self) -> &[String] {
        self.space.names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        let log_prior = self.space.log_prior(theta);
        match log_prior == f64::NEG_INFINITY {
            true => Evaluation::rejected(Status::OutsidePrior),
            false => Evaluation::of(log_prior + self.expansion.log_likelihood_at(&self.space.values_at(theta))),
        }
    }

    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        self.space.to_sampling(theta)
    }

    fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        self.space.to_physical(internal)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.space.log_jacobian(theta)
    }
}

impl Gradient for Forecast<'_> {
    fn evaluate_with_gradient(&self, theta: &[f64]) -> (Evaluation, Vec<f64>) {
        let here = self.evaluate(theta);
        if !here.log_prob.is_finite() {
            return (here, Vec::new());
        }
        let (x, scales) = (self.space.to_sampling(theta), self.scales());
        let derivative = |i: usize| {
            let h = DERIVATIVE_STEP * scales[i];
            let at = |h: f64| {
                let mut x = x.clone();
                x[i] += h;
                Some(self.evaluate(&self.space.to_physical(&x)).log_prob).filter(|p| p.is_finite())
            };
            match (at(h), at(-h)) {
                (Some(above), Some(below)) => (above - below) / (2.0 * h),
                (Some(above), None) => (above - here.log_prob) / h,
                (None, Some(below)) => (here.log_prob - below) / h,
                (None, None) => 0.0,
            }
        };
        (here.clone(), (0..x.len()).map(derivative).collect())
    }

    fn scales(&self) -> Vec<f64> {
        self.space.scales()
    }

    fn bounds(&self) -> Vec<(f64, f64)> {
        self.space.sampling_bounds()
    }
}
