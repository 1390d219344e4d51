//! The log-probability of a parameter vector, marginalised over all maps: ln Z (`docs/method.md` section 9) times the
//! prior.
//!
//! Every evaluation begins from the maps of one reference, so that it is a function of the vector alone. Where only the
//! orbit is free ln Z is the quadratic of the reference. Where the field is free the maps are recomputed, and the orbit
//! is that of the quadratic around them. Where stellar parameters are free the profiles of the star are recomputed as
//! well.

use super::climb::{assumed_at, place};
use super::{Assumed, Basis, Design, Held, Marginal};
use crate::field::FieldError;
use crate::model::{FreeParameter, Parameter, ParameterSpace, ParameterValues};
use crate::sampling::log_density::{Evaluation, LogDensity, Status};
use crate::star::Nearby;
use crate::surface::expansion::{Expansion, STELLAR, free_stellar};
use crate::surface::imaging::Imager;
use crate::surface::static_map::is_physical;
use nalgebra::DMatrix;
use std::sync::{Arc, OnceLock};

/// Name of ln Z beside a log-probability.
pub const LN_EVIDENCE: &str = "ln_evidence";

/// Step in ln amplitude, slope or ln lifetime for the derivatives of the maps, and the largest step of their
/// extrapolation: finding maps of another field from there saves a ninth of the time.
const STEP: f64 = 0.2;
const FAR: f64 = 0.6;

/// Model applications for velocities and misfits of maps.
const SLOPES: u32 = 3;

/// The posterior of the free parameters, marginalised over all maps.
#[derive(Clone, Debug)]
pub struct MarginalPosterior {
    pub(super) imager: Imager,
    pub(super) space: ParameterSpace,
    pub(super) reference: Arc<Marginal>,
    /// Derivatives of its most probable maps with each parameter of the field; none where maps are not recomputed.
    along: Arc<Vec<(usize, DMatrix<f64>)>>,
    /// ln Z of the reference in the velocities of the profiles.
    velocities: Arc<Expansion>,
    anew: Anew,
    nearby: Arc<Nearby>,
    /// To second order in all free parameters, once it is needed.
    pub(super) expansion: Arc<OnceLock<Result<Expansion, FieldError>>>,
}

/// What an evaluation recomputes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Anew {
    /// Nothing: only the orbit is free.
    Nothing,
    /// The maps.
    Maps,
    /// The profiles of the star, and the maps.
    Star,
}

impl MarginalPosterior {
    /// The posterior of `space` around `values`, including those of the field. Maps are found from uniform ones: the
    /// same values give the same bytes.
    ///
    /// # Errors
    /// [`FieldError`], where there is no reference.
    pub fn new(
        imager: Imager,
        space: &ParameterSpace,
        values: ParameterValues,
        held: Held,
    ) -> Result<Self, FieldError> {
        let is_free = |what: &dyn Fn(Parameter) -> bool| space.free().iter().any(|f| what(f.parameter));
        let anew = match () {
            _ if is_free(&|p| STELLAR.contains(&p)) => Anew::Star,
            _ if is_free(&Parameter::is_of_field) => Anew::Maps,
            _ => Anew::Nothing,
        };
        let (basis, state) = (Arc::new(Basis::seen(&imager, &values).exactly()), values.state());
        let design = Design::new(&imager, &basis, &state);
        let design = Arc::new(match anew {
            Anew::Maps => design.moving(&imager, &basis, &state),
            Anew::Nothing | Anew::Star => design,
        });
        let assumed = Assumed::of(&values, held);
        let reference = Arc::new(Marginal::new(&imager, &basis, design, values, assumed, None)?);
        let velocities = Arc::new(reference.expansion(&imager, &[])?);
        let along = match anew {
            Anew::Maps => along_the_field(&imager, &reference)?,
            Anew::Nothing | Anew::Star => Vec::new(),
        };
        let nearby = Arc::new(imager.nearby(&state));
        let space = space.clone().with_field_of(&reference.values);
        let expansion = Arc::default();
        Ok(MarginalPosterior { imager, space, reference, along: Arc::new(along), velocities, anew, nearby, expansion })
    }

    /// ln Z of the reference.
    pub fn reference_ln_evidence(&self) -> f64 {
        self.velocities.log_likelihood
    }

    /// The start of evaluations.
    pub fn reference(&self) -> &Marginal {
        &self.reference
    }

    /// The parameter space; fixed parameters of the field have the values of the reference.
    pub fn space(&self) -> &ParameterSpace {
        &self.space
    }

    /// Star and data.
    pub fn imager(&self) -> &Imager {
        &self.imager
    }

    /// The free parameters of an expansion beside the velocities: stellar ones, then those of the field.
    pub(super) fn coordinates(&self) -> Vec<Parameter> {
        let is_free = |p: &Parameter| self.space.free().iter().any(|f: &FreeParameter| f.parameter == *p);
        free_stellar(self.space.free()).into_iter().chain(Parameter::FIELD.into_iter().filter(is_free)).collect()
    }

