//! The results of `map`: one image of a static star, or the maps of an evolving one; with the reason where they do not
//! fit.

use crate::data::calibrated::suspects;
use crate::data::diagnosis::{Diagnosis, Reason};
use crate::data::io::atomic::WriteError;
use crate::data::io::map::{self, MAP, MapResult};
use crate::data::io::provenance::{Measured, Provenance};
use crate::data::scene::Scene;
use crate::inference::detection::{KnownPlanets, PlanetFree};
use crate::model::Parameter;
use crate::numerics::text::plural;
use crate::planets::periodogram::Peak;
use crate::planets::speeds::with_unit;
use crate::planets::verdict::{CANDIDATE_FAP, false_alarm};
use crate::runs::blind_search::BlindSearchOptions;
use crate::surface::expansion::{Nuisance, nuisances};
use crate::surface::maps::{Deviation, ImageSummary};
use crate::surface::{At, ConstantVelocity, Linearised, MapSummary, NoMaps, Properties, SpotField, SurfaceMaps};
use std::path::{Path, PathBuf};

/// The star of a [`Scene`] reconstructed at the values of its config.
#[derive(Clone, Debug)]
pub struct Maps<'a> {
    scene: &'a Scene,
    maps: Box<SurfaceMaps>,
    /// RV offsets of data sets, where they are fitted.
    offsets: Vec<ConstantVelocity>,
    /// Why they do not fit as well as the uncertainties imply, or what is probably wrong with the model of the star.
    diagnosis: Option<Diagnosis>,
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum MapError {
    /// No maps are available at these times.
    #[error("{0}")]
    Times(String),
    /// There are none; with the likely reason.
    #[error("{}: {}{error}{reason}", config.display(), what(error))]
    NoMaps {
        /// The config.
        config: PathBuf,
        /// The error of the reconstruction.
        error: NoMaps,
        /// `; ` and the reason, or nothing.
        reason: String,
    },
}

/// The subject of an error.
fn what(error: &NoMaps) -> String {
    error.status().map_or_else(|| "imaging.chi2_target: ".to_owned(), |status| format!("no map ({status}): "))
}

impl<'a> Maps<'a> {
    /// The maps at the config's values; where they evolve at `times_d` (d), by default one map per night. `report` is
    /// called with the current stage.
    ///
    /// # Errors
    /// [`MapError`].
    pub fn of(scene: &'a Scene, times_d: Option<&[f64]>, report: &dyn Fn(&'static str)) -> Result<Self, MapError> {
        let &Properties { map_changes, under_way, .. } = scene.settings.imaging.objective.properties();
        report(under_way);
        let found = scene.maps(times_d);
        let is_bound = |name: &String| *name != Parameter::SpotLifetime.name();
        let suspicious = match &found {
            Ok(SurfaceMaps { field: Some(field), .. }) => {
                field.at_bounds.iter().any(is_bound) || field.stands_in().is_some()
            }
            Ok(_) => scene.measured.misfit_text().is_some(),
            Err(error) => !matches!(error, NoMaps::Times(_)),
        };
        if suspicious && (map_changes || found.is_err()) {
            report("diagnosing the misfit");
        }
        // an evolving map does not test the uncertainties
        let told = |diagnosis: &Diagnosis| !map_changes || diagnosis.reason != Reason::Errors;
        let diagnosis = suspicious.then(|| diagnosis(scene)).flatten().filter(told);
        match found {
            Ok(mut maps) => {
                if let (Some(field), Some(here)) = (&mut maps.field, &maps.here) {
                    report("estimating the errors of the field");
                    field.errors = scene.surface().model().field_errors(&scene.imager, here);
                }
                report("searching the RVs");
                let orbit = FreeVelocities::of(scene, &maps);
                let warning = orbit.as_ref().and_then(|free| free.warning(scene, &maps));
                maps.warnings.extend(warning);
                Ok(Maps {
                    scene,
                    maps: Box::new(maps),
                    offsets: orbit.map_or_else(Vec::new, |free| free.offsets),
                    diagnosis,
                })
            }
            Err(NoMaps::Times(error)) => Err(MapError::Times(error.to_owned())),
            Err(error) => {
                let reason = suspects(&scene.measured.profiles)
                    + &diagnosis.map_or_else(String::new, |diagnosis| format!("; {}", diagnosis.text));
                Err(MapError::NoMaps { config: scene.settings.path.clone(), error, reason })
            }
        }
    }

    /// Names of the files, in the order in which they are written.
    pub fn files(&self) -> Vec<&'static str> {
        map::files(&self.maps)
    }

    /// Writes `map.json`, `profiles.csv`, `rv.csv` and `fit.json` into `folder`, which must exist; where there are
    /// light curves `lightcurve.csv`, too, and where indicators count `indicators.csv`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let Maps { scene, maps, diagnosis, .. } = self;
        let (imager, observations, truth) = (&scene.imager, &scene.observations, scene.truth);
        let provenance = &Provenance { measured: self.measured(), ..scene.provenance() };
        // for an evolving map the truth differs at each time
        let true_map = maps.summary.image.as_ref().and_then(|_| scene.true_map());
        let true_map = true_map.as_deref();
        let diagnosis = diagnosis.as_ref().filter(|_| maps.field.is_none());
        let diagnosis = diagnosis.and_then(|diagnosis| serde_json::to_value(diagnosis).ok());
        MapResult { imager, observations, maps, true_map, truth, diagnosis, provenance }.write(folder)
    }

    /// Warnings on the fit and its statistics, with label and text per line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let Maps { scene, maps, diagnosis, .. } = self;
        let text = diagnosis.as_ref().map(|diagnosis| diagnosis.text.clone());
        let misfit = match (&maps.field, text) {
            (Some(_), text) => text,
            (None, Some(text)) => Some(format!("The model does not fit to the continuum noise: {text}")),
            // with several data sets the reason is not determined
            (None, None) => scene.measured.misfit_text(),
        };
        let warnings = maps.warnings.iter().chain(&maps.checks.warnings).cloned().chain(misfit);
        let mut lines: Vec<_> = warnings.map(|text| ("warning", text)).collect();
        lines.extend(numbers(maps));
        lines.extend(self.measured().lines());
        lines
    }

    /// Quantities measured from the observations, with the RV offsets of these maps.
    fn measured(&self) -> Measured {
        self.scene.measured.clone().with_zero_points(&self.offsets)
    }
}

