//! The uncertainties of observed profiles, from the profiles themselves: from the scatter of the continuum beside the
//! line, and from the residuals of a map in the line.
//!
//! The continuum alone may underestimate them, because LSD profiles are noisier in the core of the line and the model
//! of the star is not perfect; residuals of a map alone may be spots that it lacks. So the larger of the two counts,
//! and both are recorded. For a map it is the smallest factor on the quoted uncertainties with which chi2 falls to 0.97
//! per datum, as with correct uncertainties, before noise is turned into spots. Level and slope of the continuum do not
//! count.
//!
//! Noise that is correlated over n bins, as in LSD profiles, counts as one datum: uncertainties are larger by the root
//! of n, and a target chi2 is meant per independent datum. So the map stays the same, and the uncertainties of orbits
//! become correct. The correlation that counts is that on the scale of the local line, the narrowest feature of a
//! profile; where features are broader and the noise is correlated farther, uncertainties are still a little too small.

use crate::model::{Parameter, ParameterValues};
use crate::star::StarSettings;
use crate::star::observation::{Observations, Profile};
use crate::surface::ReferenceError;
use crate::surface::calibration::first_look::Scatter;
use crate::surface::imaging::Imager;
use crate::surface::static_map::Reference;
use crate::surface::static_map::reference::PROVISIONAL_LAMBDA;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How profiles are weighted against each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Weights {
    /// By the errors in their files.
    #[default]
    Quoted,
    /// By those times how much the continuum of each scatters compared with the others. The errors as a whole stay.
    PerProfile,
}

impl Weights {
    /// Whether it is the default, which configs may omit.
    pub fn is_default(&self) -> bool {
        *self == Weights::default()
    }
}

/// Settings of the uncertainties of observations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorSettings {
    /// Whether the factor on the uncertainties is measured.
    pub measured: bool,
    /// How profiles are weighted.
    pub weights: Weights,
}

/// The measured uncertainties.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredErrors {
    /// Factor on the quoted uncertainties, where it was measured: the larger of the two below times the root of the
    /// number of bins over which noise is correlated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_scale: Option<f64>,
    /// Scatter of the continuum over quoted uncertainties; null where there is too little of it.
    pub continuum: Option<f64>,
    /// Residuals of a map at the config's values over quoted uncertainties, where that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual: Option<f64>,
    /// Number of bins over which the noise of the continuum is correlated, 1 for white noise.
    pub correlated_bins: f64,
    /// Additional factor on the uncertainties of each profile; empty where they are weighted as quoted.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub profiles: Vec<f64>,
}

/// Why the profiles do not constrain them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoiseError {
    /// No continuum for weighting a profile.
    #[error("profile {profile} of the list has too little continuum beside the line, {freedom} bins of {least}")]
    NoContinuum {
        /// The profile, from 1.
        profile: usize,
        /// Available degrees of freedom.
        freedom: usize,
        /// Required degrees of freedom.
        least: usize,
    },
    /// No map at the config's values.
    #[error("{0}")]
    Reference(#[from] ReferenceError),
    /// No factor suffices.
    #[error(
        "no factor on the errors makes a map fit ({0:.3e} is not enough): the model of the star is not \
         that of the profiles"
    )]
    NoMap(f64),
}

impl NoiseError {
    /// The key of the config that requires it.
    pub fn key(&self) -> &'static str {
        match self {
            NoiseError::NoContinuum { .. } => "observations.weights",
            NoiseError::Reference(_) | NoiseError::NoMap(_) => "observations.sigma_scale",
        }
    }
}

/// What is missing where uncertainties are not measured, and how to give it.
pub const NO_CONTINUUM: &str = "too little continuum beside the line to measure the noise. Give profiles of a \
     wider velocity range, or the factor of the quoted uncertainties (observations.sigma_scale)";

/// Fewest degrees of freedom of the continuum, in all profiles together and in one of them: the uncertainties are
/// accurate to 13 and 22 %.
const FEWEST: (usize, usize) = (30, 10);

/// chi2 per datum of a map of profiles with correct uncertainties, at the lambda beyond which noise is turned into
/// spots.
pub const FITTED: f64 = 0.97;

/// The residuals have converged when they change by less than this fraction.
const STAYS: f64 = 0.005;

/// Most maps; three or four are usual.
const MOST_MAPS: usize = 12;

/// Uncertainties with which no map is found are increased by this factor for another attempt.
const FAR_TOO_SMALL: f64 = 3.0;

/// Uncertainties by a map that exceed those by the continuum by more than this indicate a misfit.
const MISFIT: f64 = 1.3;

/// The same where there is no continuum for comparison, but only quoted uncertainties.
const MISFIT_OF_QUOTED: f64 = 2.0;

/// Uncertainties that are too small by more than this, and are the square of the scatter to these factors, look like
/// variances.
const TOO_SMALL: f64 = 8.0;
const VARIANCES: std::ops::RangeInclusive<f64> = 0.5..=2.5;

