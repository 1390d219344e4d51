//! The strength of the local line where a config leaves it to the profiles: their area.

use crate::data::config::{ConfigError, DataSetSettings, Settings};
use crate::model::{Parameter, ParameterValues};
use crate::star::observation::Observations;
use crate::star::{Quadrature, Response, Sampling, StarSettings, SurfaceGrid};

/// Bins farther than this many local line widths beyond vsini count as continuum, and this many of them on a side
/// suffice.
const BESIDE: f64 = 2.0;
const FEWEST_BESIDE: usize = 2;

/// The star as a data `set` sees it, its equivalent width measured on its `observations` if that is
/// "auto".
///
/// # Errors
/// If the equivalent width so measured is not positive.
pub fn star_for(
    settings: &Settings,
    set: &DataSetSettings,
    observations: &Observations,
) -> Result<StarSettings, ConfigError> {
    let mut star = set.star.clone();
    if star.line.equivalent_width_kms.is_none() {
        let beside = match set.nuisances.is_some_and(|priors| priors.continuum_offset > 0.0) {
            true => above_its_continuum(&star, &settings.values, observations),
            false => None,
        };
        let width = beside.unwrap_or_else(|| observations.mean_equivalent_width_kms());
        if !(width.is_finite() && width > 0.0) {
            let of = if settings.sets.len() > 1 { format!(" for {}", set.key) } else { String::new() };
            let problem = format!("auto gives {width} km/s{of}: the observed profiles are no absorption line");
            return Err(settings.fault("star.line.equivalent_width_kms", &problem));
        }
        star.line.equivalent_width_kms = Some(width);
        if beside.is_none() && star.line.gamma_kms > 0.0 {
            // wings beyond the velocity range count as well
            star.line.equivalent_width_kms = Some(width / share_observed(&star, &settings.values, observations));
        }
    }
    Ok(star)
}

/// Equivalent width (km/s) of the line below the continuum on both sides of each profile, whatever its level; `None`
/// where the profiles do not reach into it. The loss of an unspotted star by the same measure (wings in the continuum)
/// is corrected for.
fn above_its_continuum(star: &StarSettings, values: &ParameterValues, observations: &Observations) -> Option<f64> {
    let reach_kms = values[Parameter::Vsini] + BESIDE * star.line.sigma_kms;
    let mut unit = star.clone();
    unit.line.equivalent_width_kms = Some(1.0);
    let model = unspotted(&unit, values, observations);
    let (mut observed, mut expected, mut first) = (0.0, 0.0, 0);
    for profile in &observations.profiles {
        let bins = profile.intensity.len();
        let centre = values[Parameter::Vsys];
        let distance = |j: usize| profile.velocity_kms(j) - centre;
        let area = |depth: &dyn Fn(usize) -> f64| {
            let side = |sign: f64| {
                let beyond: Vec<f64> = (0..bins).filter(|j| sign * distance(*j) > reach_kms).map(depth).collect();
                (beyond.len() >= FEWEST_BESIDE).then(|| beyond.iter().sum::<f64>() / beyond.len() as f64)
            };
            let continuum = 0.5 * (side(-1.0)? + side(1.0)?);
            Some((0..bins).map(|j| depth(j) - continuum).sum::<f64>())
        };
        observed += area(&|j| 1.0 - profile.intensity[j])?;
        expected += area(&|j| model[first + j])?;
        first += bins;
    }
    Some(observed / expected)
}

/// The fraction of its line that an unspotted star shows within the velocities of `observations`.
fn share_observed(star: &StarSettings, values: &ParameterValues, observations: &Observations) -> f64 {
    let depths = unspotted(star, values, observations);
    let areas = depths.iter().sum::<f64>() * observations.step_kms() / observations.profiles.len() as f64;
    areas / star.line.strength_kms()
}

/// Depths of an unspotted star in all bins of `observations`.
fn unspotted(star: &StarSettings, values: &ParameterValues, observations: &Observations) -> Vec<f64> {
    const PIXELS: usize = 2000;
    let grid = SurfaceGrid::equal_area(PIXELS, Quadrature::Gauss2x2);
    Response::new(&grid, star, &values.state(), &Sampling::of(observations)).depths(&vec![1.0; grid.len()])
}
