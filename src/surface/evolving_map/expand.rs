//! ln Z to second order in the velocities of the profiles and in the stellar parameters.

use super::light::Light;
use super::{Design, Marginal};
use crate::field::{FieldError, Quadratic};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::offset::Common;
use crate::star::Response;
use crate::surface::expansion::{Expansion, VELOCITY_STEP_KMS, coordinates, stellar_step};
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

impl Marginal {
    /// ln Z, the jitter counted, with those RV offsets held that are otherwise marginalised over.
    pub fn ln_evidence(&self) -> f64 {
        self.settled.evidence.ln_evidence()
    }

    /// ln Z around the values, at the most probable maps. Because the maps are fixed in the derivatives, the
    /// information is that of the model linearised there; the covariance of the gradient over data of the model is the
    /// same matrix.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn expansion(&self, imager: &Imager, stellar: &[Parameter]) -> Result<Expansion, FieldError> {
        self.with_zero_points_integrated(imager, stellar, self.quadratic(imager, stellar)?)
    }

    /// The same, and the same with those RV offsets of data sets held that are otherwise marginalised over.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn expansions(&self, imager: &Imager, stellar: &[Parameter]) -> Result<[Expansion; 2], FieldError> {
        let quadratic = self.quadratic(imager, stellar)?;
        let held = self.expanded(imager, stellar, quadratic.clone());
        Ok([self.with_zero_points_integrated(imager, stellar, quadratic)?, held])
    }

    /// The expansion without each of these groups of profiles (ascending), with the maps of all profiles: the results
    /// of `then` for the expansion of all others.
    ///
    /// # Errors
    /// [`FieldError`], of all groups or of one.
    pub fn without_each<T: Send>(
        &self,
        imager: &Imager,
        stellar: &[Parameter],
        groups: &[Vec<usize>],
        then: impl Fn(&Expansion) -> T + Sync,
    ) -> Result<Vec<Result<T, FieldError>>, FieldError> {
        let (misfits, slopes) = self.misfits_and_slopes(imager, stellar);
        let (epochs, profiles) = (misfits.len(), self.design.response().profiles());
        let then = |group: &[usize], quadratic: Quadratic| {
            let quadratic = summed(&quadratic, epochs - group.len(), profiles - group.len(), stellar.len());
            let of_others = imager.without(group);
            let quadratic = self.with_night_offsets(&of_others, quadratic)?;
            let others = self.with_zero_points_integrated(&of_others, stellar, quadratic)?;
            Ok(then(&others))
        };
        let all = self.settled.evidence.without_each(&misfits, &slopes, groups, then)?;
        Ok(all.into_iter().map(Result::flatten).collect())
    }

    /// chi2 of each profile as predicted by all others.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn predicted_chi2(&self, imager: &Imager) -> Result<Vec<f64>, FieldError> {
        let (misfits, slopes) = self.misfits_and_slopes(imager, &[]);
        let mut all = self.settled.evidence.predicted_chi2(&misfits, &slopes)?;
        all.truncate(self.design.response().profiles());
        Ok(all)
    }

    fn with_zero_points_integrated(
        &self,
        imager: &Imager,
        stellar: &[Parameter],
        quadratic: Quadratic,
    ) -> Result<Expansion, FieldError> {
        if !imager.has_common_velocities() {
            return Ok(self.expanded(imager, stellar, quadratic));
        }
        let common = imager.common_velocities(quadratic.gradient.len());
        let quadratic = with_integrated(quadratic, &common)?;
        Ok(self.expanded(imager, stellar, quadratic))
    }

    /// The same with those RV offsets of data sets held that are otherwise marginalised over.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn known_zero_points(&self, imager: &Imager, stellar: &[Parameter]) -> Result<Expansion, FieldError> {
        Ok(self.expanded(imager, stellar, self.quadratic(imager, stellar)?))
    }

    /// ln Z, the jitter counted and marginalised over RV offsets of data sets.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn ln_evidence_of_sets(&self, imager: &Imager) -> Result<f64, FieldError> {
        match imager.has_shared_velocities(self.assumed.night_kms) {
            false => Ok(self.ln_evidence()),
            true => Ok(self.expansion(imager, &[])?.log_likelihood),
        }
    }

    fn expanded(&self, imager: &Imager, stellar: &[Parameter], quadratic: Quadratic) -> Expansion {
        let Quadratic { ln_evidence, gradient, information } = quadratic;
        let cycles = imager.cycles();
        Expansion {
            values: self.values,
            centre: coordinates(&self.values, &cycles, stellar),
            cycles,
            stellar: stellar.to_vec(),
            log_likelihood: ln_evidence,
            gradient,
            noise: information.clone(),
            information,
        }
    }

    fn quadratic(&self, imager: &Imager, stellar: &[Parameter]) -> Result<Quadratic, FieldError> {
        let (misfits, slopes) = self.misfits_and_slopes(imager, stellar);
        let of_all = self.settled.evidence.with(&misfits, &slopes)?;
        let quadratic = summed(&of_all, misfits.len(), self.design.response().profiles(), stellar.len());
        self.with_night_offsets(imager, quadratic)
    }

    /// RV offsets of nights are noise of the velocities: all results for these are marginalised over them.
    fn with_night_offsets(&self, imager: &Imager, quadratic: Quadratic) -> Result<Quadratic, FieldError> {
        let offsets = imager.night_offsets(quadratic.gradient.len(), self.assumed.night_kms);
        with_integrated(quadratic, &offsets)
    }

    fn misfits_and_slopes(&self, imager: &Imager, stellar: &[Parameter]) -> (Vec<DVector<f64>>, Vec<DMatrix<f64>>) {
        let epochs = self.design.epochs(imager, &self.settled.coefficients);
        (epochs.into_iter().map(|epoch| epoch.misfit).collect(), self.slopes_of_epochs(imager, stellar))
    }

    /// Derivatives of the coefficients of each epoch with a velocity and with the stellar parameters, at the most
    /// probable maps (coefficients, 1 + parameters).
    pub(super) fn slopes_of_epochs(&self, imager: &Imager, stellar: &[Parameter]) -> Vec<DMatrix<f64>> {
        if stellar.is_empty() {
            return self.velocity_slopes(imager).to_vec();
        }
        let mut slopes = self.design.condensed(&self.slopes(imager, stellar));
        let of_light = self.settled.coefficients.columns_range(slopes.len()..);
        slopes.extend(Light::slopes((imager, &self.basis), &self.values, of_light.as_view(), stellar));
        slopes
    }

    /// Derivatives of the depths of each profile with its velocity and with the stellar parameters, at the most
    /// probable maps (bins, 1 + parameters).
    pub(in crate::surface) fn slopes(&self, imager: &Imager, stellar: &[Parameter]) -> Vec<DMatrix<f64>> {
        self.design.slopes(imager, &self.values, &self.brightness(), stellar)
    }
}

