//! The light curves of a config: read or simulated, and brought to bins.

use super::SceneError;
use super::seasons::is_within;
use crate::data::config::{ConfigError, LightCurveSettings, LightSource, ObservationSource, Settings};
use crate::data::io::light_curve;
use crate::data::simulate::Simulation;
use crate::field::Lifetime;
use crate::model::Parameter;
use crate::star::observation::Observations;
use crate::surface::photometry::{Flux, FluxBin, LightCurve, bin_width_d};
use sha2::{Digest, Sha256};

/// More measurements are not simulated.
const MOST_SIMULATED: f64 = 50_000.0;

/// Spots know nothing of themselves after so many lifetimes.
const FORGOTTEN: f64 = 5.0;

/// Fewest measurements of a light curve.
const FEWEST: usize = 3;

/// Reads or simulates the light curves of `settings`, and brings them to bins.
///
/// # Errors
/// Tables that cannot be read or are no light curves.
pub(super) fn read(settings: &mut Settings) -> Result<(), SceneError> {
    let of = |curve: &LightCurveSettings| measured(settings, curve);
    let mut all: Vec<Vec<Flux>> = settings.light_curves.iter().map(of).collect::<Result<_, _>>()?;
    for (k, measured) in all.iter_mut().enumerate() {
        settings.light_curves[k].left_out = leave_out(settings, k, measured)?;
    }
    let times_d: Vec<Vec<f64>> = all.iter().map(|one| one.iter().map(|flux| flux.time_d).collect()).collect();
    let width_d = bin_width_d(&times_d, settings.star.rotation_period_d);
    for (curve, mut measured) in settings.light_curves.iter_mut().zip(all) {
        measured.iter_mut().for_each(|one| one.sigma *= curve.sigma_scale);
        curve.binned = Some(LightCurve::new(&curve.name, curve.band, &measured, width_d, curve.segment_gap_d));
    }
    Ok(())
}

/// Leaves out what lies within the excluded windows of light curve `k`; how many measurements that were.
fn leave_out(settings: &Settings, k: usize, measured: &mut Vec<Flux>) -> Result<usize, ConfigError> {
    let (curve, before) = (&settings.light_curves[k], measured.len());
    measured.retain(|one| !curve.exclude.iter().any(|window| is_within(window, one.time_d)));
    let left = measured.len();
    if left < FEWEST.min(before) {
        let problem = format!("leaves {left} of {before} measurements, at least {FEWEST} are needed");
        return Err(settings.fault(&format!("{}.exclude", curve.key), &problem));
    }
    Ok(before - left)
}

/// The measurements of a light curve, in the order of time; errors as quoted.
///
/// # Errors
/// A table that cannot be read or is no light curve.
pub(super) fn measured(settings: &Settings, curve: &LightCurveSettings) -> Result<Vec<Flux>, SceneError> {
    match &curve.source {
        LightSource::File(path) => Ok(light_curve::read(path)?),
        LightSource::Simulate(light) => {
            let simulations: Vec<&Simulation> = settings
                .sets
                .iter()
                .filter_map(|set| match &set.source {
                    ObservationSource::Simulate(simulation) => Some(simulation),
                    ObservationSource::Files { .. } => None,
                })
                .collect();
            let times = || simulations.iter().flat_map(|simulation| &simulation.times_d).copied();
            let first = times().fold(f64::INFINITY, f64::min);
            let count = ((times().fold(f64::NEG_INFINITY, f64::max) - first) / light.cadence_d).floor() + 1.0;
            if count > MOST_SIMULATED {
                let problem = format!("{} makes {count} measurements, over {MOST_SIMULATED}", light.cadence_d);
                return Err(settings.fault(&format!("{}.simulate.cadence_d", curve.key), &problem).into());
            }
            let times_d: Vec<f64> = (0..count as usize).map(|k| first + k as f64 * light.cadence_d).collect();
            Ok(simulations[0].fluxes(&settings.star, &curve.band, &times_d, (light.sigma, light.seed)))
        }
    }
}

/// The bins of all light curves, which must tell something of the spots that the profiles see.
///
/// # Errors
/// A light curve that does not.
pub(super) fn near(settings: &Settings, observations: &Observations) -> Result<Vec<LightCurve>, ConfigError> {
    let lifetime_d = match settings.known_field().lifetime {
        Some(Lifetime::Static) => f64::INFINITY,
        Some(Lifetime::Days(days)) => days,
        None => Parameter::SpotLifetime.usual(),
    };
    let times_d = observations.times_d();
    let mut curves = Vec::new();
    for curve in &settings.light_curves {
        let Some(binned) = &curve.binned else { continue };
        let away = |bin: &FluxBin| times_d.iter().map(|t| (t - bin.time_d).abs()).fold(f64::INFINITY, f64::min);
        let nearest = binned.bins.iter().map(away).fold(f64::INFINITY, f64::min);
        if nearest > FORGOTTEN * lifetime_d {
            let [first, last] = [binned.bins[0].time_d, binned.bins[binned.bins.len() - 1].time_d];
            let problem = format!(
                "its times, {first:.2} to {last:.2} d, are {nearest:.0} d or more from any profile, and spots do not \
                 live that long; both must count days from one zero point"
            );
            return Err(settings.fault(&curve.key, &problem));
        }
        curves.push(binned.clone());
    }
    Ok(curves)
}

/// What was made of the light curves, a line each.
pub(super) fn remarks(settings: &Settings) -> Vec<String> {
    let said = |curve: &LightCurveSettings| {
        let LightCurve { name, bins, segments, .. } = curve.binned.as_ref()?;
        let sigma = bins.iter().map(|bin| bin.sigma).sum::<f64>() / bins.len() as f64;
        let parted = if *segments == 1 { "segment" } else { "segments" };
        let left_out = match curve.left_out {
            0 => String::new(),
            some => format!(", {some} measurements left out"),
        };
        let bins = bins.len();
        Some(format!("{name}: {bins} bins in {segments} {parted}, error {sigma:.1e} of the flux in the mean{left_out}"))
    };
    settings.light_curves.iter().filter_map(said).collect()
}

/// The fingerprint of the observations with that of the light curves, where there are any.
pub(super) fn fingerprint(profiles: String, settings: &Settings) -> String {
    if settings.light_curves.is_empty() {
        return profiles;
    }
    let mut hash = Sha256::new();
    hash.update(profiles);
    for curve in settings.light_curves.iter().filter_map(|curve| curve.binned.as_ref()) {
        hash.update((curve.bins.len() as u64).to_le_bytes());
        for bin in &curve.bins {
            [bin.time_d, bin.spread_d, bin.flux, bin.sigma].iter().for_each(|x| hash.update(x.to_le_bytes()));
        }
    }
    format!("{:x}", hash.finalize())
}
