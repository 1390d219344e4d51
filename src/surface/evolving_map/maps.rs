//! The most probable maps of a fitted field at any times, with their uncertainties (`docs/method.md` section 9).

use super::{Assumed, Basis, Design, Marginal};
use crate::field::{Epoch, Evidence, FieldError, Settled, Sought, approach, settle};
use crate::model::ParameterValues;
use crate::numerics::once;
use crate::surface::imaging::Imager;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Maps at some times.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// Most probable spot filling factor (pixels, times). Below 0 the surface is brighter than the photosphere.
    pub filling: DMatrix<f64>,
    /// Its standard deviation (pixels, times), with the field's parameters held.
    pub sd: DMatrix<f64>,
}

impl Maps {
    /// At any times (d), on the pixels of `basis`, from the most probable maps of the profiles.
    pub fn at(settled: &Settled, basis: &Basis, times_d: &[f64]) -> Self {
        let filling = basis.filling(&settled.evidence.coefficients_at(times_d));
        let mut sd = settled.evidence.standard_deviations(&basis.on_pixels.transpose(), times_d);
        // directions to which no data are sensitive keep their prior
        let unseen = basis.unseen_variances(&settled.evidence.field().spectrum);
        for mut map in sd.column_iter_mut() {
            map.zip_apply(&unseen, |sd, unseen| *sd = sd.hypot(unseen.sqrt()));
        }
        Maps { filling, sd }
    }
}

impl Marginal {
    /// The same maps, without jitter and RV offsets of nights as noise of the profiles.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn without_jitter(&self, imager: &Imager) -> Result<Self, FieldError> {
        let Settled { coefficients, .. } = &self.settled;
        let epochs = self.design.epochs(imager, coefficients);
        let basis = &self.basis;
        let compression = basis.settling.compression;
        let evidence = Evidence::new(self.assumed.field, &basis.degrees, &epochs, coefficients, compression)?;
        let settled = Settled { evidence, ..self.settled.clone() };
        let assumed = Assumed { jitter_kms: 0.0, night_kms: 0.0, ..self.assumed };
        Ok(Marginal { assumed, settled, ..self.clone() })
    }

    /// Maps at `values`, for a star `nearby` with maps of these coefficients (H, epochs), with the jitter as noise of
    /// the profiles along their slopes at the most probable maps. Maps without it explain the jitter by spots, so
    /// slopes and maps are found in turn, so many times: with the slopes of other maps the velocities of the profiles
    /// would seem distinguishable from the jitter.
    ///
    /// # Errors
    /// [`FieldError`].
    pub(super) fn with_jitter(
        (imager, basis): (&Imager, &Arc<Basis>),
        design: Arc<Design>,
        values: ParameterValues,
        assumed: Assumed,
        (nearby, mut coefficients, times): (&Marginal, DMatrix<f64>, usize),
    ) -> Result<Self, FieldError> {
        let sought = Sought { field: assumed.field, degrees: &basis.degrees, watched: &basis.watched };
        let same = Arc::ptr_eq(&design, &nearby.design) && values.state() == nearby.values.state();
        let mut slopes = match same {
            true => nearby.velocity_slopes(imager).to_vec(),
            false => design.velocity_slopes((imager, basis), &values, &coefficients),
        };
        let mut last: Option<Evidence> = None;
        for _ in 1..times {
            // no evidence, as slopes are recomputed
            let linearise = |maps: &DMatrix<f64>| design.jittered(imager, maps, &slopes, assumed.jitter_kms);
            let by = Some(last.as_ref().unwrap_or(&nearby.settled.evidence));
            let way = approach(linearise, sought, coefficients, by, &basis.settling)?;
            coefficients = way.coefficients;
            last = way.last.or(last);
            slopes = design.velocity_slopes((imager, basis), &values, &coefficients);
        }
        let linearise = |maps: &DMatrix<f64>| design.jittered(imager, maps, &slopes, assumed.jitter_kms);
        let by = Some(last.as_ref().unwrap_or(&nearby.settled.evidence));
        let settled = settle(linearise, sought, coefficients, by, &basis.settling)?;
        Ok(Marginal::settled_at((basis, design), values, assumed, settled))
    }

    /// Derivatives of the coefficients of each epoch with a velocity, at the most probable maps (coefficients, 1).
    pub(super) fn velocity_slopes(&self, imager: &Imager) -> &[DMatrix<f64>] {
        let found = || self.design.velocity_slopes((imager, &self.basis), &self.values, &self.settled.coefficients);
        once::found(&self.velocity_slopes, found).as_slice()
    }
}

impl Design {
    /// The same at `values`, for maps of these coefficients (H, epochs). Light curves do not depend on velocity.
    fn velocity_slopes(
        &self,
        (imager, basis): (&Imager, &Basis),
        values: &ParameterValues,
        coefficients: &DMatrix<f64>,
    ) -> Vec<DMatrix<f64>> {
        let mut slopes = match self.known_slopes(&values.state(), coefficients) {
            Some(slopes) => slopes,
            None => self.condensed(&self.slopes(imager, values, &self.brightness(basis, coefficients), &[])),
        };
        slopes.resize(coefficients.ncols(), DMatrix::zeros(1, 1));
        slopes
    }

    /// The epochs around maps of these coefficients (H, epochs), with a jitter along these slopes in their noise.
    fn jittered(&self, imager: &Imager, maps: &DMatrix<f64>, slopes: &[DMatrix<f64>], jitter_kms: f64) -> Vec<Epoch> {
        let shares = imager.jitter_share_of_each().into_iter().chain(std::iter::repeat(1.0));
        let jittered = |((epoch, slopes), share): ((Epoch, &DMatrix<f64>), f64)| {
            Epoch { slopes: slopes.clone(), ..epoch }.jittered(&[share * jitter_kms])
        };
        self.epochs(imager, maps).into_iter().zip(slopes).zip(shares).map(jittered).collect()
    }
}
