//! The maps of an evolving star compared with the data: the field fitted, its most probable map and standard deviation
//! at any time, model profiles, and radial velocities marginalised over maps (`docs/method.md` section 9).

use super::light::misfits;
use super::linearised::linearised;
use super::{Assumed, Basis, Fitted, Known, Maps, Marginal, NoFit, fit};
use crate::field::{Field, Kernel, Lifetime};
use crate::numerics::vector::{self, Instructions, Task};
use crate::planets::velocities::VelocityQuadratic;
use crate::sampling::log_density::Status;
use crate::star::observation::{self, Observations};
use crate::surface::checks::Checks;
use crate::surface::imaging::{Data, Imager};
use crate::surface::maps::{Against, MapSummary, NoMaps, SurfaceMap, SurfaceMaps, VelocityWithoutSpots, rms, scatter};
use crate::surface::mean_profile;
use crate::surface::nuisances::Estimate;
use crate::surface::{At, Explained, SpotField};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Profiles further apart than this (d) have separate maps.
const NIGHT_GAP_D: f64 = 0.5;

/// Maps of a larger chi2 per datum do not explain the profiles: with the right star and uncertainties it is about 0.9.
const WORST_CHI2: f64 = 2.0;

impl SurfaceMaps {
    /// Fits the field of the star in `at` to the `observations` that its imager was made for, except for what is
    /// `known` of it. Maps are at `times_d`, by default one per night, or a single one where the spots are static.
    ///
    /// # Errors
    /// [`NoMaps`].
    #[doc(hidden)]
    pub fn of_field(
        At { imager, values, nuisances }: At,
        observations: &Observations,
        known: Known,
        times_d: Option<&[f64]>,
    ) -> Result<Self, NoMaps> {
        let times_d = times_d.map(in_order).transpose()?;
        let basis = Arc::new(Basis::seen(imager, &values));
        let fitted = fit(imager, &basis, values, known, None)?;
        if let Some(amplitude) = fitted.too_faint() {
            return Err(NoMaps::TooFaint(amplitude));
        }
        let here = linearised(imager, fitted, nuisances).map_err(NoFit::from)?;
        let fitted: &Fitted = here.kept();
        let marginal = &fitted.marginal;
        let settled = &marginal.settled;
        let modelled = Modelled::of(imager, marginal, &settled.coefficients);
        let of_static = of_static(imager, marginal);
        let times_d = times_d.unwrap_or_else(|| match is_static(marginal) {
            true => vec![mean(&observations.times_d())],
            false => nights(&observations.times_d()),
        });
        let maps = Maps::at(settled, &basis, &times_d);
        let map = |(k, time_d): (usize, &f64)| SurfaceMap {
            time_d: Some(*time_d),
            pixels: maps.filling.column(k).iter().copied().collect(),
            sigma: Some(maps.sd.column(k).iter().copied().collect()),
        };
        let mut warnings: Vec<String> = SpotField::of(fitted).remarks().into_iter().map(|remark| remark.text).collect();
        warnings.extend(far(&times_d, observations, &marginal.assumed.field.kernel));
        let against = Against::new(imager, observations, marginal.values, &modelled.depths());
        // including all planets, like the orbit velocities beside them
        let mut held = here.held.clone();
        marginal.values.motion().second.iter().for_each(|second| held.count_in(|cycle| second.velocity_kms(cycle)));
        let velocities = velocities(&held, &against);
        let [rv, sigma] =
            [0, 1].map(|i| velocities.iter().map(move |v| v.marginalised_kms.map_or(f64::NAN, |rv| rv[i])));
        let per_datum = |modelled: &Modelled| {
            let against = Against::new(imager, observations, marginal.values, &modelled.depths());
            against.chi2() / observations.len() as f64
        };
        let summary = MapSummary {
            rv_rms_kms: Some(scatter(rv)),
            rv_error_kms: Some(rms(sigma)),
            chi2_per_datum_unchanging: of_static.as_ref().map(per_datum),
            ..against.summary(Status::Converged, against.chi2())
        };
        if summary.chi2_per_datum > WORST_CHI2 {
            warnings.push(format!(
                "The maps do not reproduce the profiles (χ²/N = {:.2}): check star.vsini_kms, star.line and the \
                uncertainties (observations.sigma_scale: \"auto\").",
                summary.chi2_per_datum
            ));
        }
        let light = marginal.light_curves(imager);
        warnings.extend(misfits(imager, &light));
        let counted = |counted: bool| modelled.estimates.iter().filter(move |_| counted);
        let nuisances = &imager.data.nuisances;
        Ok(SurfaceMaps {
            maps: times_d.iter().enumerate().map(map).collect(),
            nuisances: counted(nuisances.has_line_and_continuum()).map(|found| found.line_and_continuum).collect(),
            zero_points_kms: counted(marginal.assumed.has_noise()).map(|found| found.zero_point_kms).collect(),
            light,
            readings: marginal.readings(imager),
            trade_off: Vec::new(),
            field: Some(SpotField::of(fitted)),
            model: modelled.intensities(),
            static_model: of_static.map(|modelled| modelled.intensities()),
            velocities,
            checks: Checks::of_flexible(&against.residuals, &imager.profiles_of_sets(), imager.data.correlated_bins),
            warnings,
            summary,
            here: Some(here),
        })
    }
}

