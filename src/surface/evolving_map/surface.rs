//! The evolving map behind the interface of all surface models.

use super::linearised::linearised;
use super::{Basis, Change, Fitted, Known, Marginal, MarginalPosterior, NoFit, fit, nights, noise, optimum};
use crate::field::Lifetime;
use crate::model::{ParameterSpace, ParameterValues};
use crate::planets::periodogram::{CircularOrbit, Frequencies, OfField, Scatter};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::Remark;
use crate::star::observation::Observations;
use crate::surface::density::Density;
use crate::surface::expansion::{Expansion, Nuisance};
use crate::surface::imaging::Imager;
use crate::surface::optimum::{Best, BlindStart, Progress, SearchError, Sought};
use crate::surface::record::{RebuildError, SurfaceRecord};
use crate::surface::{
    At, AtTarget, Explained, FieldErrors, Linearised, NoMaps, OrbitOf, Properties, SpotField, SurfaceError,
    SurfaceMaps, SurfaceModel, WithoutJitter,
};
use std::sync::Arc;

/// Evolving spots: a Gaussian field, marginalised over.
#[derive(Clone, Debug)]
pub struct EvolvingMap {
    /// Prior knowledge of the field.
    known: Known,
    /// Bounds that its fit reached, where it is held as fitted.
    at_bounds: Option<Vec<&'static str>>,
}

impl EvolvingMap {
    /// Its properties.
    pub const PROPERTIES: Properties = Properties {
        name: "evolving map",
        under_way: "fitting the field of spots",
        map_changes: true,
        marginalises: true,
        has_field: true,
        takes_light_curves: true,
        has_target: false,
    };

    /// A field with these `known` parameters.
    pub fn new(known: Known) -> Self {
        EvolvingMap { known, at_bounds: None }
    }
}

impl SurfaceModel for EvolvingMap {
    fn linearise(&self, at: At, near: Option<&Linearised>) -> Result<Linearised, SurfaceError> {
        let At { imager, values, nuisances } = at;
        let near = near.map(|near| near.kept::<Fitted>());
        let basis = match near {
            Some(near) => Arc::clone(&near.marginal.basis),
            None => Arc::new(Basis::seen(imager, &values)),
        };
        let mut fitted = fit(imager, &basis, values, self.known, near)?;
        if let Some(reached) = &self.at_bounds {
            fitted.at_bounds.clone_from(reached);
        }
        Ok(linearised(imager, fitted, nuisances)?)
    }

    fn velocities(&self, expansion: &Expansion, nuisances: &[Nuisance]) -> Option<VelocityQuadratic> {
        Some(expansion.velocities(nuisances))
    }

    fn without_jitter(&self, at: At, here: &Linearised) -> Result<Option<WithoutJitter>, SurfaceError> {
        Ok(noise::without(at, here, &self.known)?)
    }

    fn with_noise(&self, at: At, here: &Linearised, noise: Scatter) -> Result<Linearised, SurfaceError> {
        Ok(noise::with(at, here, noise)?)
    }

    fn absorbing(&self, at: At, here: &Linearised) -> Result<Vec<OfField>, SurfaceError> {
        let of_field = |marginal: &Marginal| {
            let marginal = match self.known.jitter_kms {
                None if marginal.assumed.has_noise() => marginal.without_jitter(at.imager)?,
                _ => marginal.clone(),
            };
            let ln_posterior = self.known.height(&marginal);
            let here = linearised(at.imager, Fitted::near(marginal), at.nuisances)?;
            Ok(OfField { velocities: here.quadratic, held: here.held, ln_posterior })
        };
        here.kept::<Fitted>().absorbing(at.imager, &self.known, of_field)
    }

    fn holding(&self, here: &Linearised) -> Box<dyn SurfaceModel> {
        let Fitted { marginal, at_bounds, .. } = here.kept();
        Box::new(EvolvingMap {
            known: Known::of(marginal, self.known.stability_kms),
            at_bounds: Some(at_bounds.clone()),
        })
    }

    fn evolution(&self, at: At, frequencies: &Frequencies) -> Option<Result<Change, NoFit>> {
        let known = Some(self.known).filter(|known| known.lifetime == Some(Lifetime::Static));
        known.map(|known| Change::of(at.imager, at.values, frequencies, at.nuisances, known))
    }

    fn imitates_at_fractions(&self) -> bool {
        false
    }

    /// Profiles are removed from the evidence: the field, and the maps around which profiles are linear, stay.
    fn without_each(
        &self,
        at: At,
        here: &Linearised,
        groups: &[Vec<usize>],
        orbit: OrbitOf,
    ) -> Vec<Option<CircularOrbit>> {
        let marginal = &here.kept::<Fitted>().marginal;
        let of_others = |others: &Expansion| orbit(&others.velocities(at.nuisances));
        match marginal.without_each(at.imager, &here.expansion.stellar, groups, of_others) {
            Ok(all) => all.into_iter().map(|of| of.ok().flatten()).collect(),
            Err(_) => vec![None; groups.len()],
        }
    }

    fn at_other_targets(&self, _: At, _: OrbitOf) -> Vec<AtTarget> {
        Vec::new()
    }

    fn explained(&self, imager: &Imager, observations: &Observations, here: &Linearised) -> Explained {
        nights::explained(imager, observations, here.kept())
    }

    fn field_errors(&self, imager: &Imager, here: &Linearised) -> FieldErrors {
        here.kept::<Fitted>().errors(imager, &self.known)
    }

    /// Remarks on the field.
    fn remarks(&self, _: &Imager, here: &Linearised) -> Vec<Remark> {
        SpotField::of(here.kept()).remarks()
    }

    fn maps(&self, at: At, observations: &Observations, times_d: Option<&[f64]>) -> Result<SurfaceMaps, NoMaps> {
        SurfaceMaps::of_field(at, observations, self.known, times_d)
    }

    fn begins_with_blind_search(&self) -> bool {
        true
    }

    fn optimum(
        &self,
        sought: Sought,
        start: Option<BlindStart>,
        report: &(dyn Fn(Progress) + Sync),
    ) -> Result<Best, SearchError> {
        optimum::find(self.known, sought, start, report)
    }

    fn rebuilt(
        &self,
        imager: Imager,
        space: ParameterSpace,
        record: &SurfaceRecord,
        others: &ParameterValues,
    ) -> Result<Density, RebuildError> {
        let then = record.field()?;
        let posterior = MarginalPosterior::new(imager, &space, record.values(others), then.held())?;
        RebuildError::check("ln of the evidence", then.ln_evidence, posterior.reference_ln_evidence())?;
        Ok(Arc::new(posterior))
    }
}
