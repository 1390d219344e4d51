//! The static map behind the interface of all surface models.

use super::{Posterior, Reference, StaticMap, UNRESOLVED_SPOTS, optimum};
use crate::maxent::Termination;
use crate::model::{Parameter, ParameterSpace, ParameterValues};
use crate::planets::periodogram::{CircularOrbit, Frequencies, Unbounded};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::Remark;
use crate::star::observation::Observations;
use crate::surface::density::Density;
use crate::surface::evolving_map::{Change, NoFit};
use crate::surface::expansion::{Expansion, Nuisance, STELLAR, of_the_star};
use crate::surface::imaging::Imager;
use crate::surface::optimum::{Best, BlindStart, Progress, SearchError, Sought};
use crate::surface::record::{RebuildError, SurfaceRecord};
use crate::surface::{
    At, AtTarget, Explained, FieldErrors, Linearised, NoMaps, OrbitOf, Properties, SurfaceError, SurfaceMaps,
    SurfaceModel, WithoutJitter,
};
use rayon::prelude::*;
use std::sync::Arc;

/// Targets of chi2, relative to the requested one, at which an orbit is evaluated.
const TARGETS: [f64; 3] = [0.97, 1.0, 1.03];
/// chi2 per datum that many of its standard deviations from 1 is a warning.
const FAR: f64 = 5.0;
/// A target is missed by more than this factor; with measured uncertainties it is just reached.
const MISSED: f64 = 1.02;

impl StaticMap {
    /// Its properties.
    pub const PROPERTIES: Properties = Properties {
        name: "static map",
        under_way: "reconstructing",
        map_changes: false,
        marginalises: false,
        has_field: false,
        takes_light_curves: false,
        has_target: true,
    };
}

impl SurfaceModel for StaticMap {
    fn linearise(&self, at: At, _: Option<&Linearised>) -> Result<Linearised, SurfaceError> {
        let At { imager, values, nuisances } = at;
        let stellar: Vec<Parameter> = nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect();
        let reference = Reference::provisional(imager, values, self.chi2_target)?;
        let on_target = reference.solution.termination == Termination::Converged;
        let expansion = Expansion::of(imager, &reference, &stellar);
        let regularised = expansion.velocities(nuisances);
        let unresolved_spots = expansion.unresolved_spots(nuisances).ok_or(Unbounded)?;
        let counted = expansion.with_unresolved_spots(unresolved_spots).ok_or(Unbounded)?;
        let (quadratic, held) = (counted.velocities(nuisances), counted.velocities(&of_the_star(nuisances)));
        let (field, solution) = (None, Arc::new(reference));
        Ok(Linearised { expansion, quadratic, held, regularised, unresolved_spots, on_target, field, solution })
    }

    fn velocities(&self, expansion: &Expansion, nuisances: &[Nuisance]) -> Option<VelocityQuadratic> {
        let unresolved_spots = expansion.unresolved_spots(nuisances)?;
        Some(expansion.with_unresolved_spots(unresolved_spots)?.velocities(nuisances))
    }

    fn without_jitter(&self, _: At, _: &Linearised) -> Result<Option<WithoutJitter>, SurfaceError> {
        Ok(None)
    }

    fn holding(&self, _: &Linearised) -> Box<dyn SurfaceModel> {
        Box::new(*self)
    }

    fn evolution(&self, at: At, frequencies: &Frequencies) -> Option<Result<Change, NoFit>> {
        self.compared_with.map(|known| Change::of(at.imager, at.values, frequencies, at.nuisances, known))
    }

    fn imitates_at_fractions(&self) -> bool {
        true
    }

    fn without_each(
        &self,
        at: At,
        _: &Linearised,
        groups: &[Vec<usize>],
        orbit: OrbitOf,
    ) -> Vec<Option<CircularOrbit>> {
        let without = |group: &Vec<usize>| {
            let imager = &at.imager.without(group);
            self.linearise(At { imager, ..at }, None).ok().and_then(|others| orbit(&others.quadratic))
        };
        groups.par_iter().map(without).collect()
    }

