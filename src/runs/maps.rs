//! What `map` finds: one image of the star, or the maps of a star that may change; with the reason where they do not
//! fit.

use crate::data::diagnosis::{Diagnosis, Reason};
use crate::data::io::atomic::WriteError;
use crate::data::io::field::FieldRecord;
use crate::data::io::map::{ChangingMapResult, FILES, LIGHT_CURVES, MapResult};
use crate::data::scene::Scene;
use crate::model::Parameter;
use crate::surface::fit::{ChangingFit, ChangingSummary, Deviation, Fit, FitSummary, NoField};
use crate::surface::objective::ObjectiveKind;
use crate::surface::static_map::ReferenceError;
use std::path::{Path, PathBuf};

/// The star of a [`Scene`] reconstructed at the values of its config.
#[derive(Clone, Debug)]
pub struct Maps<'a> {
    scene: &'a Scene,
    found: Found,
}

#[derive(Clone, Debug)]
enum Found {
    /// The map of greatest entropy, and why it does not fit as well as the errors promise, if it does not.
    One(Box<Fit>, Option<Diagnosis>),
    /// Maps of a star that may change, and what is likely to be wrong with the model of the star.
    Changing(Box<ChangingFit>, Option<String>),
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// The target chi2 is not reached; with the likely reason.
    #[error("{}: imaging.chi2_target: {error}{reason}", config.display())]
    Reference {
        /// The config.
        config: PathBuf,
        /// What the reconstruction came to.
        error: ReferenceError,
        /// `; ` and why, or nothing.
        reason: String,
    },
    /// No maps can be asked for at these times.
    #[error("{0}")]
    Times(String),
    /// No field of spots that changes fits; with the likely reason.
    #[error("{}: no map ({}): {error}{reason}", config.display(), error.status())]
    Field {
        /// The config.
        config: PathBuf,
        /// What the fit came to.
        error: NoField,
        /// `; ` and why, or nothing.
        reason: String,
    },
}

impl<'a> Maps<'a> {
    /// The map of greatest entropy; or by `imaging.objective` "marginal-likelihood" maps at `times_d` (d), by default
    /// a map a night. `report` is told what is under way.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn of(scene: &'a Scene, times_d: Option<&[f64]>, report: &dyn Fn(&'static str)) -> Result<Self, MapError> {
        let found = match (scene.settings.imaging.objective, times_d) {
            (ObjectiveKind::MarginalLikelihood, times_d) => changing(scene, times_d, report),
            (_, None) => unchanging(scene, report),
            (objective, Some(_)) => Err(MapError::Times(format!(
                "the map does not change with imaging.objective {:?}; maps that do take \"marginal-likelihood\"",
                objective.name()
            ))),
        };
        Ok(Maps { scene, found: found? })
    }

    /// Names of the files, in the order in which they are written.
    pub fn files(&self) -> Vec<&'static str> {
        let has_light = matches!(&self.found, Found::Changing(fit, _) if !fit.light.is_empty());
        FILES.into_iter().chain(has_light.then_some(LIGHT_CURVES)).collect()
    }

    /// Writes `map.json`, `profiles.csv`, `rv.csv` and `fit.json` into `folder`, which must exist; where there are
    /// light curves `lightcurve.csv`, too.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let Maps { scene, found } = self;
        let (imager, observations, truth) = (&scene.imager, &scene.observations, scene.truth);
        let provenance = &scene.provenance();
        match found {
            Found::One(fit, diagnosis) => {
                let true_map = scene.true_map();
                let true_map = true_map.as_deref();
                let diagnosis = diagnosis.as_ref().and_then(|diagnosis| serde_json::to_value(diagnosis).ok());
                MapResult { imager, observations, fit, true_map, truth, diagnosis, provenance }.write(folder)
            }
            Found::Changing(fit, _) => ChangingMapResult { imager, observations, fit, truth, provenance }.write(folder),
        }
    }

    /// How good the fit is and what warns of it, label and text a line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let warning = |text: &String| ("warning", text.clone());
        let (mut lines, warnings): (_, Vec<_>) = match &self.found {
            Found::One(fit, diagnosis) => {
                let misfit = diagnosis.as_ref().map(|Diagnosis { text, .. }| {
                    ("warning", format!("the model does not fit as well as the continuum promises: {text}"))
                });
                // of several data sets the reason is not looked for
                let of_set = self.scene.measured.misfit_text().filter(|_| diagnosis.is_none());
                let misfit = misfit.or(of_set.map(|text| ("warning", text)));
                (of_one(fit), fit.checks.warnings.iter().map(warning).chain(misfit).collect())
            }
            Found::Changing(fit, reason) => {
                (of_changing(fit), fit.warnings.iter().chain(&fit.checks.warnings).chain(reason).map(warning).collect())
            }
        };
        lines.extend(self.scene.measured.lines());
        lines.extend(warnings);
        lines
    }
}

