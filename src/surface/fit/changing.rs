//! The maps of a star that may change, held against the data: the field fitted, its most probable map and standard
//! deviation at any time, model profiles, and radial velocities with all maps integrated out (`docs/method.md` section
//! 9).

use super::{Checks, Residual, residuals, rms, scatter};
use crate::field::{Field, FieldError, Kernel, Lifetime};
use crate::model::ParameterValues;
use crate::numerics::json::number_or_null;
use crate::numerics::vector::{self, Instructions, Task};
use crate::sampling::log_density::Status;
use crate::star::observation::{Observations, Profile, RadialVelocity};
use crate::surface::{FluxFit, Known, NoFit};
use crate::surface::evolving_map::{fit, Assumed, Basis, Fitted, Maps, Marginal};
use crate::surface::imaging::{Data, Imager};
use crate::surface::nuisances::{Estimate, LineAndContinuum};
use crate::surface::{Explained, FilteredVelocity};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Profiles further apart than this (d) have maps of their own.
const NIGHT_GAP_D: f64 = 0.5;

/// Maps of a larger chi2 per datum do not explain the profiles: those of a right star and right errors have some 0.9.
const WORST_CHI2: f64 = 2.0;

/// Maps of a star that may change, and what they make of the data.
#[derive(Clone, Debug)]
pub struct ChangingFit {
    /// The maps, in the order of their times.
    pub maps: Vec<MapAt>,
    /// Model intensity of every bin in the most probable map of its profile, one vector a profile, in units of the
    /// continuum; with its nuisances, where there are any.
    pub model: Vec<Vec<f64>>,
    /// The same of a star that does not change, amplitude and slope of the field as they are; `None` where the field
    /// does not change, and where such a star has no most probable map.
    pub unchanging_model: Option<Vec<Vec<f64>>>,
    /// Radial velocities, one a profile.
    pub velocities: Vec<VelocityWithoutSpots>,
    /// Posterior mean of the nuisances of each profile, given its map; empty where none are integrated out.
    #[doc(hidden)]
    pub nuisances: Vec<LineAndContinuum>,
    /// Posterior mean of each profile's velocity zero point (km/s), given its map; empty where there is no jitter.
    pub zero_points_kms: Vec<f64>,
    /// Light curves, and what the most probable maps make of them; mostly none.
    #[doc(hidden)]
    pub light: Vec<FluxFit>,
    /// What has to be known of field and times.
    pub warnings: Vec<String>,
    /// The field.
    #[doc(hidden)]
    pub fitted: Fitted,
    /// The numbers.
    pub summary: ChangingSummary,
    /// Whether what is left over looks like noise.
    #[doc(hidden)]
    pub checks: Checks,
}

/// The map of one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapAt {
    /// Time (d).
    pub time_d: f64,
    /// Rotation cycle.
    pub cycle: f64,
    /// Most probable spot filling factor of each pixel; below 0 it is brighter than the photosphere.
    pub spot_filling: Vec<f64>,
    /// Its standard deviation, what is assumed of the field held.
    pub sigma_spot_filling: Vec<f64>,
}

/// The velocity of one profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityWithoutSpots {
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
    /// The most likely velocity relative to the systemic one, all maps integrated out, whatever the assumed orbit
    /// (km/s); NaN where the data do not bound it.
    pub rv_kms: f64,
    /// Its standard error, of which those of other profiles are not independent (km/s).
    pub rv_sigma_kms: f64,
}

/// How good the fit is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangingSummary {
    /// How the search for the field ended.
    pub status: Status,
    /// chi2 of the most probable maps.
    pub chi2: f64,
    /// The same over the number of data.
    pub chi2_per_datum: f64,
    /// That of a star that does not change, amplitude and slope of the field as they are; null where there is none.
    pub chi2_per_datum_unchanging: Option<f64>,
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
    /// Root mean square of the errors that photon noise makes in them (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub photon_rv_error_kms: f64,
    /// Standard deviation of the velocities with all maps integrated out (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub rv_rms_kms: f64,
    /// Root mean square of their errors (km/s).
    #[serde(deserialize_with = "number_or_null")]
    pub rv_error_kms: f64,
    /// Root mean square of observed minus modelled intensity.
    pub residual_rms: f64,
    /// The same over the core of the line: bins where the model is deeper than half its greatest depth.
    #[serde(deserialize_with = "number_or_null")]
    pub residual_rms_core: f64,
    /// Root mean square of the standard errors of the intensities, scaled as the config says.
    pub sigma_rms: f64,
}

