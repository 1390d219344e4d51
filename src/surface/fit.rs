//! One reconstruction held against the data: its map and model profiles, first-moment velocities before and after the
//! model is taken out of them (Petit et al. 2015, section 3), and the numbers by which the fit is judged. The same of a
//! star that may change is in `changing`.

mod changing;
mod checks;

pub(in crate::surface) use changing::explained;
pub use changing::{ChangingFit, ChangingSummary, MapAt, NoField, VelocityWithoutSpots};
pub use checks::{Checks, ProfileCheck};

use crate::maxent::entropy::Entropy;
use crate::maxent::{Problem, Termination, parallelism};
use crate::model::ParameterValues;
use crate::numerics::json::number_or_null;
use crate::sampling::log_density::Status;
use crate::star::observation::Observations;
use crate::surface::FilteredVelocity;
use crate::surface::imaging::Imager;
use crate::surface::nuisances::{Estimate, LineAndContinuum};
use crate::surface::static_map::Reference;
use crate::surface::static_map::tradeoff::Node;
use serde::{Deserialize, Serialize};

/// A reconstruction and what it makes of the data.
#[derive(Clone, Debug)]
pub struct Fit {
    /// What the map holds: spot filling factor or brightness of every pixel.
    pub map: Vec<f64>,
    /// Model intensity of every bin, one vector a profile, in units of the continuum; with its nuisances, where there
    /// are any.
    pub model: Vec<Vec<f64>>,
    /// Posterior mean of the nuisances of each profile, given the map; empty where none are integrated out.
    #[doc(hidden)]
    pub nuisances: Vec<LineAndContinuum>,
    /// Posterior mean of each profile's velocity zero point (km/s), given the map; empty where none is integrated out.
    pub zero_points_kms: Vec<f64>,
    /// Radial velocities, one a profile.
    pub velocities: Vec<FilteredVelocity>,
    /// Nodes of the trade-off curve, in order of falling chi2.
    #[doc(hidden)]
    pub tradeoff: Vec<Node>,
    /// The numbers.
    pub summary: FitSummary,
    /// Whether what is left over looks like noise.
    #[doc(hidden)]
    pub checks: Checks,
}

/// What is left over in one bin.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Residual {
    /// Depth of the model.
    depth: f64,
    /// Observed minus modelled intensity.
    difference: f64,
    /// The same over its standard error.
    scaled: f64,
}

/// How good the fit is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitSummary {
    /// How the reconstruction ended.
    pub status: Status,
    /// chi2.
    pub chi2: f64,
    /// chi2 over the number of data.
    pub chi2_per_datum: f64,
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
    /// Of an image of bright and dark pixels, what is darker and what is brighter than the photosphere.
    #[serde(flatten, default, skip_serializing_if = "Option::is_none")]
    pub deviation: Option<Deviation>,
    /// Skilling & Bryan's TEST, 0 at a maximum-entropy image.
    pub test: f64,
    /// Applications of the response or its transpose, those for the trade-off curve included.
    #[serde(alias = "passes")]
    pub model_applications: u32,
    /// Newton steps of the last, exact solution.
    pub newton_steps: usize,
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
    /// Standard deviation of the observed velocities (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub observed_rv_rms_kms: f64,
    /// Standard deviation of the filtered velocities (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub filtered_rv_rms_kms: f64,
    /// Root mean square of their standard errors (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub photon_rv_error_kms: f64,
    /// Root mean square of observed minus modelled intensity.
    pub residual_rms: f64,
    /// The same over the core of the line: bins where the model is deeper than half its greatest depth.
    #[serde(deserialize_with = "number_or_null")]
    pub residual_rms_core: f64,
    /// Root mean square of the standard errors of the intensities, scaled as the config says.
    pub sigma_rms: f64,
}

/// Deviation from the brightness of the photosphere, means over the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Mean of what pixels lack in brightness, 0 for bright ones.
    pub darkness: f64,
    /// Mean of what they have too much, 0 for dark ones.
    pub brightness_excess: f64,
}

impl Deviation {
    /// Of a map of brightnesses; `None` if maps hold something else.
    fn of(imager: &Imager, map: &[f64]) -> Option<Self> {
        let mean = |part: fn(f64) -> f64| map.iter().zip(&imager.areas).map(|(b, a)| a * part(b - 1.0)).sum();
        match imager.entropy {
            Entropy::Spots { .. } => None,
            Entropy::BrightAndDark => {
                Some(Deviation { darkness: mean(|x| (-x).max(0.0)), brightness_excess: mean(|x| x.max(0.0)) })
            }
        }
    }
}