/// The quadratic marginalised over velocities that profiles have in `common`.
pub(super) fn with_integrated(quadratic: Quadratic, common: &[Common]) -> Result<Quadratic, FieldError> {
    if common.is_empty() {
        return Ok(quadratic);
    }
    let columns = DMatrix::from_columns(&common.iter().map(|one| one.of_each.clone()).collect::<Vec<_>>());
    let of_each = |number: fn(&Common) -> f64| DVector::from_iterator(common.len(), common.iter().map(number));
    let (mean, sd) = (of_each(|one| one.mean_kms), of_each(|one| one.sd_kms));
    quadratic.integrated(&columns, &mean, &sd).ok_or(FieldError::NotPositive)
}

impl Design {
    /// Derivatives of the depths of each profile with its velocity and with the stellar parameters (bins, 1 +
    /// parameters) at `values`, for maps of this `brightness` (pixels, profiles).
    pub(super) fn slopes(
        &self,
        imager: &Imager,
        values: &ParameterValues,
        brightness: &DMatrix<f64>,
        stellar: &[Parameter],
    ) -> Vec<DMatrix<f64>> {
        let time_base_d = imager.time_base_cycles() * imager.star.rotation_period_d;
        let derivative = |parameter: Option<Parameter>| {
            let h = parameter.map_or(VELOCITY_STEP_KMS, |p| stellar_step(p, values, time_base_d));
            let at = |h: f64| {
                let mut values = *values;
                values.set(parameter.unwrap_or(Parameter::Vsys), values[parameter.unwrap_or(Parameter::Vsys)] + h);
                self.displaced(imager, parameter, &values).depths_of_each(brightness)
            };
            let (above, below) = (at(h), at(-h));
            above.iter().zip(below).map(|(above, below)| (above - below) / (2.0 * h)).collect::<Vec<f64>>()
        };
        let all: Vec<Option<Parameter>> = std::iter::once(None).chain(stellar.iter().map(|p| Some(*p))).collect();
        let columns: Vec<Vec<f64>> = all.into_par_iter().map(derivative).collect();
        let response = self.response();
        let of_profile = |k: usize| {
            let bins = response.bins(k);
            DMatrix::from_fn(bins.len(), columns.len(), |j, column| columns[column][bins.start + j])
        };
        (0..response.profiles()).map(of_profile).collect()
    }

    fn displaced(&self, imager: &Imager, moved: Option<Parameter>, values: &ParameterValues) -> Response {
        match moved {
            None => imager.with_velocities(self.response(), &values.state()),
            Some(_) => imager.response(&values.state()),
        }
    }
}

/// From coordinates per epoch, velocity first and then the stellar parameters, to the velocities of the profiles, which
/// are the first epochs, and the parameters, which all epochs share.
pub(super) fn summed(of_all: &Quadratic, epochs: usize, profiles: usize, stellar: usize) -> Quadratic {
    if stellar == 0 && epochs == profiles {
        return of_all.clone();
    }
    let mut sums = DMatrix::zeros(epochs * (1 + stellar), profiles + stellar);
    for k in 0..epochs {
        if k < profiles {
            sums[(k * (1 + stellar), k)] = 1.0;
        }
        for s in 0..stellar {
            sums[(k * (1 + stellar) + 1 + s, profiles + s)] = 1.0;
        }
    }
    Quadratic {
        ln_evidence: of_all.ln_evidence,
        gradient: sums.tr_mul(&of_all.gradient),
        information: sums.transpose() * (&of_all.information * &sums),
    }
}