/// Why there are no such maps.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoField {
    /// There is no most probable field.
    #[error(transparent)]
    Fit(#[from] NoFit),
    /// No map can be asked for at these times.
    #[error("{0}")]
    Times(&'static str),
    /// The profiles know no spots.
    #[error(
        "the amplitude of the spots falls to the lower bound of its search, {0:.2}: the profiles show no spots; \
        observations.sigma_scale may be too large"
    )]
    TooFaint(f64),
}

impl NoField {
    /// A name for it.
    pub fn status(&self) -> &'static str {
        match self {
            NoField::Fit(error) => error.status(),
            NoField::TooFaint(_) => "amplitude-at-bound",
            NoField::Times(_) => "no-such-times",
        }
    }
}

impl ChangingFit {
    /// Fits the field of the star at `values` to the `observations` that `imager` was made for, but for what is
    /// `known` of it. Maps are those of `times_d`, by default of each night, or one where the star does not change.
    ///
    /// # Errors
    /// [`NoField`].
    #[doc(hidden)]
    pub fn new(
        imager: &Imager,
        observations: &Observations,
        values: ParameterValues,
        known: Known,
        times_d: Option<&[f64]>,
    ) -> Result<Self, NoField> {
        let times_d = times_d.map(in_order).transpose()?;
        let basis = Basis::new(&imager.grid);
        let fitted = fit(imager, &basis, values, known, None)?;
        if let Some(amplitude) = fitted.too_faint() {
            return Err(NoField::TooFaint(amplitude));
        }
        let marginal = &fitted.marginal;
        let settled = &marginal.settled;
        let modelled = Modelled::of(imager, &basis, marginal, &settled.coefficients);
        let unchanging = unchanging(imager, &basis, marginal);
        let residuals = residuals(observations, &modelled.depths());
        let times_d = times_d.unwrap_or_else(|| match is_static(marginal) {
            true => vec![mean(&observations.times_d())],
            false => nights(&observations.times_d()),
        });
        let maps = Maps::at(settled, &basis, &times_d);
        let map = |(k, time_d): (usize, &f64)| MapAt {
            time_d: *time_d,
            cycle: imager.star.cycle(*time_d),
            spot_filling: maps.filling.column(k).iter().copied().collect(),
            sigma_spot_filling: maps.sd.column(k).iter().copied().collect(),
        };
        let mut warnings = reached(&fitted);
        warnings.extend(far(&times_d, observations, &marginal.assumed.field.kernel));
        let velocities = velocities(imager, &basis, observations, marginal, &modelled).map_err(NoFit::from)?;
        let mut summary = summarise(imager, observations, &marginal.values, &residuals, &velocities);
        if summary.chi2_per_datum > WORST_CHI2 {
            warnings.push(format!(
                "the maps do not explain the profiles: chi2 is {:.2} per datum. star.vsini_kms, star.line or the \
                errors are wrong; observations.sigma_scale \"auto\" measures these",
                summary.chi2_per_datum
            ));
        }
        summary.chi2_per_datum_unchanging =
            unchanging.as_ref().map(|modelled| chi2(&super::residuals(observations, &modelled.depths())).0);
        let counted = |counted: bool| modelled.estimates.iter().filter(move |_| counted);
        let nuisances = &imager.data.nuisances;
        Ok(ChangingFit {
            maps: times_d.iter().enumerate().map(map).collect(),
            nuisances: counted(nuisances.has_line_and_continuum()).map(|found| found.line_and_continuum).collect(),
            zero_points_kms: counted(marginal.assumed.jitter_kms > 0.0).map(|found| found.zero_point_kms).collect(),
            light: marginal.light_curves(imager),
            model: modelled.intensities(),
            unchanging_model: unchanging.map(|modelled| modelled.intensities()),
            velocities,
            checks: Checks::of_flexible(&residuals, &imager.profiles_of_sets(), imager.data.correlated_bins),
            warnings,
            summary,
            fitted,
        })
    }
}

/// The profiles as the most probable maps of a field explain them.
pub(in crate::surface) fn explained(imager: &Imager, observations: &Observations, fitted: &Fitted) -> Explained {
    let marginal = &fitted.marginal;
    let modelled = Modelled::of(imager, &Basis::new(&imager.grid), marginal, &marginal.settled.coefficients);
    let residuals = residuals(observations, &modelled.depths());
    let state = marginal.values.state();
    let velocity = |(profile, depth): (&Profile, &[f64])| {
        let cycle = imager.star.cycle(profile.time_d);
        FilteredVelocity {
            time_d: profile.time_d,
            cycle,
            observed: profile.first_moment(),
            modelled_kms: profile.first_moment_of(depth),
            orbit_kms: state.vsys_kms + state.motion.velocity_kms(cycle),
        }
    };
    Explained {
        velocities: observations.profiles.iter().zip(modelled.depths()).map(velocity).collect(),
        chi2_per_datum: chi2(&residuals).0,
        misfit: Checks::of_flexible(&residuals, &imager.profiles_of_sets(), imager.data.correlated_bins).warnings,
    }
}

