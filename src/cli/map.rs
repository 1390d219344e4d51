//! `dimcmc map`: one reconstruction at the config's parameter values.

use super::output::Output;
use super::report_lines::Report;
use super::{Failure, Global, progress};
use crate::data::diagnosis::{Diagnosis, Reason};
use crate::data::io::map::{ChangingMapResult, FILES, LIGHT_CURVES, MapResult};
use crate::data::io::periodogram::FieldRecord;
use crate::data::scene::Scene;
use crate::posterior::fit::{ChangingFit, ChangingSummary, Deviation, Fit, FitSummary, NoField};
use crate::posterior::noise::MeasuredErrors;
use crate::posterior::objective::{ObjectiveKind, Parameter, Reference, ReferenceError};
use std::path::{Path, PathBuf};

/// Reconstruct the spots at the config's parameter values
///
/// The map of greatest entropy whose chi2 is `imaging.chi2_target`. Writes map.json (the map), profiles.csv (observed
/// and model profiles), rv.csv (radial velocities before and after the model is taken out of them) and fit.json (how
/// good the fit is).
///
/// With `imaging.objective` set to "marginal-likelihood" the star may change: the amplitude, slope and lifetime of its
/// spots are fitted, and map.json holds the most probable map and its standard deviation at every time asked for, by
/// default a map a night. With light curves (`photometry`), lightcurve.csv has them and what the maps make of them.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc map configs/demo.json --out demo_map")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Times (d) of the maps of a star that may change, as in the list of profiles; by default the mean time of each
    /// night
    #[arg(long, value_name = "D,D,...", value_delimiter = ',', allow_negative_numbers = true)]
    times: Option<Vec<f64>>,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    args.output.check()?;
    let scene = Scene::load(&args.config)?;
    args.output.spare(&scene.files(), |name| FILES.contains(&name) || name == LIGHT_CURVES)?;
    match (scene.settings.imaging.objective, &args.times) {
        (ObjectiveKind::MarginalLikelihood, _) => changing(args, global, &scene),
        (_, None) => unchanging(args, global, &scene),
        (objective, Some(_)) => Err(Failure::input(format!(
            "--times: the map does not change with imaging.objective {:?}; maps that do take \"marginal-likelihood\"",
            objective.name()
        ))),
    }
}

/// The map of greatest entropy.
fn unchanging(args: &Args, global: &Global, scene: &Scene) -> Result<(), Failure> {
    let spinner = progress::bar(global, None, "reconstructing");
    let reference = Reference::build(&scene.imager, scene.settings.values, scene.settings.imaging.chi2_target.value());
    if let Err(error) = reference {
        spinner.set_message("looking for the reason");
        let failure = unreached(&args.config, scene, error);
        spinner.finish_and_clear();
        return Err(failure);
    }
    let misfits = scene.measured.errors.as_ref().is_some_and(MeasuredErrors::is_misfit);
    let diagnosis = if misfits { diagnosis(scene) } else { None };
    spinner.finish_and_clear();
    let reference = reference.map_err(|e| Failure::reference(&args.config, e))?;
    let fit = Fit::new(&scene.imager, &scene.observations, &reference);
    let true_map = scene.true_map();
    let result = MapResult {
        imager: &scene.imager,
        observations: &scene.observations,
        fit: &fit,
        true_map: true_map.as_deref(),
        truth: scene.truth,
        diagnosis: diagnosis.as_ref().and_then(|diagnosis| serde_json::to_value(diagnosis).ok()),
        provenance: &scene.provenance(),
    };
    let folder = args.output.create()?;
    result.write(folder)?;
    let mut report = report(&fit);
    for (label, text) in scene.measured.lines() {
        report = report.line(label, text);
    }
    for warning in &fit.checks.warnings {
        report = report.line("warning", warning);
    }
    if let Some(diagnosis) = &diagnosis {
        let text = &diagnosis.text;
        report = report.line("warning", format!("the model does not fit as well as the continuum promises: {text}"));
    }
    report.written(folder, FILES.join(", ")).print();
    Ok(())
}

/// Maps of a star that may change.
fn changing(args: &Args, global: &Global, scene: &Scene) -> Result<(), Failure> {
    let spinner = progress::bar(global, None, "fitting the field of spots");
    let fit = scene.changing_maps(args.times.as_deref());
    let suspicious = match &fit {
        Ok(fit) => fit.fitted.at_bounds.iter().any(|name| *name != Parameter::SpotLifetime.name()),
        Err(error) => !matches!(error, NoField::Times(_)),
    };
    if suspicious {
        spinner.set_message("looking for the reason");
    }
    let reason = suspicious.then(|| wrong_with_the_model(scene)).flatten();
    spinner.finish_and_clear();
    let fit = fit.map_err(|error| match error {
        NoField::Times(_) => Failure::input(format!("--times: {error}")),
        error => {
            let reason = reason.iter().map(|text| format!("; {text}")).collect::<String>();
            Failure::failed(format!("{}: no map ({}): {error}{reason}", args.config.display(), error.status()))
        }
    })?;
    let result = ChangingMapResult {
        imager: &scene.imager,
        observations: &scene.observations,
        fit: &fit,
        truth: scene.truth,
        provenance: &scene.provenance(),
    };
    let folder = args.output.create()?;
    result.write(folder)?;
    let mut report = changing_report(&fit);
    for (label, text) in scene.measured.lines() {
        report = report.line(label, text);
    }
    for warning in fit.warnings.iter().chain(&fit.checks.warnings).chain(&reason) {
        report = report.line("warning", warning);
    }
    let light = if fit.light.is_empty() { None } else { Some(LIGHT_CURVES) };
    let files: Vec<&str> = FILES.into_iter().chain(light).collect();
    report.written(folder, files.join(", ")).print();
    Ok(())
}

