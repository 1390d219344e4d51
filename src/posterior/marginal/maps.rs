//! The most probable maps of a fitted field at any times, with their errors (`docs/method.md` section 9).

use super::{Assumed, Basis, Marginal};
use crate::field::{Epoch, Evidence, FieldError, Settled, Sought, approach, settle};
use crate::posterior::imaging::Imager;
use nalgebra::DMatrix;

/// Maps at some times.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// Most probable spot filling factor (pixels, times). Below 0 it is brighter than the photosphere.
    pub filling: DMatrix<f64>,
    /// Its standard deviation (pixels, times), what is assumed of the field held.
    pub sd: DMatrix<f64>,
}

impl Maps {
    /// At any times (d), on the pixels of `basis`, from the most probable maps of the profiles.
    pub fn at(settled: &Settled, basis: &Basis, times_d: &[f64]) -> Self {
        let filling = basis.filling(&settled.evidence.coefficients_at(times_d));
        let sd = settled.evidence.standard_deviations(&basis.on_pixels.transpose(), times_d);
        Maps { filling, sd }
    }
}

impl Marginal {
    /// The same maps, the jitter no noise of the profiles.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn without_jitter(&self, imager: &Imager, basis: &Basis) -> Result<Self, FieldError> {
        let Settled { coefficients, .. } = &self.settled;
        let epochs = self.design.epochs(imager, coefficients);
        let compression = basis.settling.compression;
        let evidence = Evidence::new(self.assumed.field, &basis.degrees, &epochs, coefficients, compression)?;
        let settled = Settled { evidence, ..self.settled.clone() };
        Ok(Marginal { assumed: Assumed { jitter_kms: 0.0, ..self.assumed }, settled, ..self.clone() })
    }

    /// The same where the jitter is noise of the profiles, along their slopes at the most probable maps. Maps that know
    /// nothing of it explain zero points by spots, so slopes and maps are found in turn, so many times: slopes of other
    /// maps than these would seem to tell the velocities of the profiles from their zero points.
    ///
    /// # Errors
    /// [`FieldError`].
    pub(super) fn with_jitter(mut self, imager: &Imager, basis: &Basis, times: usize) -> Result<Self, FieldError> {
        let sought = Sought { field: self.assumed.field, degrees: &basis.degrees, watched: &basis.watched };
        let mut last: Option<Evidence> = None;
        for left in (0..times).rev() {
            let slopes = self.slopes_of_epochs(imager, basis, &[]);
            let jittered = |(epoch, slopes): (Epoch, &DMatrix<f64>)| {
                Epoch { slopes: slopes.clone(), ..epoch }.jittered(&[self.assumed.jitter_kms])
            };
            let linearise =
                |maps: &DMatrix<f64>| self.design.epochs(imager, maps).into_iter().zip(&slopes).map(jittered).collect();
            let start = self.settled.coefficients.clone();
            let nearby = Some(last.as_ref().unwrap_or(&self.settled.evidence));
            if left > 0 {
                // the evidence of slopes that are found anew is not needed
                let way = approach(linearise, sought, start, nearby, &basis.settling)?;
                self.settled.coefficients = way.coefficients;
                last = way.last.or(last);
            } else {
                self.settled = settle(linearise, sought, start, nearby, &basis.settling)?;
            }
        }
        Ok(self)
    }
}