/// What is to be said of bounds that the field reached.
fn reached(fitted: &Fitted) -> Vec<String> {
    let said = |name: &&str| {
        format!("{name} lies on the bound of its search: the profiles do not tell it, or something else is wrong")
    };
    fitted.at_bounds.iter().map(said).collect()
}

/// What is to be said of times of which the profiles tell little: those where the spots have less than this
/// correlation with those of any profile.
const FORGOTTEN: f64 = 0.1;

fn far(times_d: &[f64], observations: &Observations, kernel: &Kernel) -> Option<String> {
    let nearest =
        |time_d: f64| observations.profiles.iter().map(|p| (p.time_d - time_d).abs()).fold(f64::MAX, f64::min);
    let far: Vec<String> =
        times_d.iter().filter(|t| kernel.at(nearest(**t)) < FORGOTTEN).map(|t| format!("{t:.2}")).collect();
    let [first, last] = observations.time_span_d()?;
    (!far.is_empty()).then(|| {
        format!(
            "the profiles, of {first:.2} to {last:.2} d, tell little of the star at {} d: spots do not live that long",
            far.join(", ")
        )
    })
}

/// Times (d) at which maps are asked for, from the first to the last.
fn in_order(times_d: &[f64]) -> Result<Vec<f64>, NoField> {
    /// Beyond it (d) a time has no fractions of an hour in double precision.
    const FARTHEST_D: f64 = 1e12;
    let mut times_d = times_d.to_vec();
    times_d.sort_by(f64::total_cmp);
    match times_d.as_slice() {
        [] => Err(NoField::Times("there is none; give one or more, in days as in the list of profiles")),
        times if times.iter().any(|t| t.is_nan() || t.abs() > FARTHEST_D) => {
            Err(NoField::Times("each must be a number of days, as in the list of profiles"))
        }
        times if times.windows(2).any(|pair| pair[0] == pair[1]) => {
            Err(NoField::Times("one is there twice; give each time once"))
        }
        _ => Ok(times_d),
    }
}

fn is_static(marginal: &Marginal) -> bool {
    marginal.assumed.field.kernel.lifetime == Lifetime::Static
}

/// Mean times (d) of the nights.
fn nights(times_d: &[f64]) -> Vec<f64> {
    let mut times_d = times_d.to_vec();
    times_d.sort_by(f64::total_cmp);
    times_d.chunk_by(|a, b| b - a <= NIGHT_GAP_D).map(mean).collect()
}

fn mean(x: &[f64]) -> f64 {
    // of times near each other, far from 0
    x[0] + x.iter().map(|x_k| x_k - x[0]).sum::<f64>() / x.len() as f64
}

/// Model profiles of the most probable maps.
struct Modelled {
    /// All profiles, one after the other, nuisances included.
    depth: Vec<f64>,
    bins: Vec<std::ops::Range<usize>>,
    estimates: Vec<Estimate>,
}

impl Modelled {
    /// Of maps of these coefficients (H, profiles).
    fn of(imager: &Imager, basis: &Basis, marginal: &Marginal, coefficients: &DMatrix<f64>) -> Self {
        let response = marginal.design.response();
        let mut depth = response.depths_of_each(&marginal.design.brightness(basis, coefficients));
        let slopes: Vec<f64> =
            marginal.slopes(imager, basis, &[]).iter().flat_map(|slopes| slopes.iter().copied()).collect();
        let with_jitter = imager.clone().with_zero_points(marginal.assumed.jitter_kms, &slopes);
        let bins: Vec<_> = (0..response.profiles()).map(|k| response.bins(k)).collect();
        let residual: Vec<f64> = depth.iter().zip(&imager.data.depth).map(|(model, data)| model - data).collect();
        let mut weighted = vec![0.0; residual.len()];
        vector::run(Weigh { data: &with_jitter.data, bins: &bins, residual: &residual, weighted: &mut weighted });
        let nuisances = &with_jitter.data.nuisances;
        let estimates = bins.iter().map(|bins| nuisances.estimate(bins.clone(), &weighted, &mut depth)).collect();
        Modelled { depth, bins, estimates }
    }

    fn depths(&self) -> Vec<&[f64]> {
        self.bins.iter().map(|bins| &self.depth[bins.clone()]).collect()
    }

    fn intensities(&self) -> Vec<Vec<f64>> {
        self.depths().iter().map(|depth| depth.iter().map(|d| 1.0 - d).collect()).collect()
    }
}