/// What is likely to be wrong with the model of the star, as far as a map that does not change tells.
fn wrong_with_the_model(scene: &Scene) -> Option<String> {
    diagnosis(scene).filter(|diagnosis| diagnosis.reason != Reason::Errors).map(|diagnosis| diagnosis.text)
}

fn changing_report(fit: &ChangingFit) -> Report {
    let ChangingSummary { chi2, chi2_per_datum, data, profiles, .. } = fit.summary;
    let numbers = &fit.summary;
    let field = FieldRecord::of(&fit.fitted);
    let bound = |name: &str| match field.at_bounds.iter().any(|reached| reached == name) {
        true => ", at the bound of its search",
        false => "",
    };
    let lifetime = field.spot_lifetime_d.map_or("for ever".to_owned(), |days| format!("{days:.2} d"));
    let times: Vec<String> = fit.maps.iter().map(|map| format!("{:.3}", map.time_d)).collect();
    let report = Report::default()
        .line("amplitude", format!("{:.4} (of the spot filling factor)", field.spot_amplitude))
        .line("slope", format!("{:.3}{}", field.spot_slope, bound("spot_slope")))
        .line("lifetime", format!("{lifetime}{}", bound("spot_lifetime_d")))
        .line("jitter", format!("{:.4} km/s", field.velocity_jitter_kms))
        .line("ln evidence", format!("{:.2}", field.ln_evidence))
        .line("chi2", format!("{chi2:.2} for {data} data in {profiles} profiles ({chi2_per_datum:.4} per datum)"));
    let report = match numbers.chi2_per_datum_unchanging {
        Some(chi2) => report.line("unchanging", format!("{chi2:.4} per datum, had the same spots lived for ever")),
        None => report,
    };
    let report = match fit.light.len() {
        0 => report,
        bins => {
            let squares: f64 = fit.light.iter().map(|fit| ((fit.bin.flux - fit.model) / fit.bin.sigma).powi(2)).sum();
            report.line("flux", format!("chi2 {squares:.2} for {bins} bins ({:.4} per bin)", squares / bins as f64))
        }
    };
    report
        .line(
            "residuals",
            format!("{:.3e} rms, {:.3e} in the line core", numbers.residual_rms, numbers.residual_rms_core),
        )
        .line("RV observed", format!("{:.4} km/s rms", numbers.observed_rv_rms_kms))
        .line("RV, no spots", format!("{:.4} km/s rms, error {:.4} km/s", numbers.rv_rms_kms, numbers.rv_error_kms))
        .line("maps at", format!("{} d", times.join(", ")))
}

/// Why no map of `scene` fits, by trying.
fn diagnosis(scene: &Scene) -> Option<Diagnosis> {
    Diagnosis::of(scene, scene.whole_over_continuum().as_ref())
}

/// The target chi2 of the config at `config` is not reached: with the likely reason.
fn unreached(config: &Path, scene: &Scene, error: ReferenceError) -> Failure {
    let reason = diagnosis(scene).map_or_else(String::new, |diagnosis| format!("; {}", diagnosis.text));
    Failure::input(format!("{}: imaging.chi2_target: {error}{reason}", config.display()))
}

fn report(Fit { summary: fit, nuisances, zero_points_kms, .. }: &Fit) -> Report {
    let FitSummary { chi2, chi2_per_datum, data, profiles, .. } = fit;
    let report = Report::default()
        .line("chi2", format!("{chi2:.2} for {data} data in {profiles} profiles ({chi2_per_datum:.4} per datum)"));
    let report = match fit.deviation {
        None => report.line("spottedness", format!("{:.5}", fit.spottedness)),
        Some(Deviation { darkness, brightness_excess }) => report.line(
            "spottedness",
            format!("{:.5} rms: {darkness:.5} dark, {brightness_excess:.5} bright", fit.spottedness),
        ),
    };
    let filtered = match (nuisances.is_empty(), zero_points_kms.is_empty()) {
        (true, true) => format!("{:.4} km/s rms", fit.filtered_rv_rms_kms),
        (true, false) => "not told: first moments follow the zero points that were fitted".to_owned(),
        (false, _) => "not told: first moments follow the continuum that was fitted".to_owned(),
    };
    let report = report
        .line("entropy", format!("{:.5} at lambda = {:.4e}", fit.entropy, fit.lambda))
        .line("TEST", format!("{:.1e}", fit.test))
        .line("residuals", format!("{:.3e} rms, {:.3e} in the line core", fit.residual_rms, fit.residual_rms_core))
        .line("RV observed", format!("{:.4} km/s rms", fit.observed_rv_rms_kms))
        .line("RV filtered", filtered)
        .line("RV error", format!("{:.4} km/s (photon noise)", fit.photon_rv_error_kms));
    let rms = |squares: f64, count: usize| (squares / count as f64).sqrt();
    let report = match zero_points_kms.len() {
        0 => report,
        count => {
            let squares = zero_points_kms.iter().map(|v| v * v).sum();
            report.line("zero points", format!("{:.4} km/s rms", rms(squares, count)))
        }
    };
    if nuisances.is_empty() {
        return report;
    }
    let [offset, slope, width] =
        [0, 1, 2].map(|i| rms(nuisances.iter().map(|n| n.numbers()[i].powi(2)).sum(), nuisances.len()));
    let rms = format!("offset {offset:.1e}, slope {slope:.1e}, equivalent width {:.2} % rms", 100.0 * width);
    report.line("continuum", rms)
}