/// The profiles with the model of the most probable maps of a field.
pub(super) fn explained(imager: &Imager, observations: &Observations, fitted: &Fitted) -> Explained {
    let marginal = &fitted.marginal;
    let modelled = Modelled::of(imager, marginal, &marginal.settled.coefficients);
    let against = Against::new(imager, observations, marginal.values, &modelled.depths());
    let sets = imager.profiles_of_sets();
    let mut misfit = Checks::of_flexible(&against.residuals, &sets, imager.data.correlated_bins).warnings;
    misfit.extend(misfits(imager, &marginal.light_curves(imager)));
    Explained { chi2_per_datum: against.chi2() / observations.len() as f64, misfit, velocities: against.moments }
}

/// Times are poorly constrained by the profiles where the spots have less than this correlation with those of any
/// profile.
const FORGOTTEN: f64 = 0.1;

fn far(times_d: &[f64], observations: &Observations, kernel: &Kernel) -> Option<String> {
    let nearest =
        |time_d: f64| observations.profiles.iter().map(|p| (p.time_d - time_d).abs()).fold(f64::MAX, f64::min);
    let far: Vec<String> =
        times_d.iter().filter(|t| kernel.at(nearest(**t)) < FORGOTTEN).map(|t| format!("{t:.2}")).collect();
    let [first, last] = observations.time_span_d()?;
    (!far.is_empty()).then(|| {
        format!(
            "the profiles ({first:.2} to {last:.2} d) hardly constrain the map at {} d: spots do not live that long",
            far.join(", ")
        )
    })
}

/// Times (d) of the requested maps, in order.
fn in_order(times_d: &[f64]) -> Result<Vec<f64>, NoMaps> {
    /// Beyond it (d) a time in double precision does not resolve an hour.
    const FARTHEST_D: f64 = 1e12;
    let mut times_d = times_d.to_vec();
    times_d.sort_by(f64::total_cmp);
    match times_d.as_slice() {
        [] => Err(NoMaps::Times("there is none; give one or more, in days as in the list of profiles")),
        times if times.iter().any(|t| t.is_nan() || t.abs() > FARTHEST_D) => {
            Err(NoMaps::Times("each must be a number of days, as in the list of profiles"))
        }
        times if times.windows(2).any(|pair| pair[0] == pair[1]) => {
            Err(NoMaps::Times("one is there twice; give each time once"))
        }
        _ => Ok(times_d),
    }
}

fn is_static(marginal: &Marginal) -> bool {
    marginal.assumed.field.kernel.lifetime == Lifetime::Static
}

