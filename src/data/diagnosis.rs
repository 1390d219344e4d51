//! Why no map fits: one property at a time is changed, and the most effective change is the likely reason.
//!
//! Tested are vsini, width, wings and strength of the local line, the continuum, the velocity range, the rotation
//! period and faculae, each on coarse maps with the uncertainties at which the config's own map fits. For the most
//! effective change the best value is sought, and the smallest chi2 that a map then reaches. If nothing helps, the
//! uncertainties are too small, or the profiles contain a signal outside the model of the star. Of two simultaneous
//! faults the more effective change is reported. Profiles with the lines of two stars, and variances given as standard
//! deviations, are recognised without maps.

mod change;

use crate::data::calibrated::of_sets;
use crate::data::scene::Scene;
use crate::star::BrightnessModel;
use crate::star::observation::Observations;
use crate::surface::calibration::first_look::DoubleLines;
use crate::surface::calibration::noise::{FITTED, by_neighbours, chi2_at, factor_to_fit, variances};
use change::{Change, Patient};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// Pixels of the maps: enough to see whether a change helps.
const PIXELS: usize = 500;

/// A change is a reason when chi2 falls to less than this fraction of its former value, and its excess over the target
/// likewise.
const HELPS: f64 = 0.8;
const HELPS_EXCESS: f64 = 0.6;

/// Rounds of refinement between the tried values.
const REFINEMENTS: usize = 2;

/// The likely reason why a map does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Projected rotation velocity.
    Vsini,
    /// Width of the local line.
    LineWidth,
    /// Shape of the local line: wings that a Gaussian lacks.
    LineWings,
    /// Strength of the local line.
    EquivalentWidth,
    /// Level of the continuum.
    Continuum,
    /// Velocities that are used.
    VelocityRange,
    /// Rotation period.
    RotationPeriod,
    /// Content of the map: bright as well as dark pixels.
    Brightness,
    /// Lines of two stars.
    DoubleLines,
    /// Variances in place of standard deviations.
    Variances,
    /// Nothing that was tried.
    Errors,
}

/// Why no map fits, by trying.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The likely reason.
    pub reason: Reason,
    /// The reason and the remedy in words.
    pub text: String,
    /// chi2 per independent datum of a map without a change, with uncertainties from the continuum, or as given; absent
    /// where no map was made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chi2_per_datum: Option<f64>,
    /// The same with the change that helps most.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chi2_per_datum_changed: Option<f64>,
    /// All tested changes, with chi2 relative to that without a change.
    pub tried: Vec<Tried>,
}

/// One change.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// The change.
    pub change: String,
    /// chi2 of its map relative to the unchanged one's; null where there is none.
    pub relative_chi2: Option<f64>,
}

impl Diagnosis {
    /// The diagnosis of a scene that no map fits within its uncertainties: by inspection, or by tests. `None` where
    /// there is no map at all. With several data sets nothing is tested.
    pub fn of(scene: &Scene) -> Option<Self> {
        if let Some(seen) = Self::at_sight(scene) {
            return Some(seen);
        }
        if scene.settings.sets.len() > 1 {
            return None;
        }
        let patient = patient(scene);
        let unchanged = factor(&patient, 1.0)?;
        let relative = |changes: &[Change]| -> Vec<Option<f64>> {
            changes.par_iter().map(|change| relative_chi2(&patient, change, unchanged)).collect()
        };
        let changes = Change::all(&patient);
        let found = relative(&changes);
        let mut tried: Vec<(Change, Option<f64>)> = changes.into_iter().zip(found).collect();
        for _ in 0..REFINEMENTS {
            let Some(best) = best(&tried) else { break };
            let between = best.between(&tried.iter().map(|(change, _)| change.clone()).collect::<Vec<_>>());
            let found = relative(&between);
            tried.extend(between.into_iter().zip(found));
        }
        let cure = best(&tried).and_then(|change| {
            let changed = factor(&change.applied(&patient)?, unchanged)?;
            helps(unchanged, changed).then_some((change, changed))
        });
        let chi2 = |factor: f64| FITTED * factor * factor;
        let (reason, changed) = cure.as_ref().map_or((Reason::Errors, unchanged), |(c, f)| (c.reason(), *f));
        let text = match &cure {
            Some((change, changed)) => format!(
                "likely cause: {}; with {} a map reaches chi2/N = {:.3} in place of {:.3}",
                change.name(),
                change.words(&patient),
                chi2(*changed),
                chi2(unchanged)
            ),
            None => format!(
                "likely cause: the uncertainties, or an effect that is not in the model: a map reaches chi2/N = {:.3}; \
                 no single change of vsini, line, continuum, velocity range or rotation period helps, only \
                 uncertainties {unchanged:.2} times as large",
                chi2(unchanged)
            ),
        };
        let tried = tried
            .iter()
            .map(|(change, relative_chi2)| Tried { change: change.words(&patient), relative_chi2: *relative_chi2 });
        Some(Diagnosis {
            reason,
            text,
            chi2_per_datum: Some(chi2(unchanged)),
            chi2_per_datum_changed: Some(chi2(changed)),
            tried: tried.collect(),
        })
    }