impl Fit {
    /// Holds `reference` against the `observations` that `imager` was made for.
    #[doc(hidden)]
    pub fn new(imager: &Imager, observations: &Observations, reference: &Reference) -> Self {
        let solution = &reference.solution;
        let map = imager.entropy.image(&solution.image.coordinates);
        let mut problem = imager.problem(reference.response.clone());
        let test = parallelism(&mut problem, imager.entropy, &solution.image.coordinates);
        problem.linearise(&map);
        let mut depth = problem.model().to_vec();
        let bins = (0..observations.profiles.len()).map(|k| reference.response.bins(k));
        let estimate = |bins| imager.data.nuisances.estimate(bins, problem.weighted_residual(), &mut depth);
        let estimates: Vec<Estimate> = bins.clone().map(estimate).collect();
        let with = |counted: bool| estimates.iter().filter(move |_| counted);
        let nuisances =
            with(imager.data.nuisances.has_line_and_continuum()).map(|found| found.line_and_continuum).collect();
        let zero_points_kms =
            with(imager.data.nuisances.zero_point_kms() > 0.0).map(|found| found.zero_point_kms).collect();
        let depths: Vec<&[f64]> = bins.map(|bins| &depth[bins]).collect();
        let velocities = velocities(imager, observations, reference, &depths);
        let deviation = Deviation::of(imager, &map);
        let residuals = residuals(observations, &depths);
        let summary =
            FitSummary { test, deviation, ..summarise(imager, observations, reference, &residuals, &velocities) };
        let checks = Checks::of(&residuals, &imager.profiles_of_sets(), imager.data.correlated_bins);
        let model = depths.iter().map(|depth| depth.iter().map(|d| 1.0 - d).collect()).collect();
        let tradeoff = reference.tradeoff.nodes().to_vec();
        Fit { map, model, nuisances, zero_points_kms, velocities, tradeoff, summary, checks }
    }
}

/// Residuals of every profile, with its time.
fn residuals(observations: &Observations, depths: &[&[f64]]) -> Vec<(f64, Vec<Residual>)> {
    let of = |(profile, depths): (&crate::star::observation::Profile, &&[f64])| {
        let residual = |((intensity, sigma), depth): ((&f64, &f64), &f64)| {
            let difference = intensity - (1.0 - depth);
            Residual { depth: *depth, difference, scaled: difference / sigma }
        };
        (profile.time_d, profile.intensity.iter().zip(&profile.sigma).zip(depths.iter()).map(residual).collect())
    };
    observations.profiles.iter().zip(depths).map(of).collect()
}

fn velocities(
    imager: &Imager,
    observations: &Observations,
    reference: &Reference,
    depths: &[&[f64]],
) -> Vec<FilteredVelocity> {
    let state = reference.values.state();
    let velocity = |(profile, depth): (&crate::star::observation::Profile, &&[f64])| {
        let cycle = imager.star.cycle(profile.time_d);
        FilteredVelocity {
            time_d: profile.time_d,
            cycle,
            observed: profile.first_moment(),
            modelled_kms: profile.first_moment_of(depth),
            orbit_kms: state.vsys_kms + state.motion.velocity_kms(cycle),
        }
    };
    observations.profiles.iter().zip(depths).map(velocity).collect()
}

/// All numbers but `test` and `deviation`.
fn summarise(
    imager: &Imager,
    observations: &Observations,
    reference: &Reference,
    residuals: &[(f64, Vec<Residual>)],
    velocities: &[FilteredVelocity],
) -> FitSummary {
    let solution = &reference.solution;
    let star = imager.star.with(&reference.values.state().surface);
    let data = observations.len();
    let all = || residuals.iter().flat_map(|(_, residuals)| residuals);
    let deepest = all().map(|r| r.depth).fold(0.0, f64::max);
    let core = || all().filter(|r| r.depth > 0.5 * deepest);
    FitSummary {
        status: match solution.termination {
            Termination::Converged => Status::Converged,
            Termination::Unreachable => Status::Unreachable,
            Termination::StepLimit => Status::StoppedShort,
            Termination::NonFinite => Status::NonFinite,
        },
        chi2: solution.chi2,
        chi2_per_datum: solution.chi2 / data as f64,
        chi2_target: reference.chi2_target,
        lambda: solution.image.lambda,
        alpha: 1.0 / solution.image.lambda,
        entropy: solution.entropy,
        spottedness: solution.spottedness,
        deviation: None,
        test: f64::NAN,
        model_applications: reference.model_applications,
        newton_steps: solution.newton_steps,
        profiles: observations.profiles.len(),
        data,
        pixels: imager.grid.len(),
        equivalent_width_kms: star.line.equivalent_width_kms,
        contrast: star.contrast,
        parameters: reference.values,
        observed_rv_rms_kms: scatter(velocities.iter().map(|v| v.observed.value_kms)),
        filtered_rv_rms_kms: scatter(velocities.iter().map(FilteredVelocity::filtered_kms)),
        photon_rv_error_kms: rms(velocities.iter().map(|v| v.observed.sigma_kms)),
        residual_rms: rms(all().map(|r| r.difference)),
        residual_rms_core: rms(core().map(|r| r.difference)),
        sigma_rms: rms(observations.profiles.iter().flat_map(|p| p.sigma.iter().copied())),
    }
}

fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = x.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x * x));
    (sum / n).sqrt()
}

/// Root mean square about the mean.
fn scatter(x: impl Iterator<Item = f64> + Clone) -> f64 {
    let mean = x.clone().sum::<f64>() / x.clone().count() as f64;
    rms(x.map(|x| x - mean))
}