/// Beginning of a warning that a search resolves.
pub const AS_ORBIT: &str = "Spot-corrected RVs vary as on a circular orbit";

/// Velocities of evolving maps where no orbit is assumed: as in the blind search of `periodogram`.
struct FreeVelocities {
    /// The best orbit, with its false-alarm probability; `None` where the config assumes an orbit.
    orbit: Option<(Peak, f64)>,
    /// RV offsets of data sets that are fitted: with that orbit if it is significant.
    offsets: Vec<ConstantVelocity>,
}

impl FreeVelocities {
    fn of(scene: &Scene, maps: &SurfaceMaps) -> Option<Self> {
        let here = maps.here.as_ref()?;
        let nuisances = nuisances(&scene.settings.free);
        let orbit = FreeVelocities::orbit(scene, here, &nuisances);
        let significant = orbit.as_ref().filter(|(_, probability)| *probability < CANDIDATE_FAP);
        let constants = here.constants(&scene.imager, &nuisances, (significant.map(|(peak, _)| peak), None));
        Some(FreeVelocities { orbit, offsets: constants.map_or_else(Vec::new, |constants| constants.offsets) })
    }

    fn orbit(scene: &Scene, here: &Linearised, nuisances: &[Nuisance]) -> Option<(Peak, f64)> {
        let values = scene.settings.values;
        if values[Parameter::K] != 0.0 {
            return None;
        }
        let options = BlindSearchOptions::default();
        let settings = options.detection(scene);
        let frequencies = options.frequencies(scene).ok()?;
        let at = At { imager: &scene.imager, values, nuisances };
        let surface = scene.surface().model();
        let star = (here.clone(), KnownPlanets::default());
        let search = PlanetFree::of(&*surface, at, star, &frequencies, settings.search, &|_| ()).ok()?.blind;
        let peak = search.best();
        Some((*peak, search.false_alarm.probability(peak.orbit.delta_ln_l).value()))
    }

    /// The warning that the velocities vary as an orbit would, which the jitter has absorbed; `None` also where the
    /// maps belong to another star.
    fn warning(&self, scene: &Scene, maps: &SurfaceMaps) -> Option<String> {
        let absorbs = maps.field.as_ref().and_then(SpotField::absorbs);
        if scene.measured.other_rotation.is_some_and(|other| other.is_far()) || absorbs.is_some() {
            return None;
        }
        let jitter_kms = maps.field.as_ref().map_or(0.0, |field| field.velocity_jitter_kms);
        let (peak, chance) = self.orbit.as_ref().filter(|(_, chance)| *chance < CANDIDATE_FAP)?;
        let signal = peak.signal(scene.imager.star.rotation_period_d);
        let absorbed = match jitter_kms {
            0.0 => String::new(),
            kms => format!("; the RV jitter of {} absorbs it", with_unit(kms)),
        };
        Some(format!(
            "{AS_ORBIT} ({}, {}){absorbed}: run `dimcmc periodogram {}`.",
            signal.words(),
            false_alarm(*chance, BlindSearchOptions::default().draws),
            scene.settings.path.display()
        ))
    }
}

/// Why no map of `scene` fits, in the format of [`Maps`]: `; ` and the likely reason, or nothing.
pub fn reason(scene: &Scene) -> String {
    let map_changes = scene.settings.imaging.objective.properties().map_changes;
    let told = diagnosis(scene).filter(|diagnosis| !map_changes || diagnosis.reason != Reason::Errors);
    suspects(&scene.measured.profiles) + &told.map_or_else(String::new, |told| format!("; {}", told.text))
}

/// Why no map of `scene` fits, by test fits.
fn diagnosis(scene: &Scene) -> Option<Diagnosis> {
    Diagnosis::of(scene)
}

