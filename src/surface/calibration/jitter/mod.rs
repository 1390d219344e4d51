//! The zero points of the profiles' velocities: how much they scatter, and how they are counted as noise of the
//! profiles.
//!
//! A zero point z of Gaussian scatter s moves a profile by z: to first order its depths change by `z D'`, D' their
//! derivative with velocity, and integrated out it adds `s^2 D' D'^t` to the covariance of the profile's bins
//! (`nuisances`). All that follows from the profiles then counts it: images, chi2, orbits, false alarms, chains. D'
//! must not hold the noise of the profiles, and it must hold the spots, which are as steep as the flanks of the line:
//! it is that of the model at a first image, in which zero points of the same scatter are counted with the slopes of a
//! star without spots.
//!
//! How large s is the profiles say themselves (`fit`), in an image in which zero points are counted as far larger than
//! photon noise makes velocities uncertain, so that none of them is taken for spots.

mod fit;

pub use fit::{BesideOrbit, Scatter};

use crate::model::{Parameter, ParameterValues};
use crate::surface::ReferenceError;
use crate::surface::expansion::{Expansion, velocity_slopes};
use crate::surface::imaging::Imager;
use crate::surface::static_map::Reference;
use crate::surface::static_map::reference::PROVISIONAL_LAMBDA;
use serde::{Deserialize, Serialize};

/// Zero points are first counted as this many times what photon noise makes of the velocity of a profile.
const GENEROUS: f64 = 10.0;

/// Where more is found than is counted, all is done again with this many times as much as was found. Much more is of no
/// use: where lines are shifted far, their change is no longer linear in the shift.
const ABOVE_FOUND: f64 = 2.0;

/// Most images of a fit, zero points counted as larger or smaller in each.
const MOST_IMAGES: usize = 4;

/// Step of the derivative of an unspotted star's depths with velocity (km/s).
const STEP_KMS: f64 = 0.02;

/// The scatter of the velocity zero points as the profiles say it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredJitter {
    /// Standard deviation that counts (km/s): that beside the orbit where this is the case, otherwise that without a
    /// planet.
    pub value_kms: f64,
    /// That of stars without a planet.
    pub without_planet: Scatter,
    /// That beside the circular orbit which explains the velocities best; `None` where too few profiles show one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beside_orbit: Option<BesideOrbit>,
}

impl MeasuredJitter {
    /// Of the profiles of `imager` with the star at `values`; the target of chi2 is per datum.
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
                // too far for an expansion to second order
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

    /// From an image in which zero points are counted as that large.
    fn with(imager: &Imager, values: ParameterValues, chi2_target: f64, sd_kms: f64) -> Result<Self, JitterError> {
        let counted = ZeroPoints::new(imager, values, chi2_target, sd_kms)?.counted_in(imager.clone());
        let expansion = Expansion::of(&counted, &image(&counted, values, chi2_target)?, &[]);
        fit::fit(&expansion, sd_kms, imager.star.rotation_period_d).ok_or(JitterError::Unbounded)
    }

    /// It in a line.
    pub fn line(&self) -> String {
        let scatter = |s: &Scatter| format!("{} ± {} km/s", s.kms, s.error_kms);
        let alone = scatter(&self.without_planet);
        let Some(orbit) = &self.beside_orbit else { return format!("{alone} (no planet)") };
        let beside = format!(
            "{} with the best orbit (P = {:.4} P_rot, K = {:.0} m/s, ln B = {:.1})",
            scatter(&orbit.scatter),
            orbit.porb_over_prot,
            1000.0 * orbit.k_kms,
            orbit.ln_odds
        );

        match orbit.counts {
            true => format!("{beside}; {alone} (no planet)"),
            false => format!("{alone} (no planet); {beside}"),
        }
    }
}

/// Why the profiles do not say how large it is.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum JitterError {
    /// No image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// Velocities without bounds, or none at all.
    #[error("\"fitted\" needs three profiles with constrained RVs: give a number (0: stable spectrograph)")]
    Unbounded,
}

/// Zero points that are counted as noise.
#[derive(Clone, Debug)]
pub struct ZeroPoints {
    /// Their standard deviation (km/s).
    pub sd_kms: f64,
    /// How the depths change with velocity.
    slopes: Vec<f64>,
}

impl ZeroPoints {
    /// Of this standard deviation in the profiles of `imager`; the image for their slopes is at `values` and the target
    /// chi2, per datum.
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

    /// `imager`, of the same profiles, with them counted.
    pub fn counted_in(&self, imager: Imager) -> Imager {
        imager.with_zero_points(self.sd_kms, &self.slopes)
    }
}

/// The image at the target chi2, or as close as it comes before noise is turned into spots. Where zero points of that
/// size explain all but a star without spots, it is the one at which noise would be.
fn image(imager: &Imager, values: ParameterValues, chi2_target: f64) -> Result<Reference, ReferenceError> {
    match Reference::provisional(imager, values, chi2_target) {
        Err(ReferenceError::NothingToFit { .. }) => {
            Reference::at_lambda(imager, values, PROVISIONAL_LAMBDA * imager.data.correlated_bins)
        }
        reference => reference,
    }
}

/// How the depths of a star without spots change with velocity.
fn unspotted_slopes(imager: &Imager, values: &ParameterValues) -> Vec<f64> {
    let depths = |h: f64| {
        let mut values = *values;
        values.set(Parameter::Vsys, values[Parameter::Vsys] + h);
        imager.response(&values.state()).depths(&vec![1.0; imager.grid.len()])
    };
    let (above, below) = (depths(STEP_KMS), depths(-STEP_KMS));
    above.iter().zip(below).map(|(a, b)| (a - b) / (2.0 * STEP_KMS)).collect()
}

/// What photon noise makes of the velocity of a profile with such slopes (km/s), root mean square; `None` without a
/// line.
fn photon_error_kms(imager: &Imager, slopes: &[f64]) -> Option<f64> {
    let information: f64 = slopes.iter().zip(&imager.data.inverse_variance).map(|(d, w)| d * d * w).sum();
    let error = (imager.profiles().count() as f64 / information).sqrt();
    error.is_finite().then_some(error)
}