    /// The maps at `values`, found from those of the reference; the profiles of the star are recomputed if `star`.
    ///
    /// # Errors
    /// [`FieldError`].
    pub(super) fn marginal_at(&self, values: ParameterValues, star: bool) -> Result<Marginal, FieldError> {
        let MarginalPosterior { imager, reference, nearby, .. } = self;
        let basis = &reference.basis;
        let design = match star {
            true => {
                let state = values.state();
                let response = imager.response_near(nearby, &state);
                Arc::new(Design::of(imager, basis, (response, &state), Some(&reference.design)))
            }
            false => Arc::clone(&reference.design),
        };
        let assumed = Assumed::of(&values, reference.assumed.held());
        let off = place(&assumed) - place(&reference.assumed);
        let mut maps = reference.settled.coefficients.clone();
        for (i, along) in self.along.iter() {
            maps += along * off[*i].clamp(-FAR, FAR);
        }
        Marginal::begun((imager, basis), design, values, assumed, (Some(reference), maps))
    }

    /// `values` with the orbit and systemic velocity of the reference.
    pub(super) fn at_reference_velocities(&self, mut values: ParameterValues) -> ParameterValues {
        values.star.vsys_kms = self.reference.values.star.vsys_kms;
        values.with_orbits_of(&self.reference.values)
    }

    /// ln Z at `theta` (physical coordinates) without the prior, with ln Z itself as the other value.
    pub fn likelihood(&self, theta: &[f64]) -> Evaluation {
        let values = self.space.values_at(theta);
        if !is_physical(&self.imager, &values, theta) {
            return Evaluation::rejected(Status::NonFinite);
        }
        let harmonics = self.reference.basis.len() as u32;
        let (ln_evidence, model_applications) = match self.anew {
            Anew::Nothing => (Ok(self.velocities.log_likelihood_at(&values)), 0),
            Anew::Maps => (self.with_maps_anew(&values).map(|here| here.log_likelihood_at(&values)), SLOPES),
            Anew::Star => {
                let here = self.marginal_at(values, true);
                (here.and_then(|here| here.ln_evidence_of_sets(&self.imager)), harmonics)
            }
        };
        match ln_evidence {
            Ok(x) if x.is_finite() => {
                Evaluation { log_prob: x, numbers: vec![x], model_applications, status: Status::Converged }
            }
            Ok(_) | Err(FieldError::NotFinite { .. }) => {
                Evaluation { model_applications, ..Evaluation::rejected(Status::NonFinite) }
            }
            Err(_) => Evaluation { model_applications, ..Evaluation::rejected(Status::StoppedShort) },
        }
    }

    /// Whether an evaluation recomputes the maps, but not the profiles of the star.
    pub(super) fn finds_only_maps_anew(&self) -> bool {
        self.anew == Anew::Maps
    }

    /// In the velocities, with maps found for the field of `theta`.
    pub(super) fn expansion_at(&self, theta: &[f64]) -> Result<Expansion, FieldError> {
        self.with_maps_anew(&self.space.values_at(theta))
    }

    fn with_maps_anew(&self, values: &ParameterValues) -> Result<Expansion, FieldError> {
        let here = self.marginal_at(self.at_reference_velocities(*values), false)?;
        here.expansion(&self.imager, &[])
    }
}

/// Derivatives of the most probable maps of `reference` with its ln amplitude, slope and ln lifetime, as far as it has
/// them: maps of other fields are found from their extrapolation.
fn along_the_field(imager: &Imager, reference: &Marginal) -> Result<Vec<(usize, DMatrix<f64>)>, FieldError> {
    let here = place(&reference.assumed);
    let along = |i: usize| {
        let mut there = here;
        there[i] += STEP;
        let assumed = assumed_at(there, &reference.assumed);
        let (design, values) = (Arc::clone(&reference.design), reference.values);
        let there = Marginal::new(imager, &reference.basis, design, values, assumed, Some(reference))?;
        Ok((i, (there.settled.coefficients - &reference.settled.coefficients) / STEP))
    };
    (0..3).filter(|i| here[*i].is_finite()).map(along).collect()
}

impl LogDensity for MarginalPosterior {
    fn names(&self) -> &[String] {
        self.space.names()
    }

    fn number_names(&self) -> &[&str] {
        &[LN_EVIDENCE]
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        let log_prior = self.space.log_prior(theta);
        if log_prior == f64::NEG_INFINITY {
            return Evaluation::rejected(Status::OutsidePrior);
        }
        if !log_prior.is_finite() {
            return Evaluation::rejected(Status::NonFinite);
        }
        let likelihood = self.likelihood(theta);
        Evaluation { log_prob: likelihood.log_prob + log_prior, ..likelihood }
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
