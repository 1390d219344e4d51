//! The maps of a surface model, and the results from them: model profiles, radial velocities before and after
//! subtraction of the spots (Petit et al. 2015, section 3), and statistics of the fit.

use super::checks::{Checks, Residual};
use super::evolving_map::{FluxFit, NoFit, ReadingFit};
use super::imaging::Imager;
use super::nuisances::LineAndContinuum;
use super::static_map::ReferenceError;
use super::{FilteredVelocity, Linearised, SpotField};
use crate::model::ParameterValues;
use crate::numerics::json::{Part, number_or_null, part};
use crate::sampling::log_density::Status;
use crate::star::observation::{Observations, Profile};
use serde::{Deserialize, Serialize};

/// Maps of a star, and their models of the data.
#[derive(Clone, Debug)]
pub struct SurfaceMaps {
    /// The maps in the order of time: one, one per season, or one at each requested time.
    pub maps: Vec<SurfaceMap>,
    /// Model intensity of every bin, one vector per profile, in units of the continuum; including its nuisances, if
    /// any.
    pub model: Vec<Vec<f64>>,
    /// The same for static spots, where the maps evolve; `None` otherwise, and where no static map is found.
    pub static_model: Option<Vec<Vec<f64>>>,
    /// Radial velocities, one per profile.
    pub velocities: Vec<VelocityWithoutSpots>,
    /// Posterior mean of the nuisances of each profile, given its map; empty without marginalisation over them.
    #[doc(hidden)]
    pub nuisances: Vec<LineAndContinuum>,
    /// Posterior mean of each profile's velocity offset by the RV jitter (km/s), given its map; empty where there is no
    /// jitter.
    pub zero_points_kms: Vec<f64>,
    /// Light curves with the model of the maps; usually none.
    #[doc(hidden)]
    pub light: Vec<FluxFit>,
    /// Activity indicators in use with the model of the maps; usually none.
    #[doc(hidden)]
    pub readings: Vec<ReadingFit>,
    /// Images of other chi2, in order of falling chi2, where there is a target.
    #[doc(hidden)]
    pub trade_off: Vec<TradeOffNode>,
    /// The field of spots, if the model has one.
    pub field: Option<SpotField>,
    /// The star linearised with these maps, where they evolve.
    #[doc(hidden)]
    pub here: Option<Linearised>,
    /// Warnings on maps and times.
    pub warnings: Vec<String>,
    /// The statistics.
    pub summary: MapSummary,
    /// Whether the residuals look like noise.
    #[doc(hidden)]
    pub checks: Checks,
}

/// One map.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMap {
    /// Time (d), for an evolving map.
    pub time_d: Option<f64>,
    /// Values of the pixels: the spot filling factor, below 0 where the surface is brighter than the photosphere; or
    /// the brightness.
    pub pixels: Vec<f64>,
    /// Its standard deviation, with the field's parameters held; `None` where there is none.
    pub sigma: Option<Vec<f64>>,
}

/// The velocity of one profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityWithoutSpots {
    /// Its first moment, and that of the model.
    pub moments: FilteredVelocity,
    /// The most likely velocity relative to the systemic one, marginalised over maps, whatever the assumed orbit, and
    /// its standard error, which is correlated with those of other profiles (km/s); NaN where the data do not bound it,
    /// `None` for a static map.
    pub marginalised_kms: Option<[f64; 2]>,
}