    fn at_other_targets(&self, at: At, orbit: OrbitOf) -> Vec<AtTarget> {
        let with = |factor: f64| {
            let chi2_target = factor * self.chi2_target;
            let there = StaticMap { chi2_target, ..*self }.linearise(at, None);
            AtTarget {
                chi2_target,
                on_target: there.as_ref().is_ok_and(|there| there.on_target),
                orbit: there.ok().and_then(|there| orbit(&there.quadratic)),
            }
        };
        TARGETS.map(with).to_vec()
    }

    fn explained(&self, imager: &Imager, observations: &Observations, here: &Linearised) -> Explained {
        let SurfaceMaps { velocities, summary, checks, .. } =
            SurfaceMaps::of_reference(imager, observations, here.kept());
        let velocities = velocities.into_iter().map(|velocity| velocity.moments).collect();
        Explained { velocities, chi2_per_datum: summary.chi2_per_datum, misfit: checks.warnings }
    }

    fn field_errors(&self, _: &Imager, _: &Linearised) -> FieldErrors {
        FieldErrors::default()
    }

    /// Remarks where the image does not fit properly.
    fn remarks(&self, imager: &Imager, here: &Linearised) -> Vec<Remark> {
        let mut remarks = Vec::new();
        let correlated_bins = imager.data.correlated_bins;
        let data = imager.data.depth.len() as f64;
        let chi2 = here.kept::<Reference>().solution.chi2 / data;
        let far = (chi2 * correlated_bins - 1.0) / (2.0 * correlated_bins / data).sqrt();
        let target = self.chi2_target;
        if !here.on_target && chi2 > MISSED * target {
            remarks.push(Remark::against(
                "no map fits to the target chi2",
                format!(
                    "no map reaches the target χ²/N of {target:.3} without fitting noise ({chi2:.3} reached): the \
                    target may be too low, or the stellar model wrong"
                ),
            ));
        } else if far.abs() > FAR {
            remarks.push(Remark::against(
                "chi2 is far from 1",
                format!(
                    "χ²/N = {chi2:.3}, {far:+.1}σ from 1: the uncertainties of the profiles or the stellar model may \
                    be wrong, and all uncertainties here with them"
                ),
            ));
        }
        if here.unresolved_spots > 0.5 * UNRESOLVED_SPOTS.1 {
            remarks.push(Remark::against(
                "the stellar model is wrong",
                "The stellar model cannot reproduce the profiles (unbounded residual variance): check star.vsini_kms \
                 and star.line.",
            ));
        }
        remarks
    }

    fn maps(
        &self,
        At { imager, values, .. }: At,
        observations: &Observations,
        times_d: Option<&[f64]>,
    ) -> Result<SurfaceMaps, NoMaps> {
        if times_d.is_some() {
            return Err(NoMaps::Times(
                "static maps have no times: set imaging.objective to \"marginal-likelihood\" for evolving maps",
            ));
        }
        let reference = Reference::build(imager, values, self.chi2_target)?;
        Ok(SurfaceMaps::of_reference(imager, observations, &reference))
    }

    fn begins_with_blind_search(&self) -> bool {
        false
    }

    fn optimum(
        &self,
        sought: Sought,
        _: Option<BlindStart>,
        report: &(dyn Fn(Progress) + Sync),
    ) -> Result<Best, SearchError> {
        optimum::find(self, sought, report)
    }

    fn rebuilt(
        &self,
        imager: Imager,
        space: ParameterSpace,
        record: &SurfaceRecord,
        others: &ParameterValues,
    ) -> Result<Density, RebuildError> {
        let then = record.image()?;
        let reference = Reference::build(&imager, record.values(others), self.chi2_target)?;
        RebuildError::check("lambda", then.lambda, reference.solution.image.lambda)?;
        Ok(Arc::new(Posterior::new(imager, space, self.objective, reference)))
    }
}
