//! `dimcmc periodogram`: the blind search for a planet.

use super::output::Output;
use super::{Failure, Global, console, progress};
use crate::data::io::periodogram::{FILES, PeriodogramResult};
use crate::data::scene::Scene;
use crate::numerics::text::shown;
use crate::planets::periodogram::{Frequencies, FrequencyError, FrequencySettings, SearchSettings};
use crate::planets::verdict::Remark;
use crate::posterior::detection::{Detection, DetectionError, DetectionSettings, Evidence, Stage, View, robustness};
use crate::posterior::expansion::nuisances;
use crate::posterior::fit::Explained;
use crate::posterior::objective::for_blind_search;
use crate::runs::blind_search::with_known;
use crate::runs::known_planet::known_planets;
use std::path::{Path, PathBuf};

/// Search for a planet at every period, the star's spots marginalised out
///
/// The star is imaged without a planet, and how much better the profiles fit with an orbit of each period follows in
/// closed form, together with radial velocities that are free of spots. K at the best period is given for a target chi2
/// 3 % lower and higher, too, and without each night. Systemic velocity and stellar parameters are those of the config,
/// or integrated out within their priors where it leaves them free. Writes rv.csv and covariance.csv (velocities for
/// any RV package), periodogram.csv and periodogram.json (best orbit, peaks, false alarms).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc periodogram configs/demo.json --out runs/demo_periodogram")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Shortest period (d); by default that of 5 average Nyquist frequencies, or twice the median spacing if that is
    /// longer
    #[arg(long, value_name = "DAYS")]
    min_period_d: Option<f64>,
    /// Longest period (d); by default twice the time base
    #[arg(long, value_name = "DAYS")]
    max_period_d: Option<f64>,
    /// Trial frequencies to each inverse time base; 10 by default
    #[arg(long, value_name = "N")]
    oversampling: Option<f64>,
    /// Fit eccentric orbits around the peaks as well
    #[arg(long)]
    eccentric: bool,
    /// Number of planets to search for
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    planets: u8,
    /// Integrate the systemic velocity and stellar parameters that are free in the config out within their priors: the
    /// default
    #[arg(long, alias = "marginalize", conflicts_with = "fixed")]
    marginalise: bool,
    /// Hold them at the config's values
    #[arg(long)]
    fixed: bool,
    /// Number of stars without a planet
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    #[arg(value_parser = clap::value_parser!(u32).range(1_000..=10_000_000))]
    draws: u32,
    /// Seed of the draws
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    args.output.check()?;
    let scene = Scene::load(&args.config)?;
    args.output.spare(&scene.files(), |name| FILES.contains(&name))?;
    let frequencies = frequencies(args, &scene)?;
    let settings = settings(args, &scene);
    let spinner = progress::bar(global, None, "reconstructing");
    let report = |stage| spinner.set_message(message(stage));
    let values = for_blind_search(scene.settings.values, &scene.settings.free);
    let found = Detection::find(&scene.imager, values, frequencies, &settings, &report);
    let choices = found.as_ref().map(|found| {
        spinner.set_message("other targets, without each night");
        robustness(&scene.imager, values, &settings, found)
    });
    spinner.finish_and_clear();
    let choices = choices.map_err(|e| failure(&args.config, *e))?;
    let detection = found.map_err(|e| failure(&args.config, e))?;
    let explained = |view: &View| Explained::new(&scene.imager, &scene.observations, view);
    let at_best = explained(detection.last());
    let misfit: Vec<String> = at_best.misfit.iter().cloned().chain(scene.measured.misfit_text()).collect();
    let evidence = Evidence { imager: &scene.imager, settings: &settings, robustness: Some(&choices), misfit: &misfit };
    let remarks = detection.remarks(&evidence);
    let of_the_star: Vec<Remark> =
        remarks.iter().filter(|remark| !detection.of_the_period().contains(remark)).cloned().collect();
    let known = known_planets(&scene, &settings, &detection, &of_the_star);
    let (verdict, remarks) = with_known(known, detection.verdict(&remarks), remarks, of_the_star);
    let planets = scene.evidence(&detection.planet_free.quadratic);
    let result = PeriodogramResult {
        imager: &scene.imager,
        detection: &detection,
        verdict: &verdict,
        remarks: &remarks,
        evidence: planets.as_ref(),
        robustness: &choices,
        settings: &settings,
        planet_free: &explained(&detection.planet_free),
        at_best: &at_best,
        truth: scene.truth,
        mass_msun: scene.settings.mass_msun,
        provenance: &scene.provenance(),
    };
    let folder = args.output.create()?;
    result.write(folder)?;
    let (table, files) = (result.table(), result.files().join(", "));
    let measured: String = scene.measured.lines().iter().map(|(label, text)| format!("{label}: {text}\n")).collect();
    console::line(format_args!("{table}{measured}written: {}: {files}", shown(folder)));
    Ok(())
}

fn frequencies(args: &Args, scene: &Scene) -> Result<Frequencies, Failure> {
    let Args { min_period_d, max_period_d, oversampling, .. } = *args;
    let settings = FrequencySettings { min_period_d, max_period_d, oversampling };
    let rotation_period_d = scene.imager.star.rotation_period_d;
    Frequencies::new(&scene.imager.cycles(), rotation_period_d, settings).map_err(|error| match error {
        FrequencyError::TooFewTimes(_) => Failure::input(format!("{}: observations: {error}", args.config.display())),
        error => Failure::of(error),
    })
}

fn settings(args: &Args, scene: &Scene) -> DetectionSettings {
    DetectionSettings {
        chi2_target: scene.settings.imaging.chi2_target.value(),
        nuisances: if args.fixed { Vec::new() } else { nuisances(&scene.settings.free) },
        search: SearchSettings { draws: args.draws as usize, seed: args.seed },
        eccentric: args.eccentric,
        second_planet: args.planets == 2,
        spots: scene.spots(),
    }
}

fn message(stage: Stage) -> String {
    match stage {
        Stage::PlanetFree => "reconstructing without a planet".to_owned(),
        Stage::Change => "looking whether the star changes".to_owned(),
        Stage::Search => "searching, false alarms".to_owned(),
        Stage::BestOrbit(round) => format!("reconstructing at the best orbit, round {round}"),
        Stage::SecondPlanet => "searching for a second planet".to_owned(),
    }
}

fn failure(config: &Path, error: DetectionError) -> Failure {
    match error {
        DetectionError::Reference(error) => Failure::reference(config, error),
        error => Failure::failed(format!("{}: {error}", config.display())),
    }
}