    /// Faults that are visible without a map, in any of the data sets.
    pub fn at_sight(scene: &Scene) -> Option<Self> {
        let parts = of_sets(&scene.imager, &scene.whole_over_continuum());
        let several = parts.len() > 1;
        parts.iter().zip(&scene.settings.sets).find_map(|(part, set)| {
            let double =
                DoubleLines::of(part, set.star.line.sigma_kms).map(|lines| (Reason::DoubleLines, lines.text()));
            let variances = || Some((Reason::Variances, by_neighbours(part).and_then(|(q, f)| variances(q, f))?));
            let (reason, text) = double.or_else(variances)?;
            let text = if several { format!("{}: {text}", set.name) } else { text };
            Some(Diagnosis { reason, text, chi2_per_datum: None, chi2_per_datum_changed: None, tried: Vec::new() })
        })
    }
}

/// The subject: coarse maps of the scene, with uncertainties from the continuum where that was measured.
fn patient(scene: &Scene) -> Patient {
    let mut settings = scene.settings.clone();
    settings.imaging.pixels = settings.imaging.pixels.min(PIXELS);
    // a field of spots is brighter or darker than the photosphere
    if settings.imaging.objective.properties().has_field {
        settings.imaging.brightness = Some(BrightnessModel::BrightAndDark);
    }
    let (mut scale, mut correlated_bins) = (1.0, 1.0);
    if let Some(errors) = scene.measured.errors.as_ref() {
        correlated_bins = errors.correlated_bins;
        if let (Some(applied), quoted) = (errors.sigma_scale, errors.continuum.unwrap_or(1.0)) {
            scale = quoted * correlated_bins.sqrt() / applied;
        }
    }
    let mut observations = scene.observations.clone();
    scale_errors(&mut observations, scale);
    let whole = Arc::new(scene.whole_over_continuum());
    Patient { settings, observations, whole, seasons: scene.measured.seasons.clone(), correlated_bins }
}

fn scale_errors(observations: &mut Observations, factor: f64) {
    observations.profiles.iter_mut().flat_map(|p| &mut p.sigma).for_each(|sigma| *sigma *= factor);
}

/// Factor on the uncertainties at which a map fits; `start` is a guess.
fn factor(patient: &Patient, start: f64) -> Option<f64> {
    let imager = |factor: f64| {
        let mut observations = patient.observations.clone();
        scale_errors(&mut observations, start * factor);
        patient.imager(observations)
    };
    factor_to_fit(patient.settings.values, patient.correlated_bins, imager).ok()?.ok().map(|found| start * found)
}

/// Whether a map that fits with uncertainties times `changed`, instead of `unchanged`, is significantly better.
fn helps(unchanged: f64, changed: f64) -> bool {
    let excess = |factor: f64| (factor * factor - 1.0).max(0.0);
    changed.powi(2) < HELPS * unchanged.powi(2) && excess(changed) < HELPS_EXCESS * excess(unchanged)
}

/// chi2 with a change over that without, both with the uncertainties at which a map fits without it.
fn relative_chi2(patient: &Patient, change: &Change, unchanged: f64) -> Option<f64> {
    let mut changed = change.applied(patient)?;
    scale_errors(&mut changed.observations, unchanged);
    let imager = changed.imager(changed.observations.clone()).ok()?;
    chi2_at(&imager, changed.settings.values, changed.correlated_bins).ok().map(|chi2| chi2 / FITTED)
}

/// The change with the smallest chi2.
fn best(tried: &[(Change, Option<f64>)]) -> Option<Change> {
    let found = tried.iter().filter_map(|(change, chi2)| Some((change, (*chi2)?)));
    found.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(change, _)| change.clone())
}