/// Statistics of the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapSummary {
    /// The end of the reconstruction.
    pub status: Status,
    /// chi2.
    pub chi2: f64,
    /// chi2 over the number of data.
    pub chi2_per_datum: f64,
    /// That of static spots, where the maps evolve and a static one exists; absent otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chi2_per_datum_unchanging: Option<f64>,
    /// The maximum-entropy image, if the map is one.
    #[serde(flatten, deserialize_with = "part", skip_serializing_if = "Option::is_none")]
    pub image: Option<ImageSummary>,
    /// Number of profiles.
    pub profiles: usize,
    /// Number of data.
    pub data: usize,
    /// Number of pixels.
    pub pixels: usize,
    /// Equivalent width of the local line (km/s).
    pub equivalent_width_kms: f64,
    /// Brightness of a spot over that of the photosphere.
    pub contrast: f64,
    /// The parameters at which the star was reconstructed.
    pub parameters: ParameterValues,
    /// Standard deviation of the first moments (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub observed_rv_rms_kms: f64,
    /// Standard deviation of the first moments minus those of the model (km/s), where that is meaningful.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filtered_rv_rms_kms: Option<f64>,
    /// Root mean square of the photon-noise uncertainties of the first moments (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub photon_rv_error_kms: f64,
    /// Standard deviation of the velocities marginalised over maps (km/s), where available.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rv_rms_kms: Option<f64>,
    /// Root mean square of their uncertainties (km/s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rv_error_kms: Option<f64>,
    /// Root mean square of observed minus modelled intensity.
    pub residual_rms: f64,
    /// The same over the core of the line: bins where the model is deeper than half its greatest depth.
    #[serde(deserialize_with = "number_or_null")]
    pub residual_rms_core: f64,
    /// Root mean square of the standard errors of the intensities, scaled according to the config.
    pub sigma_rms: f64,
}

/// Statistics of a maximum-entropy map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageSummary {
    /// Target of chi2.
    pub chi2_target: f64,
    /// Lagrange multiplier of chi2 / 2.
    pub lambda: f64,
    /// `1 / lambda`.
    pub alpha: f64,
    /// Entropy.
    pub entropy: f64,
    /// Fractional spot coverage; of an image of bright and dark pixels, root mean square of brightness minus 1.
    pub spottedness: f64,
    /// For an image of bright and dark pixels, the parts darker and brighter than the photosphere.
    #[serde(flatten, deserialize_with = "part", skip_serializing_if = "Option::is_none")]
    pub deviation: Option<Deviation>,
    /// Skilling & Bryan's TEST, 0 at a maximum-entropy image.
    pub test: f64,
    /// Applications of the response or its transpose, including those for the trade-off curve.
    #[serde(alias = "passes")]
    pub model_applications: u32,
    /// Newton steps of the last, exact solution.
    pub newton_steps: usize,
}

impl Part for ImageSummary {
    const KEYS: &'static [&'static str] = &[
        "chi2_target",
        "lambda",
        "alpha",
        "entropy",
        "spottedness",
        "darkness",
        "brightness_excess",
        "test",
        "model_applications",
        "passes",
        "newton_steps",
    ];
}

/// Deviation from the brightness of the photosphere, means over the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Mean brightness deficit of pixels, 0 for bright ones.
    pub darkness: f64,
    /// Mean brightness excess, 0 for dark ones.
    pub brightness_excess: f64,
}

impl Part for Deviation {
    const KEYS: &'static [&'static str] = &["darkness", "brightness_excess"];
}

/// One image on the trade-off curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TradeOffNode {
    /// Lagrange multiplier of chi2 / 2.
    pub lambda: f64,
    /// chi2.
    pub chi2: f64,
    /// Spottedness.
    pub spottedness: f64,
    /// Entropy.
    pub entropy: f64,
}

/// Why there are no maps.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoMaps {
    /// The target chi2 is not reached.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// There is no most probable field.
    #[error(transparent)]
    Fit(#[from] NoFit),
    /// No map is available at these times.
    #[error("{0}")]
    Times(&'static str),
    /// The profiles show no spots.
    #[error(
        "the amplitude of the spots falls to the lower bound of its search, {0:.2}: the profiles show no spots; \
        observations.sigma_scale may be too large"
    )]
    TooFaint(f64),
}

impl NoMaps {
    /// A status for it; `None` where the error is sufficient.
    pub fn status(&self) -> Option<&'static str> {
        match self {
            NoMaps::Fit(error) => Some(error.status()),
            NoMaps::TooFaint(_) => Some("amplitude-at-bound"),
            NoMaps::Times(_) => Some("no-such-times"),
            NoMaps::Reference(_) => None,
        }
    }
}