/// Beyond this many local line widths from the limb there is continuum.
const BEYOND: f64 = 3.0;

/// The uncertainties of `observations`, with their cuts, by their continuum: that of `whole`, the same profiles over
/// their full width, beside the line of `star` at `values`. The factor is that of the continuum for now.
///
/// # Errors
/// [`NoiseError::NoContinuum`].
pub fn by_continuum(
    whole: &Observations,
    star: &StarSettings,
    values: &ParameterValues,
    settings: ErrorSettings,
) -> Result<MeasuredErrors, NoiseError> {
    let reach_kms = values[Parameter::Vsini] + BEYOND * star.line.sigma_kms;
    let of = |profile| Scatter::of(profile, values[Parameter::Vsys], reach_kms);
    let scatter: Vec<Scatter> = whole.profiles.iter().map(of).collect();
    let all: Scatter = scatter.iter().cloned().sum();
    let continuum = all.ratio(FEWEST.0).map(rounded);
    let profiles = match settings.weights {
        Weights::Quoted => Vec::new(),
        Weights::PerProfile => relative(&scatter)?,
    };
    let counts = settings.measured && continuum.is_some();
    let correlated_bins =
        if counts { rounded(all.correlated_bins(star.line.sigma_kms / whole.step_kms())) } else { 1.0 };
    let sigma_scale = continuum.filter(|_| settings.measured).map(|scale| rounded(scale * correlated_bins.sqrt()));
    Ok(MeasuredErrors { sigma_scale, continuum, residual: None, correlated_bins, profiles })
}

/// The scatter of each profile relative to that of all, as far as the continuum constrains it: the logarithms of equal
/// profiles scatter by `1 / (2 freedom)` in variance, and are shrunk together by the fraction of the total scatter that
/// this explains. Mean weights are unchanged.
fn relative(scatter: &[Scatter]) -> Result<Vec<f64>, NoiseError> {
    let ratio = |(k, s): (usize, &Scatter)| {
        let missing = NoiseError::NoContinuum { profile: k + 1, freedom: s.freedom, least: FEWEST.1 };
        s.ratio(FEWEST.1).map(f64::ln).ok_or(missing)
    };
    let logarithms = scatter.iter().enumerate().map(ratio).collect::<Result<Vec<f64>, _>>()?;
    let chance = |s: &Scatter| 0.5 / s.freedom as f64;
    let n = scatter.len() as f64;
    let mean = logarithms.iter().sum::<f64>() / n;
    let variance = logarithms.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let real = (variance - scatter.iter().map(chance).sum::<f64>() / n).max(0.0);
    let drawn = |(l, s): (&f64, &Scatter)| ((l - mean) * real / (real + chance(s))).exp();
    let factors: Vec<f64> = logarithms.iter().zip(scatter).map(drawn).collect();
    let weight = factors.iter().map(|r| r.powi(-2)).sum::<f64>() / n;
    Ok(factors.into_iter().map(|r| rounded(r * weight.sqrt())).collect())
}

impl MeasuredErrors {
    /// Takes the residuals of a map into account. `imager` returns the profiles with uncertainties scaled by the
    /// results so far, times a factor.
    ///
    /// # Errors
    /// The outer error is that of `imager`, the inner one is that there is no map.
    pub fn count_residuals<E>(
        &mut self,
        values: ParameterValues,
        imager: impl Fn(f64) -> Result<Imager, E>,
    ) -> Result<Result<(), NoiseError>, E> {
        let before = self.sigma_scale.unwrap_or(1.0);
        let factor = match factor_to_fit(values, self.correlated_bins, imager)? {
            Ok(factor) => factor,
            Err(NoiseError::NoMap(factor)) => return Ok(Err(NoiseError::NoMap(before * factor))),
            Err(error) => return Ok(Err(error)),
        };
        let root = self.correlated_bins.sqrt();
        let residual = rounded(before * factor / root);
        self.residual = Some(residual);
        self.sigma_scale = Some(rounded(root * self.continuum.unwrap_or(residual).max(residual)));
        Ok(Ok(()))
    }

    /// The ratio of the residuals of a map to the scatter of the continuum, where both were measured.
    pub fn misfit(&self) -> Option<f64> {
        Some(self.residual? / self.continuum?)
    }

    /// Whether uncertainties are so large because the model does not fit.
    pub fn is_misfit(&self) -> bool {
        match self.misfit() {
            Some(misfit) => misfit > MISFIT,
            None => self.residual.is_some_and(|residual| residual > MISFIT_OF_QUOTED),
        }
    }

    /// A sentence on that, where it is true.
    pub fn misfit_text(&self) -> Option<String> {
        let text = match self.misfit() {
            Some(misfit) => format!("Residual rms is {misfit:.1} times the continuum rms"),
            None => format!("Residual rms is {:.1} times the quoted uncertainties", self.residual?),
        };
        self.is_misfit().then(|| format!("{text}: check vsini, line profile and continuum"))
    }

