//! The light curves of a config, binned.

use crate::data::config::{ConfigError, LightCurveSettings, OutlierTreatment, Settings};
use crate::data::dataset::is_within;
use crate::data::io::light_curve::{Measurements, fitting};
use crate::field::Lifetime;
use crate::model::Parameter;
use crate::numerics::text::plural;
use crate::star::observation::Observations;
use crate::surface::photometry::{Flux, LightCurve, bin_width_d, outliers};
use sha2::{Digest, Sha256};
use std::ops::Range;

/// Spots are uncorrelated after this many lifetimes.
const FORGOTTEN: f64 = 5.0;

/// Fewest measurements of a light curve.
const FEWEST: usize = 3;

/// Largest number of outliers that are named.
const NAMED: usize = 8;

/// A light curve in bins.
pub(super) struct Binned {
    pub curve: LightCurve,
    /// How many measurements lie within its excluded windows.
    left_out: usize,
    /// Remarks on its reading and its outliers.
    notes: Vec<String>,
}

/// The measurements of a light curve that are binned.
struct Kept {
    fluxes: Vec<Flux>,
    excluded: usize,
    notes: Vec<String>,
}

/// The light curves of `settings`, with these `measured` values.
///
/// # Errors
/// A light curve without remaining measurements.
pub(super) fn binned(settings: &Settings, measured: &[Measurements]) -> Result<Vec<Binned>, ConfigError> {
    let curves = || settings.light_curves.iter();
    let kept = curves().zip(measured).map(|(curve, all)| kept(settings, curve, all)).collect::<Result<Vec<_>, _>>()?;
    let times_d: Vec<Vec<f64>> = kept.iter().map(|one| one.fluxes.iter().map(|flux| flux.time_d).collect()).collect();
    let width_d = bin_width_d(&times_d, settings.star.rotation_period_d);
    let in_bins = |(of, Kept { fluxes, excluded, notes }): (&LightCurveSettings, Kept)| Binned {
        curve: LightCurve::new(&of.name, of.band, &fluxes, width_d, of.segment_gap_d),
        left_out: excluded,
        notes,
    };
    Ok(curves().zip(kept).map(in_bins).collect())
}

/// Measurements outside of the excluded windows that are not outliers, uncertainties scaled.
fn kept(settings: &Settings, curve: &LightCurveSettings, all: &Measurements) -> Result<Kept, ConfigError> {
    let is_kept = |one: &&Flux| !is_within(&curve.exclude, one.time_d);
    let mut fluxes: Vec<Flux> = all.fluxes.iter().filter(is_kept).copied().collect();
    let enough = |left: usize, key: &str| match left < FEWEST.min(all.fluxes.len()) {
        false => Ok(()),
        true => {
            let before = all.fluxes.len();
            let problem = format!("leaves {left} of {before} measurements, at least {FEWEST} are needed");
            Err(settings.fault(&format!("{}.{key}", curve.key), &problem))
        }
    };
    enough(fluxes.len(), "exclude")?;
    let excluded = all.fluxes.len() - fluxes.len();
    fluxes.iter_mut().for_each(|one| one.sigma *= curve.sigma_scale);
    let mut notes = all.remarks.clone();
    if curve.outliers == OutlierTreatment::LeaveOut {
        let found = outliers(&fluxes, settings.star.rotation_period_d, curve.segment_gap_d);
        notes.extend(wild_note(&fluxes, &found.wild, &curve.key));
        notes.extend(dips_note(&fluxes, &found.dips, &curve.key));
        let mut wild = vec![false; fluxes.len()];
        found.wild.iter().for_each(|(k, _)| wild[*k] = true);
        let mut wild = wild.into_iter();
        fluxes.retain(|_| wild.next() == Some(false));
        enough(fluxes.len(), "outliers")?;
    }
    let notes = notes.into_iter().map(|note| format!("{}: {note}", curve.name)).collect();
    Ok(Kept { fluxes, excluded, notes })
}

/// Measurements left out as outliers, and the values expected from their neighbours.
fn wild_note(fluxes: &[Flux], wild: &[(usize, f64)], key: &str) -> Option<String> {
    let runs: Vec<&[(usize, f64)]> = wild.chunk_by(|a, b| a.0 + 1 == b.0).collect();
    let off = |(k, expected): (usize, f64)| (fluxes[k].flux - expected).abs();
    let named = |run: &&[(usize, f64)]| {
        let worst = run.iter().copied().max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(run[0]);
        let (flux, expected) = (fluxes[worst.0].flux, worst.1);
        let digits = if expected.abs() < 100.0 { 4 } else { 0 };
        let [first, last] = [run[0].0, run[run.len() - 1].0].map(|k| fluxes[k].time_d);
        match run.len() {
            1 => format!("{first:.3} d (flux {flux:.digits$}, by its neighbours {expected:.digits$})"),
            all => format!(
                "{all} from {first:.3} to {last:.3} d (flux {flux:.digits$}, by their neighbours {expected:.digits$})"
            ),
        }
    };
    let mut all: Vec<String> = runs.iter().take(NAMED).map(named).collect();
    if runs.len() > NAMED {
        all.push(format!("and at {} more times", runs.len() - NAMED));
    }
    let points = if wild.len() == 1 { "point" } else { "points" };
    let (count, all) = (wild.len(), all.join("; "));
    (count > 0).then(|| format!("{count} outlying {points} rejected ({key}.outliers \"keep\" keeps them): {all}"))
}