/// `W (model - data)` of all profiles.
struct Weigh<'a> {
    data: &'a Data,
    bins: &'a [std::ops::Range<usize>],
    residual: &'a [f64],
    weighted: &'a mut [f64],
}

impl Task for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) {
        for bins in self.bins {
            self.data.weigh(i, bins.clone(), self.residual, self.weighted);
        }
    }
}

/// Model profiles of a star that does not change.
fn unchanging(imager: &Imager, basis: &Basis, marginal: &Marginal) -> Option<Modelled> {
    let Marginal { values, design, assumed, .. } = marginal;
    if is_static(marginal) {
        return None;
    }
    let field = Field { kernel: Kernel::of(Lifetime::Static), ..assumed.field };
    let assumed = Assumed { field, ..*assumed };
    let still = Marginal::new(imager, basis, Arc::clone(design), *values, assumed, None).ok()?;
    Some(Modelled::of(imager, basis, &still, &still.settled.coefficients))
}

fn velocities(
    imager: &Imager,
    basis: &Basis,
    observations: &Observations,
    marginal: &Marginal,
    modelled: &Modelled,
) -> Result<Vec<VelocityWithoutSpots>, FieldError> {
    let free = marginal.known_zero_points(imager, basis, &[])?.velocities(&[]).radial_velocities().ok();
    let state = marginal.values.state();
    let velocity = |(k, (profile, depth)): (usize, (&Profile, &[f64]))| {
        let cycle = imager.star.cycle(profile.time_d);
        let (rv_kms, variance) = free.as_ref().map_or((f64::NAN, f64::NAN), |(v, c)| (v[k], c[(k, k)]));
        VelocityWithoutSpots {
            time_d: profile.time_d,
            cycle,
            observed: profile.first_moment(),
            modelled_kms: profile.first_moment_of(depth),
            orbit_kms: state.vsys_kms + state.motion.velocity_kms(cycle),
            rv_kms,
            rv_sigma_kms: variance.sqrt(),
        }
    };
    Ok(observations.profiles.iter().zip(modelled.depths()).enumerate().map(velocity).collect())
}

/// chi2 per datum, and chi2.
fn chi2(residuals: &[(f64, Vec<Residual>)]) -> (f64, f64) {
    let all = || residuals.iter().flat_map(|(_, residuals)| residuals);
    let chi2: f64 = all().map(|r| r.scaled * r.scaled).sum();
    (chi2 / all().count() as f64, chi2)
}

/// All numbers but that of a star that does not change.
fn summarise(
    imager: &Imager,
    observations: &Observations,
    values: &ParameterValues,
    residuals: &[(f64, Vec<Residual>)],
    velocities: &[VelocityWithoutSpots],
) -> ChangingSummary {
    let star = imager.star.with(&values.state().surface);
    let all = || residuals.iter().flat_map(|(_, residuals)| residuals);
    let deepest = all().map(|r| r.depth).fold(0.0, f64::max);
    let core = || all().filter(|r| r.depth > 0.5 * deepest);
    let (chi2_per_datum, chi2) = chi2(residuals);
    ChangingSummary {
        status: Status::Converged,
        chi2,
        chi2_per_datum,
        chi2_per_datum_unchanging: None,
        profiles: observations.profiles.len(),
        data: observations.len(),
        pixels: imager.grid.len(),
        equivalent_width_kms: star.line.equivalent_width_kms,
        contrast: star.contrast,
        parameters: *values,
        observed_rv_rms_kms: scatter(velocities.iter().map(|v| v.observed.value_kms)),
        photon_rv_error_kms: rms(velocities.iter().map(|v| v.observed.sigma_kms)),
        rv_rms_kms: scatter(velocities.iter().map(|v| v.rv_kms)),
        rv_error_kms: rms(velocities.iter().map(|v| v.rv_sigma_kms)),
        residual_rms: rms(all().map(|r| r.difference)),
        residual_rms_core: rms(core().map(|r| r.difference)),
        sigma_rms: rms(observations.profiles.iter().flat_map(|p| p.sigma.iter().copied())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nights_are_parted_by_days() {
        let day = 2_456_892.0;
        let times = [14.2, 0.1, 0.3, 1.35, 0.2, 14.6].map(|t| day + t);
        let found: Vec<f64> = nights(&times).iter().map(|t| t - day).collect();
        // 0.4 d apart is one night still; rounding of days so large is 5e-10
        assert!(found.iter().zip([0.2, 1.35, 14.4]).all(|(a, b)| (a - b).abs() < 1e-8), "{found:?}");
        assert_eq!(found.len(), 3);
    }
}
