//! How large the errors of observed profiles are, from the profiles themselves: by how much the continuum beside the
//! line scatters, and by how much a map leaves the line unfitted.
//!
//! The continuum alone may promise too much, for in the core of the line LSD profiles are noisier and the model of the
//! star is not perfect; what a map leaves over alone may be spots that it lacks. So the larger of the two counts, and
//! both are written down. Of a map it is the smallest factor on the quoted errors with which it comes down to 0.97 per
//! datum, as one of right errors does, before noise is turned into spots. Level and slope of the continuum do not
//! count.
//!
//! Noise correlated over n bins, as that of LSD profiles may, counts for one: errors are larger by the root of
//! n, and a target chi2 is meant per independent datum, so that the map stays what it was and errors of orbits become
//! what they are. What counts is noise that looks like the local line, for nothing in a profile is narrower; where
//! features are broader and the noise is correlated farther, errors are still a little too small.

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
    /// Whether it is the default, which configs need not mention.
    pub fn is_default(&self) -> bool {
        *self == Weights::default()
    }
}

/// What observations are to say of their errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorSettings {
    /// Whether the factor on the errors is measured.
    pub measured: bool,
    /// How profiles are weighted.
    pub weights: Weights,
}

/// What they said.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredErrors {
    /// Factor on the quoted errors, where it was measured: the larger of the two below times the root of the
    /// number of bins over which noise is correlated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_scale: Option<f64>,
    /// Scatter of the continuum over quoted errors; null where there is too little of it.
    pub continuum: Option<f64>,
    /// What a map at the config's values leaves over, over quoted errors, where that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub residual: Option<f64>,
    /// Over how many bins the noise of the continuum is correlated, 1 for white noise.
    pub correlated_bins: f64,
    /// Factor on the errors of each profile beside that; empty where they are weighted as quoted.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub profiles: Vec<f64>,
}

/// Why the profiles do not say.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoiseError {
    /// No continuum to weight a profile by.
    #[error("profile {profile} of the list has too little continuum beside the line, {freedom} bins of {least}")]
    NoContinuum {
        /// The profile, from 1.
        profile: usize,
        /// Degrees of freedom that there are.
        freedom: usize,
        /// As many as it takes.
        least: usize,
    },
    /// No map at the config's values.
    #[error("{0}")]
    Reference(#[from] ReferenceError),
    /// No factor is enough.
    #[error(
        "no factor on the errors makes a map fit ({0:.3e} is not enough): the model of the star is not \
         that of the profiles"
    )]
    NoMap(f64),
}

impl NoiseError {
    /// The key of the config that asks for it.
    pub fn key(&self) -> &'static str {
        match self {
            NoiseError::NoContinuum { .. } => "observations.weights",
            NoiseError::Reference(_) | NoiseError::NoMap(_) => "observations.sigma_scale",
        }
    }
}

/// What is missing where errors are not measured, and how to give it.
pub const NO_CONTINUUM: &str = "too little continuum beside the line to measure them by. Give profiles that reach \
     farther, or observations.sigma_scale as a number";

/// Fewest degrees of freedom of the continuum, in all profiles together and in one of them: errors are good to 13 and
/// 22 %.
const FEWEST: (usize, usize) = (30, 10);

/// chi2 per datum of a map of profiles whose errors are right, at the lambda beyond which noise is turned into spots.
pub const FITTED: f64 = 0.97;

/// The residuals stay when they move by less than this part.
const STAYS: f64 = 0.005;

/// Most maps; it takes three or four.
const MOST_MAPS: usize = 12;

/// Errors with which no map is found are tried again larger by this.
const FAR_TOO_SMALL: f64 = 3.0;

/// Errors of a map larger than those of the continuum by more than this have a reason.
const MISFIT: f64 = 1.3;

/// The same where there is no continuum to hold them against, but only errors as quoted.
const MISFIT_OF_QUOTED: f64 = 2.0;

/// Uncertainties that are too small by more than this, and are the square of the scatter to these factors, look like
/// variances.
const TOO_SMALL: f64 = 8.0;
const VARIANCES: std::ops::RangeInclusive<f64> = 0.5..=2.5;

/// Beyond this many local line widths from the limb there is continuum.
const BEYOND: f64 = 3.0;

/// The errors of `observations`, cut as they are used, by their continuum: that of `whole`, the same profiles in their
/// whole width, beside the line of `star` at `values`. The factor is that of the continuum for now.
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

/// The scatter of each profile over that of them all, as far as the continuum knows it: the logarithms of equal
/// profiles scatter by `1 / (2 freedom)` in variance, and are drawn together by the share that this has in the scatter
/// there is. Mean weights stay.
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
    /// Takes the residuals of a map into account. `imager` is of the profiles with errors scaled by what was measured
    /// so far, times a factor.
    ///
    /// # Errors
    /// The outer ones are those of `imager`, the inner ones say that there is no map.
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

    /// By how much the residuals of a map are larger than the scatter of the continuum, where both were measured.
    pub fn misfit(&self) -> Option<f64> {
        Some(self.residual? / self.continuum?)
    }

    /// Whether errors are so large because the model does not fit.
    pub fn is_misfit(&self) -> bool {
        match self.misfit() {
            Some(misfit) => misfit > MISFIT,
            None => self.residual.is_some_and(|residual| residual > MISFIT_OF_QUOTED),
        }
    }

    /// That in a sentence, where it is so.
    pub fn misfit_text(&self) -> Option<String> {
        let text = match self.misfit() {
            Some(misfit) => format!("Residual rms is {misfit:.1} times the continuum rms"),
            None => format!("Residual rms is {:.1} times the quoted uncertainties", self.residual?),
        };
        self.is_misfit().then(|| format!("{text}: check vsini, line profile and continuum"))
    }

    /// Multiplies the errors of `observations` by all that was measured.
    pub fn apply(&self, observations: &mut Observations) {
        for (k, profile) in observations.profiles.iter_mut().enumerate() {
            let factor = self.sigma_scale.unwrap_or(1.0) * self.profiles.get(k).copied().unwrap_or(1.0);
            profile.sigma.iter_mut().for_each(|sigma| *sigma *= factor);
        }
    }

    /// It in a line.
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

/// That uncertainties whose median is `quoted` (in units of the continuum), and which are too small by a `factor`, look
/// like variances, if they do.
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

/// The median uncertainty as quoted, and by how much more than that bins scatter about a cubic through four neighbours:
/// an upper limit to their noise, as lines that are narrow for the bins scatter likewise. `None` of short profiles.
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

/// The smallest factor on the errors with which a map comes down to 0.97 per independent datum before noise is turned
/// into spots. `imager` is of the profiles with errors times a factor.
///
/// # Errors
/// The outer ones are those of `imager`, the inner ones say that there is no map.
pub fn factor_to_fit<E>(
    values: ParameterValues,
    correlated_bins: f64,
    imager: impl Fn(f64) -> Result<Imager, E>,
) -> Result<Result<f64, NoiseError>, E> {
    let mut factor = 1.0;
    for _ in 0..MOST_MAPS {
        let chi2 = match chi2_at(&imager(factor)?, values, correlated_bins) {
            Ok(chi2) => chi2,
            // errors that are far too small for the model take more steps than a map may
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

/// To three digits: the last bits of a fit mean nothing, and everything after it hangs on them.
fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}