/// Model profiles compared with the observed ones.
pub(super) struct Against<'a> {
    pub imager: &'a Imager,
    pub observations: &'a Observations,
    /// The parameters of the model.
    pub values: ParameterValues,
    /// Residuals of every profile, with its time.
    pub residuals: Vec<(f64, Vec<Residual>)>,
    /// First moments.
    pub moments: Vec<FilteredVelocity>,
}

impl<'a> Against<'a> {
    /// From model profiles of these depths.
    pub fn new(imager: &'a Imager, observations: &'a Observations, values: ParameterValues, depths: &[&[f64]]) -> Self {
        let state = values.state();
        let moments = |(profile, depth): (&Profile, &&[f64])| {
            let cycle = imager.star.cycle(profile.time_d);
            FilteredVelocity {
                time_d: profile.time_d,
                cycle,
                observed: profile.first_moment(),
                modelled_kms: profile.first_moment_of(depth),
                orbit_kms: state.vsys_kms + state.motion.velocity_kms(cycle),
            }
        };
        let moments = observations.profiles.iter().zip(depths).map(moments).collect();
        Against { imager, observations, values, residuals: residuals(observations, depths), moments }
    }

    fn all(&self) -> impl Iterator<Item = &Residual> {
        self.residuals.iter().flat_map(|(_, residuals)| residuals)
    }

    /// chi2.
    pub fn chi2(&self) -> f64 {
        self.all().map(|r| r.scaled * r.scaled).sum()
    }

    /// The statistics common to all maps, with this chi2.
    pub fn summary(&self, status: Status, chi2: f64) -> MapSummary {
        let Against { imager, observations, values, moments, .. } = self;
        let star = imager.star.with(&values.state().surface);
        let deepest = self.all().map(|r| r.depth).fold(0.0, f64::max);
        let core = || self.all().filter(|r| r.depth > 0.5 * deepest);
        MapSummary {
            status,
            chi2,
            chi2_per_datum: chi2 / observations.len() as f64,
            chi2_per_datum_unchanging: None,
            image: None,
            profiles: observations.profiles.len(),
            data: observations.len(),
            pixels: imager.grid.len(),
            equivalent_width_kms: star.line.strength_kms(),
            contrast: star.contrast,
            parameters: *values,
            observed_rv_rms_kms: scatter(moments.iter().map(|v| v.observed.value_kms)),
            filtered_rv_rms_kms: None,
            photon_rv_error_kms: rms(moments.iter().map(|v| v.observed.sigma_kms)),
            rv_rms_kms: None,
            rv_error_kms: None,
            residual_rms: rms(self.all().map(|r| r.difference)),
            residual_rms_core: rms(core().map(|r| r.difference)),
            sigma_rms: rms(observations.profiles.iter().flat_map(|p| p.sigma.iter().copied())),
        }
    }
}

/// Residuals of every profile, with its time.
fn residuals(observations: &Observations, depths: &[&[f64]]) -> Vec<(f64, Vec<Residual>)> {
    let of = |(profile, depths): (&Profile, &&[f64])| {
        let residual = |((intensity, sigma), depth): ((&f64, &f64), &f64)| {
            let difference = intensity - (1.0 - depth);
            Residual { depth: *depth, difference, scaled: difference / sigma }
        };
        (profile.time_d, profile.intensity.iter().zip(&profile.sigma).zip(depths.iter()).map(residual).collect())
    };
    observations.profiles.iter().zip(depths).map(of).collect()
}

/// Root mean square.
pub(super) fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = x.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x * x));
    (sum / n).sqrt()
}

/// Root mean square about the mean.
pub(super) fn scatter(x: impl Iterator<Item = f64> + Clone) -> f64 {
    let mean = x.clone().sum::<f64>() / x.clone().count() as f64;
    rms(x.map(|x| x - mean))
}