    /// Multiplies the uncertainties of `observations` by all measured factors.
    pub fn apply(&self, observations: &mut Observations) {
        for (k, profile) in observations.profiles.iter_mut().enumerate() {
            let factor = self.sigma_scale.unwrap_or(1.0) * self.profiles.get(k).copied().unwrap_or(1.0);
            profile.sigma.iter_mut().for_each(|sigma| *sigma *= factor);
        }
    }

    /// One line of text.
    pub fn line(&self) -> String {
        let mut line = match (self.continuum, self.residual) {
            (Some(continuum), _) => format!("continuum rms {continuum}"),
            (None, Some(_)) => "too little continuum beside the line".to_owned(),
            (None, None) => return format!("as quoted: {NO_CONTINUUM}"),
        };
        if let Some(scale) = self.sigma_scale {
            let residual = self.residual.map_or_else(String::new, |of_map| format!(", map residuals {of_map}"));
            let together = match self.correlated_bins {
                1.0 => String::new(),
                bins => format!(", noise correlation length {bins} bins"),
            };
            line = format!("rescaled by {scale} ({line} of the quoted uncertainty{residual}{together})");
        }
        let extreme = |f: fn(f64, f64) -> f64| self.profiles.iter().copied().reduce(f).unwrap_or(1.0);
        if !self.profiles.is_empty() {
            line += &format!("; per profile {} to {} times that", extreme(f64::min), extreme(f64::max));
        }
        line
    }
}

/// The remark that uncertainties whose median is `quoted` (in units of the continuum), and which are too small by a
/// `factor`, look like variances, if they do.
pub fn variances(quoted: f64, factor: f64) -> Option<String> {
    let actual = factor * quoted;
    let is_square = VARIANCES.contains(&(actual / quoted.sqrt()));
    (factor > TOO_SMALL && is_square).then(|| {
        format!(
            "the uncertainties of the profiles look like variances: they are {quoted:.1e}, and the profiles scatter by \
            {actual:.1e}, about their root. Give standard deviations, the roots of these numbers"
        )
    })
}

/// The median quoted uncertainty, and the ratio to it of the scatter of bins about a cubic through four neighbours: an
/// upper limit to their noise, because lines that are narrow for the bins scatter likewise. `None` for short profiles.
pub fn by_neighbours(observations: &Observations) -> Option<(f64, f64)> {
    const CUBIC: [(usize, f64); 5] = [(0, 1.0), (1, -4.0), (2, 6.0), (3, -4.0), (4, 1.0)];
    const NORM: f64 = 8.37;
    /// Median of the absolute value of a Gaussian number.
    const MEDIAN: f64 = 0.6745;
    let of = |profile: &Profile| -> Vec<f64> {
        let away = |bins: &[f64]| CUBIC.iter().map(|(j, weight)| weight * bins[*j]).sum::<f64>().abs() / NORM;
        profile.intensity.windows(CUBIC.len()).map(away).collect()
    };
    let middle = |mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    };
    let scatter = middle(observations.profiles.iter().flat_map(of).collect())? / MEDIAN;
    let quoted = middle(observations.profiles.iter().flat_map(|profile| profile.sigma.clone()).collect())?;
    Some((quoted, scatter / quoted))
}

/// The smallest factor on the uncertainties with which a map reaches 0.97 per independent datum before noise is turned
/// into spots. `imager` returns the profiles with uncertainties times a factor.
///
/// # Errors
/// The outer error is that of `imager`, the inner one is that there is no map.
pub fn factor_to_fit<E>(
    values: ParameterValues,
    correlated_bins: f64,
    imager: impl Fn(f64) -> Result<Imager, E>,
) -> Result<Result<f64, NoiseError>, E> {
    let mut factor = 1.0;
    for _ in 0..MOST_MAPS {
        let chi2 = match chi2_at(&imager(factor)?, values, correlated_bins) {
            Ok(chi2) => chi2,
            // uncertainties that are far too small for the model take more steps than a map may
            Err(error) if error.ran_out_of_steps() => {
                factor *= FAR_TOO_SMALL;
                continue;
            }
            Err(error) => return Ok(Err(error.into())),
        };
        let next = factor * (chi2 / FITTED).sqrt();
        let stays = (next / factor - 1.0).abs() < STAYS;
        factor = next;
        if stays {
            return Ok(Ok(factor));
        }
    }
    Ok(Err(NoiseError::NoMap(factor)))
}

/// chi2 per independent datum of the map beyond which noise is turned into spots.
///
/// # Errors
/// If the solver fails.
pub fn chi2_at(imager: &Imager, values: ParameterValues, correlated_bins: f64) -> Result<f64, ReferenceError> {
    let map = Reference::at_lambda(imager, values, PROVISIONAL_LAMBDA * correlated_bins)?;
    Ok(map.solution.chi2 * correlated_bins / imager.data.depth.len() as f64)
}

/// Three digits: the last bits of a fit are not significant, and all later results depend on them.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}