/// Dips that may be transits.
fn dips_note(fluxes: &[Flux], dips: &[Range<usize>], key: &str) -> Option<String> {
    let named = |dip: &Range<usize>| {
        let [first, last] = [dip.start, dip.end - 1].map(|k| fluxes[k].time_d);
        format!("{first:.3} to {last:.3} d")
    };
    let mut all: Vec<String> = dips.iter().take(NAMED).map(named).collect();
    if dips.len() > NAMED {
        all.push(format!("and {} more", dips.len() - NAMED));
    }
    let all = all.join(", ");
    let text = format!(
        "dips of several points are kept, which no spots make; if they are transits, list them in {key}.exclude: {all}"
    );
    (!dips.is_empty()).then_some(text)
}

/// The bins of all light curves, which must constrain the spots that the profiles show.
///
/// # Errors
/// A light curve that does not.
pub(super) fn near(
    settings: &Settings,
    parts: &[Observations],
    all: &[Binned],
) -> Result<Vec<LightCurve>, ConfigError> {
    for (curve, Binned { curve: binned, .. }) in settings.light_curves.iter().zip(all) {
        let of_bins: Vec<f64> = binned.bins.iter().map(|bin| bin.time_d).collect();
        if let Some(problem) = far_from_profiles(settings, parts, &of_bins) {
            return Err(settings.fault(&curve.key, &problem));
        }
    }
    Ok(all.iter().map(|binned| binned.curve.clone()).collect())
}

/// How long (d) spots remain correlated.
pub(super) fn remembered_d(settings: &Settings) -> f64 {
    FORGOTTEN
        * match settings.known_field().lifetime {
            Some(Lifetime::Static) => f64::INFINITY,
            Some(Lifetime::Days(days)) => days,
            None => Parameter::SpotLifetime.usual(),
        }
}

/// Whether all times (d), in their order, are farther from those of the profiles than spots live.
pub(super) fn far_from_profiles(settings: &Settings, parts: &[Observations], of_bins: &[f64]) -> Option<String> {
    let remembered_d = remembered_d(settings);
    let times_d: Vec<f64> = parts.iter().flat_map(Observations::times_d).collect();
    let away = |time_d: &f64| times_d.iter().map(|t| (t - time_d).abs()).fold(f64::INFINITY, f64::min);
    let nearest = of_bins.iter().map(away).fold(f64::INFINITY, f64::min);
    if nearest <= remembered_d {
        return None;
    }
    let [first, last] = [of_bins.first()?, of_bins.last()?];
    let cure = match fitting(of_bins, &times_d, remembered_d) {
        Some(([own, other], add)) => format!(
            ". They fit if they are {own} and those of the profiles {other}: then add {add} to them, or give the \
            column of times its name"
        ),
        None => String::new(),
    };
    Some(format!(
        "its times, {first:.2} to {last:.2} d, are {nearest:.0} d or more from any profile, and spots do not live that \
        long; use one time system for both{cure}"
    ))
}

impl Binned {
    /// Exclusions and conversions, one sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// A description in one line.
    pub fn line(&self) -> String {
        let LightCurve { name, bins, segments, .. } = &self.curve;
        let sigma = bins.iter().map(|bin| bin.sigma).sum::<f64>() / bins.len() as f64;
        let counted = |count: usize, one: &str| format!("{count} {one}{}", plural(count));
        let (bins, segments) = (counted(bins.len(), "bin"), counted(*segments, "segment"));
        let left_out = match self.left_out {
            0 => String::new(),
            some => format!(", {some} measurements left out"),
        };
        format!("{name}: {bins} in {segments}, error {sigma:.1e} of the flux in the mean{left_out}")
    }
}

/// The fingerprint of profiles with that of light curves, where there are any.
pub fn with_light_curves(profiles: String, curves: &[LightCurve]) -> String {
    let rows =
        |curve: &LightCurve| curve.bins.iter().map(|bin| [bin.time_d, bin.spread_d, bin.flux, bin.sigma]).collect();
    with_tables(profiles, &curves.iter().map(rows).collect::<Vec<Vec<_>>>())
}

/// The fingerprint of other observations with that of tables of numbers, where there are any.
pub(super) fn with_tables<const N: usize>(others: String, tables: &[Vec<[f64; N]>]) -> String {
    if tables.is_empty() {
        return others;
    }
    let mut hash = Sha256::new();
    hash.update(others);
    for rows in tables {
        hash.update((rows.len() as u64).to_le_bytes());
        rows.iter().flatten().for_each(|x| hash.update(x.to_le_bytes()));
    }
    format!("{:x}", hash.finalize())
}