/// The statistics of the maps.
fn numbers(maps: &SurfaceMaps) -> Vec<(&'static str, String)> {
    let SurfaceMaps { summary: fit, field, light, nuisances, zero_points_kms, .. } = maps;
    let MapSummary { chi2, chi2_per_datum, data, profiles, .. } = fit;
    let mut lines = field.as_ref().map_or_else(Vec::new, of_field);
    lines.push(("chi2", format!("{chi2:.2} for {data} data in {profiles} profiles (χ²/N = {chi2_per_datum:.4})")));
    let of_static = fit.chi2_per_datum_unchanging;
    lines.extend(of_static.map(|chi2| ("static spots", format!("χ²/N = {chi2:.4}"))));
    if !light.is_empty() {
        let squares: f64 = light.iter().map(|fit| ((fit.bin.flux - fit.model) / fit.bin.sigma).powi(2)).sum();
        let bins = light.len();
        let per_bin = squares / bins as f64;
        lines.push(("flux", format!("chi2 {squares:.2} for {bins} bin{} (χ²/N = {per_bin:.4})", plural(bins))));
    }
    lines.extend(fit.image.as_ref().map_or_else(Vec::new, of_image));
    lines.push(("residuals", format!("{:.3e} rms, {:.3e} in the line core", fit.residual_rms, fit.residual_rms_core)));
    lines.push(("RV observed", format!("{} rms", with_unit(fit.observed_rv_rms_kms))));
    if let Some(filtered) = fit.filtered_rv_rms_kms {
        let filtered = match (nuisances.is_empty(), zero_points_kms.is_empty()) {
            (true, true) => format!("{} rms", with_unit(filtered)),
            (true, false) => "n/a (degenerate with the fitted RV offsets)".to_owned(),
            (false, _) => "n/a (degenerate with the fitted continuum)".to_owned(),
        };
        lines.push(("RV filtered", filtered));
        lines.push(("RV error", format!("{} (photon noise)", with_unit(fit.photon_rv_error_kms))));
    }
    if let Some((rms, error)) = fit.rv_rms_kms.zip(fit.rv_error_kms) {
        let jitter_kms = field.as_ref().map_or(0.0, |field| field.velocity_jitter_kms);
        let counted = match jitter_kms {
            0.0 => String::new(),
            kms => format!(", RV jitter of {} included", with_unit(kms)),
        };
        let text = format!("{} rms, uncertainty {} (correlated){counted}", with_unit(rms), with_unit(error));
        lines.push(("RV corrected", text));
    }
    let rms = |squares: f64, count: usize| (squares / count as f64).sqrt();
    if !zero_points_kms.is_empty() {
        let squares = zero_points_kms.iter().map(|v| v * v).sum();
        lines.push((
            "RV shifts",
            format!("{} rms (of single profiles)", with_unit(rms(squares, zero_points_kms.len()))),
        ));
    }
    if !nuisances.is_empty() {
        let [offset, slope, width] =
            [0, 1, 2].map(|i| rms(nuisances.iter().map(|n| n.numbers()[i].powi(2)).sum(), nuisances.len()));
        let width = 100.0 * width;
        lines.push(("continuum", format!("offset {offset:.1e}, slope {slope:.1e}, equivalent width {width:.2} % rms")));
    }
    let times: Vec<f64> = maps.maps.iter().filter_map(|map| map.time_d).collect();
    match times[..] {
        [] => {}
        [only] => lines.push(("map", format!("at {only:.3} d"))),
        [first, .., last] => {
            lines.push(("maps", format!("{} from {first:.3} to {last:.3} d (times in {MAP})", times.len())));
        }
    }
    lines
}

/// Those of a field.
fn of_field(field: &SpotField) -> Vec<(&'static str, String)> {
    let caveat = |name: &str| field.caveat(name).map_or_else(String::new, |caveat| format!(", {caveat}"));
    vec![
        ("amplitude", format!("{} (SD of the spot filling factor){}", field.amplitude(), caveat("spot_amplitude"))),
        ("power-law index", format!("{} ({}){}", field.slope(), field.spectrum(), caveat("spot_slope"))),
        ("lifetime", field.lifetime() + &caveat("spot_lifetime_d")),
        ("RV jitter", format!("{} (without a planet)", with_unit(field.velocity_jitter_kms))),
        ("ln Z", format!("{:.2}", field.ln_evidence)),
    ]
}

/// Those of a map of maximum entropy.
fn of_image(image: &ImageSummary) -> Vec<(&'static str, String)> {
    let spottedness = match image.deviation {
        None => format!("{:.5}", image.spottedness),
        Some(Deviation { darkness, brightness_excess }) => {
            format!("{:.5} rms: {darkness:.5} dark, {brightness_excess:.5} bright", image.spottedness)
        }
    };
    vec![
        ("spottedness", spottedness),
        ("entropy", format!("{:.5} at lambda = {:.4e}", image.entropy, image.lambda)),
        ("TEST", format!("{:.1e}", image.test)),
    ]
}