/// Mean times (d) of the nights.
fn nights(times_d: &[f64]) -> Vec<f64> {
    let of_night = |night: Vec<usize>| mean(&night.iter().map(|k| times_d[*k]).collect::<Vec<_>>());
    observation::nights(times_d, NIGHT_GAP_D).into_iter().map(of_night).collect()
}

fn mean(x: &[f64]) -> f64 {
    // for times near each other, far from 0
    x[0] + x.iter().map(|x_k| x_k - x[0]).sum::<f64>() / x.len() as f64
}

/// Model profiles of the most probable maps.
struct Modelled {
    /// All profiles, one after the other, including nuisances.
    depth: Vec<f64>,
    bins: Vec<std::ops::Range<usize>>,
    estimates: Vec<Estimate>,
}

impl Modelled {
    /// From maps of these coefficients (H, profiles).
    fn of(imager: &Imager, marginal: &Marginal, coefficients: &DMatrix<f64>) -> Self {
        let response = marginal.design.response();
        let mut depth = response.depths_of_each(&marginal.design.brightness(&marginal.basis, coefficients));
        let alike = marginal.design.mean_profile(imager, coefficients);
        if !alike.is_empty() {
            let columns = mean_profile::columns(imager);
            let changes = columns.iter().flat_map(|columns| (columns * &alike).as_slice().to_vec());
            depth.iter_mut().zip(changes).for_each(|(depth, change)| *depth += change);
        }
        let shares = imager.jitter_share_of_each();
        let slopes = marginal.slopes(imager, &[]).into_iter().zip(&shares);
        let slopes: Vec<f64> = slopes.flat_map(|(slopes, share)| (slopes * *share).as_slice().to_vec()).collect();
        let Assumed { jitter_kms, night_kms, .. } = marginal.assumed;
        let with_jitter = imager.clone().with_zero_points(jitter_kms.hypot(night_kms), &slopes);
        let bins: Vec<_> = (0..response.profiles()).map(|k| response.bins(k)).collect();
        let residual: Vec<f64> = depth.iter().zip(&imager.data.depth).map(|(model, data)| model - data).collect();
        let mut weighted = vec![0.0; residual.len()];
        vector::run(Weigh { data: &with_jitter.data, bins: &bins, residual: &residual, weighted: &mut weighted });
        let nuisances = &with_jitter.data.nuisances;
        let estimate = |(bins, share): (&std::ops::Range<usize>, &f64)| {
            let estimate = nuisances.estimate(bins.clone(), &weighted, &mut depth);
            Estimate { zero_point_kms: share * estimate.zero_point_kms, ..estimate }
        };
        let estimates = bins.iter().zip(&shares).map(estimate).collect();
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

/// Model profiles of static spots.
fn of_static(imager: &Imager, marginal: &Marginal) -> Option<Modelled> {
    let Marginal { values, basis, design, assumed, .. } = marginal;
    if is_static(marginal) {
        return None;
    }
    let field = Field { kernel: Kernel::of(Lifetime::Static), ..assumed.field };
    let assumed = Assumed { field, ..*assumed };
    let still = Marginal::new(imager, basis, Arc::clone(design), *values, assumed, None).ok()?;
    Some(Modelled::of(imager, &still, &still.settled.coefficients))
}

/// The velocities of the profiles, marginalised over maps.
fn velocities(held: &VelocityQuadratic, against: &Against) -> Vec<VelocityWithoutSpots> {
    let free = held.radial_velocities().ok();
    let velocity = |(k, moments)| {
        let (rv_kms, variance) = free.as_ref().map_or((f64::NAN, f64::NAN), |(v, c)| (v[k], c[(k, k)]));
        VelocityWithoutSpots { moments, marginalised_kms: Some([rv_kms, variance.sqrt()]) }
    };
    against.moments.iter().copied().enumerate().map(velocity).collect()
}