/// The map of greatest entropy.
fn unchanging(scene: &Scene, report: &dyn Fn(&'static str)) -> Result<Found, MapError> {
    report("reconstructing");
    let fit = scene.map().map_err(|error| {
        report("looking for the reason");
        let reason = diagnosis(scene).map_or_else(String::new, |diagnosis| format!("; {}", diagnosis.text));
        MapError::Reference { config: scene.settings.path.clone(), error, reason }
    })?;
    let misfits = scene.measured.misfit_text().is_some();
    Ok(Found::One(Box::new(fit), if misfits { diagnosis(scene) } else { None }))
}

/// Maps of a star that may change.
fn changing(scene: &Scene, times_d: Option<&[f64]>, report: &dyn Fn(&'static str)) -> Result<Found, MapError> {
    report("fitting the field of spots");
    let fit = scene.changing_maps(times_d);
    let suspicious = match &fit {
        Ok(fit) => fit.fitted.at_bounds.iter().any(|name| *name != Parameter::SpotLifetime.name()),
        Err(error) => !matches!(error, NoField::Times(_)),
    };
    if suspicious {
        report("looking for the reason");
    }
    let reason = suspicious.then(|| wrong_with_the_model(scene)).flatten();
    match fit {
        Ok(fit) => Ok(Found::Changing(Box::new(fit), reason)),
        Err(error @ NoField::Times(_)) => Err(MapError::Times(error.to_string())),
        Err(error) => {
            let reason = reason.map(|text| format!("; {text}")).unwrap_or_default();
            Err(MapError::Field { config: scene.settings.path.clone(), error, reason })
        }
    }
}

/// What is likely to be wrong with the model of the star, as far as a map that does not change tells.
fn wrong_with_the_model(scene: &Scene) -> Option<String> {
    diagnosis(scene).filter(|diagnosis| diagnosis.reason != Reason::Errors).map(|diagnosis| diagnosis.text)
}

/// Why no map of `scene` fits, by trying.
fn diagnosis(scene: &Scene) -> Option<Diagnosis> {
    Diagnosis::of(scene, scene.whole_over_continuum().as_ref())
}

fn of_changing(fit: &ChangingFit) -> Vec<(&'static str, String)> {
    let ChangingSummary { chi2, chi2_per_datum, data, profiles, .. } = fit.summary;
    let numbers = &fit.summary;
    let field = FieldRecord::of(&fit.fitted);
    let bound = |name: &str| match field.at_bounds.iter().any(|reached| reached == name) {
        true => ", at the bound of its search",
        false => "",
    };
    let lifetime = field.spot_lifetime_d.map_or("for ever".to_owned(), |days| format!("{days:.2} d"));
    let times: Vec<String> = fit.maps.iter().map(|map| format!("{:.3}", map.time_d)).collect();
    let mut lines = vec![
        ("amplitude", format!("{:.4} (of the spot filling factor)", field.spot_amplitude)),
        ("slope", format!("{:.3} ({}){}", field.spot_slope, field.spectrum(), bound("spot_slope"))),
        ("lifetime", format!("{lifetime}{}", bound("spot_lifetime_d"))),
        ("jitter", format!("{:.4} km/s", field.velocity_jitter_kms)),
        ("ln evidence", format!("{:.2}", field.ln_evidence)),
        ("chi2", format!("{chi2:.2} for {data} data in {profiles} profiles ({chi2_per_datum:.4} per datum)")),
    ];
    let unchanging = numbers.chi2_per_datum_unchanging;
    lines.extend(
        unchanging.map(|chi2| ("unchanging", format!("{chi2:.4} per datum, had the same spots lived for ever"))),
    );
    if !fit.light.is_empty() {
        let squares: f64 = fit.light.iter().map(|fit| ((fit.bin.flux - fit.model) / fit.bin.sigma).powi(2)).sum();
        let bins = fit.light.len();
        lines.push(("flux", format!("chi2 {squares:.2} for {bins} bins ({:.4} per bin)", squares / bins as f64)));
    }
    let residuals = format!("{:.3e} rms, {:.3e} in the line core", numbers.residual_rms, numbers.residual_rms_core);
    lines.extend([
        ("residuals", residuals),
        ("RV observed", format!("{:.4} km/s rms", numbers.observed_rv_rms_kms)),
        ("RV, no spots", format!("{:.4} km/s rms, error {:.4} km/s", numbers.rv_rms_kms, numbers.rv_error_kms)),
        ("maps at", format!("{} d", times.join(", "))),
    ]);
    lines
}

fn of_one(Fit { summary: fit, nuisances, zero_points_kms, .. }: &Fit) -> Vec<(&'static str, String)> {
    let FitSummary { chi2, chi2_per_datum, data, profiles, .. } = fit;
    let spottedness = match fit.deviation {
        None => format!("{:.5}", fit.spottedness),
        Some(Deviation { darkness, brightness_excess }) => {
            format!("{:.5} rms: {darkness:.5} dark, {brightness_excess:.5} bright", fit.spottedness)
        }
    };
    let filtered = match (nuisances.is_empty(), zero_points_kms.is_empty()) {
        (true, true) => format!("{:.4} km/s rms", fit.filtered_rv_rms_kms),
        (true, false) => "not told: first moments follow the zero points that were fitted".to_owned(),
        (false, _) => "not told: first moments follow the continuum that was fitted".to_owned(),
    };
    let mut lines = vec![
        ("chi2", format!("{chi2:.2} for {data} data in {profiles} profiles ({chi2_per_datum:.4} per datum)")),
        ("spottedness", spottedness),
        ("entropy", format!("{:.5} at lambda = {:.4e}", fit.entropy, fit.lambda)),
        ("TEST", format!("{:.1e}", fit.test)),
        ("residuals", format!("{:.3e} rms, {:.3e} in the line core", fit.residual_rms, fit.residual_rms_core)),
        ("RV observed", format!("{:.4} km/s rms", fit.observed_rv_rms_kms)),
        ("RV filtered", filtered),
        ("RV error", format!("{:.4} km/s (photon noise)", fit.photon_rv_error_kms)),
    ];
    let rms = |squares: f64, count: usize| (squares / count as f64).sqrt();
    if !zero_points_kms.is_empty() {
        let squares = zero_points_kms.iter().map(|v| v * v).sum();
        lines.push(("zero points", format!("{:.4} km/s rms", rms(squares, zero_points_kms.len()))));
    }
    if !nuisances.is_empty() {
        let [offset, slope, width] =
            [0, 1, 2].map(|i| rms(nuisances.iter().map(|n| n.numbers()[i].powi(2)).sum(), nuisances.len()));
        let width = 100.0 * width;
        lines.push(("continuum", format!("offset {offset:.1e}, slope {slope:.1e}, equivalent width {width:.2} % rms")));
    }
    lines
}
