//! The light curves of a config, brought to bins.

use crate::data::config::{ConfigError, LightCurveSettings, Settings};
use crate::data::dataset::is_within;
use crate::field::Lifetime;
use crate::model::Parameter;
use crate::star::observation::Observations;
use crate::surface::photometry::{Flux, FluxBin, LightCurve, bin_width_d};
use sha2::{Digest, Sha256};

/// Spots know nothing of themselves after so many lifetimes.
const FORGOTTEN: f64 = 5.0;

/// Fewest measurements of a light curve.
const FEWEST: usize = 3;

/// A light curve in bins.
pub(super) struct Binned {
    pub curve: LightCurve,
    /// How many measurements lie within its excluded windows.
    left_out: usize,
}

/// The light curves of `settings`, of which this was `measured`.
///
/// # Errors
/// One of which nothing is left.
pub(super) fn binned(settings: &Settings, measured: &[Vec<Flux>]) -> Result<Vec<Binned>, ConfigError> {
    let curves = || settings.light_curves.iter().zip(measured);
    let kept = curves().map(|(curve, all)| kept(settings, curve, all)).collect::<Result<Vec<_>, _>>()?;
    let times_d: Vec<Vec<f64>> = kept.iter().map(|one| one.iter().map(|flux| flux.time_d).collect()).collect();
    let width_d = bin_width_d(&times_d, settings.star.rotation_period_d);
    let in_bins = |((of, all), kept): ((&LightCurveSettings, &Vec<Flux>), Vec<Flux>)| Binned {
        curve: LightCurve::new(&of.name, of.band, &kept, width_d, of.segment_gap_d),
        left_out: all.len() - kept.len(),
    };
    Ok(curves().zip(kept).map(in_bins).collect())
}

/// What lies outside of the excluded windows, errors scaled.
fn kept(settings: &Settings, curve: &LightCurveSettings, all: &[Flux]) -> Result<Vec<Flux>, ConfigError> {
    let mut kept: Vec<Flux> = all.iter().filter(|one| !is_within(&curve.exclude, one.time_d)).copied().collect();
    if kept.len() < FEWEST.min(all.len()) {
        let (left, before) = (kept.len(), all.len());
        let problem = format!("leaves {left} of {before} measurements, at least {FEWEST} are needed");
        return Err(settings.fault(&format!("{}.exclude", curve.key), &problem));
    }
    kept.iter_mut().for_each(|one| one.sigma *= curve.sigma_scale);
    Ok(kept)
}

/// The bins of all light curves, which must tell something of the spots that the profiles see.
///
/// # Errors
/// A light curve that does not.
pub(super) fn near(
    settings: &Settings,
    parts: &[Observations],
    all: &[Binned],
) -> Result<Vec<LightCurve>, ConfigError> {
    let lifetime_d = match settings.known_field().lifetime {
        Some(Lifetime::Static) => f64::INFINITY,
        Some(Lifetime::Days(days)) => days,
        None => Parameter::SpotLifetime.usual(),
    };
    let times_d: Vec<f64> = parts.iter().flat_map(Observations::times_d).collect();
    for (curve, Binned { curve: binned, .. }) in settings.light_curves.iter().zip(all) {
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
    }
    Ok(all.iter().map(|binned| binned.curve.clone()).collect())
}

impl Binned {
    /// What was made of it, in a line.
    pub fn line(&self) -> String {
        let LightCurve { name, bins, segments, .. } = &self.curve;
        let sigma = bins.iter().map(|bin| bin.sigma).sum::<f64>() / bins.len() as f64;
        let parted = if *segments == 1 { "segment" } else { "segments" };
        let left_out = match self.left_out {
            0 => String::new(),
            some => format!(", {some} measurements left out"),
        };
        let bins = bins.len();
        format!("{name}: {bins} bins in {segments} {parted}, error {sigma:.1e} of the flux in the mean{left_out}")
    }
}

/// The fingerprint of the observations with that of the light curves, where there are any.
pub(super) fn fingerprint(profiles: String, curves: &[Binned]) -> String {
    if curves.is_empty() {
        return profiles;
    }
    let mut hash = Sha256::new();
    hash.update(profiles);
    for Binned { curve, .. } in curves {
        hash.update((curve.bins.len() as u64).to_le_bytes());
        for bin in &curve.bins {
            [bin.time_d, bin.spread_d, bin.flux, bin.sigma].iter().for_each(|x| hash.update(x.to_le_bytes()));
        }
    }
    format!("{:x}", hash.finalize())
}
