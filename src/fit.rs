//! One reconstruction held against the data: its map and model profiles, first-moment velocities before and after the model is
//! taken out of them (Petit et al. 2015, section 3), and the numbers by which the fit is judged.
//!
//! Left out: how the reconstruction came about (`objective::reference`), and files (`io::map`).

use crate::imaging::Imager;
use crate::log_density::Status;
use crate::maxent::{Problem, Termination, parallelism};
use crate::nuisances::LineAndContinuum;
use crate::objective::tradeoff::Node;
use crate::objective::{ParameterValues, Reference};
use crate::observation::{Observations, RadialVelocity};
use serde::Serialize;

/// A reconstruction and what it makes of the data.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Spot filling factor of every pixel.
    pub spot_filling: Vec<f64>,
    /// Model intensity of every bin, one vector a profile, in units of the continuum; with its nuisances, where there are any.
    pub model: Vec<Vec<f64>>,
    /// Posterior mean of the nuisances of each profile, given the map; empty where none are integrated out.
    pub nuisances: Vec<LineAndContinuum>,
    /// Radial velocities, one a profile.
    pub velocities: Vec<FilteredVelocity>,
    /// Nodes of the trade-off curve, in order of falling chi2.
    pub tradeoff: Vec<Node>,
    /// The numbers.
    pub summary: FitSummary,
}

/// The first moment of one profile, observed and modelled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteredVelocity {
    /// Time (d).
    pub time_d: f64,
    /// Rotation cycle.
    pub cycle: f64,
    /// First moment of the observed profile.
    pub observed: RadialVelocity,
    /// First moment of the model profile (km/s): spots, orbit and systemic velocity.
    pub modelled_kms: f64,
    /// Velocity of the assumed orbit, plus the systemic velocity (km/s).
    pub orbit_kms: f64,
}

impl FilteredVelocity {
    /// Observed minus modelled (km/s).
    pub fn filtered_kms(&self) -> f64 {
        self.observed.value_kms - self.modelled_kms
    }
}

/// How good the fit is.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    /// Fractional spot coverage.
    pub spottedness: f64,
    /// Skilling & Bryan's TEST, 0 at a maximum-entropy image.
    pub test: f64,
    /// Applications of the response or its transpose, those for the trade-off curve included.
    pub passes: u32,
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
    pub observed_rv_rms_kms: f64,
    /// Standard deviation of the filtered velocities (km/s).
    pub filtered_rv_rms_kms: f64,
    /// Root mean square of their standard errors (km/s).
    pub photon_rv_error_kms: f64,
    /// Root mean square of observed minus modelled intensity.
    pub residual_rms: f64,
    /// The same over the core of the line: bins where the model is deeper than half its greatest depth.
    pub residual_rms_core: f64,
    /// Root mean square of the standard errors of the intensities, scaled as the config says.
    pub sigma_rms: f64,
}

impl Fit {
    /// Holds `reference` against the `observations` that `imager` was made for.
    pub fn new(imager: &Imager, observations: &Observations, reference: &Reference) -> Self {
        let solution = &reference.solution;
        let mut spot_filling = vec![0.0; imager.grid.len()];
        imager.entropy.image(&solution.image.logit, &mut spot_filling);
        let mut problem = imager.problem(reference.response.clone());
        let test = parallelism(&mut problem, imager.entropy, &solution.image.logit);
        problem.linearise(&spot_filling);
        let mut depth = problem.model().to_vec();
        let bins = (0..observations.profiles.len()).map(|k| reference.response.bins(k));
        let estimate = |bins| imager.data.nuisances.estimate(bins, problem.weighted_residual(), &mut depth);
        let nuisances = match imager.data.nuisances.is_empty() {
            true => Vec::new(),
            false => bins.clone().map(estimate).collect(),
        };
        let depths: Vec<&[f64]> = bins.map(|bins| &depth[bins]).collect();
        let velocities = velocities(imager, observations, reference, &depths);
        let summary = FitSummary { test, ..summarise(imager, observations, reference, &depths, &velocities) };
        let model = depths.iter().map(|depth| depth.iter().map(|d| 1.0 - d).collect()).collect();
        Fit { spot_filling, model, nuisances, velocities, tradeoff: reference.tradeoff.nodes().to_vec(), summary }
    }
}

fn velocities(
    imager: &Imager,
    observations: &Observations,
    reference: &Reference,
    depths: &[&[f64]],
) -> Vec<FilteredVelocity> {
    let state = reference.values.state();
    let velocity = |(profile, depth): (&crate::observation::Profile, &&[f64])| {
        let cycle = imager.star.cycle(profile.time_d);
        FilteredVelocity {
            time_d: profile.time_d,
            cycle,
            observed: profile.first_moment(observations.step_kms),
            modelled_kms: profile.first_moment_of(depth, observations.step_kms),
            orbit_kms: state.vsys_kms + state.orbit.velocity_kms(cycle),
        }
    };
    observations.profiles.iter().zip(depths).map(velocity).collect()
}

/// All numbers but `test`.
fn summarise(
    imager: &Imager,
    observations: &Observations,
    reference: &Reference,
    depths: &[&[f64]],
    velocities: &[FilteredVelocity],
) -> FitSummary {
    let solution = &reference.solution;
    let star = imager.star.with(&reference.values.state().surface);
    let data = observations.len();
    let deepest = depths.iter().flat_map(|d| d.iter()).copied().fold(0.0, f64::max);
    let observed = observations.profiles.iter().flat_map(|p| &p.intensity);
    let modelled = depths.iter().flat_map(|d| d.iter());
    let residuals: Vec<(f64, f64)> = observed.zip(modelled).map(|(i, depth)| (*depth, i - (1.0 - depth))).collect();
    let core = residuals.iter().filter(|(depth, _)| *depth > 0.5 * deepest);
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
        test: f64::NAN,
        passes: reference.passes,
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
        residual_rms: rms(residuals.iter().map(|(_, r)| *r)),
        residual_rms_core: rms(core.map(|(_, r)| *r)),
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
