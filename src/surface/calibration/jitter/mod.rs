//! The RV jitter: its size, and how it is counted as noise of the profiles.
//!
//! An RV offset z of a profile, with Gaussian jitter s, shifts the profile by z: to first order its depths change by `z
//! D'`, D' their derivative with velocity, and marginalised over z it adds `s^2 D' D'^t` to the covariance of the
//! profile's bins (`nuisances`). All results from the profiles then include it: images, chi2, orbits, false-alarm
//! probabilities, chains. D' must not contain the noise of the profiles, and must contain the spots, which are as steep
//! as the flanks of the line: it is that of the model at a first image, which counts the same jitter with the slopes of
//! a star without spots.
//!
//! The profiles themselves constrain s (`fit`), in an image that counts a jitter far larger than the velocity
//! uncertainties by photon noise, so that none of it is absorbed by spots.

mod fit;

pub use fit::{BesideOrbit, Scatter};

use crate::model::{Parameter, ParameterValues};
use crate::planets::speeds::with_unit;
use crate::surface::ReferenceError;
use crate::surface::expansion::{Expansion, velocity_slopes};
use crate::surface::imaging::Imager;
use crate::surface::static_map::Reference;
use crate::surface::static_map::reference::PROVISIONAL_LAMBDA;
use serde::{Deserialize, Serialize};

/// The jitter that is counted first, in units of the velocity uncertainty of a profile by photon noise.
const GENEROUS: f64 = 10.0;

/// Where more is found than is counted, the fit is repeated with this many times the result. A much larger factor does
/// not help: for large shifts of the line the change is no longer linear in the shift.
const ABOVE_FOUND: f64 = 2.0;

/// Most images of a fit, each with another jitter counted.
const MOST_IMAGES: usize = 4;

/// Step of the derivative of an unspotted star's depths with velocity (km/s).
const STEP_KMS: f64 = 0.02;

/// The RV jitter as measured from the profiles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredJitter {
    /// The adopted standard deviation (km/s): that with the orbit if its odds suffice, otherwise that without a planet.
    pub value_kms: f64,
    /// The jitter without a planet.
    pub without_planet: Scatter,
    /// The jitter with the circular orbit that explains the velocities best; `None` where too few profiles show one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beside_orbit: Option<BesideOrbit>,
}

impl MeasuredJitter {
    /// Measures it from the profiles of `imager` with the star at `values`; the target of chi2 is per datum.
    ///
    /// # Errors
    /// [`JitterError`].
    pub fn of(imager: &Imager, values: ParameterValues, chi2_target: f64) -> Result<Self, JitterError> {
        let photons = photon_error_kms(imager, &unspotted_slopes(imager, &values)).ok_or(JitterError::Unbounded)?;
        let with = |sd_kms: f64| MeasuredJitter::with(imager, values, chi2_target, sd_kms);
        let mut sd_kms = GENEROUS * photons;
        let mut found = with(sd_kms);
        for _ in 1..MOST_IMAGES {
            match &found {
                // too large for an expansion to second order
                Err(JitterError::Unbounded) => sd_kms *= 0.5,
                Ok(jitter) if jitter.without_planet.kms > sd_kms => sd_kms = ABOVE_FOUND * jitter.without_planet.kms,
                _ => break,
            }
            found = match (with(sd_kms), found) {
                (Err(JitterError::Unbounded), Ok(found)) => return Ok(found),
                (next, _) => next,
            };
        }
        found
    }

    /// From an image that counts this jitter.
    fn with(imager: &Imager, values: ParameterValues, chi2_target: f64, sd_kms: f64) -> Result<Self, JitterError> {
        let counted = ZeroPoints::new(imager, values, chi2_target, sd_kms)?.counted_in(imager.clone());
        let expansion = Expansion::of(&counted, &image(&counted, values, chi2_target)?, &[]);
        fit::fit(&expansion, sd_kms, imager.star.rotation_period_d).ok_or(JitterError::Unbounded)
    }

    /// One line of text.
    pub fn line(&self) -> String {
        let scatter = |s: &Scatter| format!("{} ± {} km/s", s.kms, s.error_kms);
        let alone = scatter(&self.without_planet);
        let Some(orbit) = &self.beside_orbit else { return format!("{alone} (no planet)") };
        let beside = format!(
            "{} with the best orbit (P = {:.4} P_rot, K = {}, ln B = {:.1})",
            scatter(&orbit.scatter),
            orbit.porb_over_prot,
            with_unit(orbit.k_kms),
            orbit.ln_odds
        );

        match orbit.counts {
            true => format!("{beside}; {alone} (no planet)"),
            false => format!("{alone} (no planet); {beside}"),
        }
    }
}

/// Why the profiles do not constrain it.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum JitterError {
    /// No image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// Velocities without bounds, or none at all.
    #[error("\"fitted\" needs three profiles with constrained RVs: give a number (0: stable spectrograph)")]
    Unbounded,
}

/// An RV jitter that is counted as noise.
#[derive(Clone, Debug)]
pub struct ZeroPoints {
    /// Its standard deviation (km/s).
    pub sd_kms: f64,
    /// Derivatives of the depths with velocity.
    slopes: Vec<f64>,
}

impl ZeroPoints {
    /// A jitter of this standard deviation in the profiles of `imager`; the image for their slopes is at `values` and
    /// the target chi2, per datum.
    ///
    /// # Errors
    /// If there is no such image.
    pub fn new(
        imager: &Imager,
        values: ParameterValues,
        chi2_target: f64,
        sd_kms: f64,
    ) -> Result<Self, ReferenceError> {
        let unspotted = ZeroPoints { sd_kms, slopes: unspotted_slopes(imager, &values) };
        let imager = unspotted.counted_in(imager.clone());
        let slopes = velocity_slopes(&imager, &image(&imager, values, chi2_target)?);
        Ok(ZeroPoints { sd_kms, slopes })
    }

    /// `imager`, of the same profiles, with the jitter counted.
    pub fn counted_in(&self, imager: Imager) -> Imager {
        imager.with_zero_points(self.sd_kms, &self.slopes)
    }
}

/// The image at the target chi2, or as close as possible before noise is turned into spots. Where a jitter of that size
/// explains everything without spots, it is the one at which noise would be.
fn image(imager: &Imager, values: ParameterValues, chi2_target: f64) -> Result<Reference, ReferenceError> {
    match Reference::provisional(imager, values, chi2_target) {
        Err(ReferenceError::NothingToFit { .. }) => {
            Reference::at_lambda(imager, values, PROVISIONAL_LAMBDA * imager.data.correlated_bins)
        }
        reference => reference,
    }
}

/// Derivatives with velocity of the depths of a star without spots.
fn unspotted_slopes(imager: &Imager, values: &ParameterValues) -> Vec<f64> {
    let depths = |h: f64| {
        let mut values = *values;
        values.set(Parameter::Vsys, values[Parameter::Vsys] + h);
        imager.response(&values.state()).depths(&vec![1.0; imager.grid.len()])
    };
    let (above, below) = (depths(STEP_KMS), depths(-STEP_KMS));
    above.iter().zip(below).map(|(a, b)| (a - b) / (2.0 * STEP_KMS)).collect()
}

/// The uncertainty of the velocity of a profile with such slopes by photon noise (km/s), root mean square; `None`
/// without a line.
fn photon_error_kms(imager: &Imager, slopes: &[f64]) -> Option<f64> {
    let information: f64 = slopes.iter().zip(&imager.data.inverse_variance).map(|(d, w)| d * d * w).sum();
    let error = (imager.profiles().count() as f64 / information).sqrt();
    error.is_finite().then_some(error)
}
