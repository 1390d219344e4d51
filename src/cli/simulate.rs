//! `dimcmc simulate`: synthetic observations from a spot list and an orbit.

use super::Failure;
use super::output::Output;
use super::report_lines::Report;
use crate::data::config::{Config, DataSetSettings, ObservationSource};
use crate::data::io::lsd;
use crate::data::io::truth::{self, Truth};
use crate::data::scene::Scene;
use crate::posterior::simulate::Simulation;
use crate::star::observation::Observations;
use std::path::PathBuf;

/// Simulate observations of a spotted star with a planet
///
/// Reads `observations.simulate` of the config. Writes observations.txt and the profiles it lists, which other commands
/// read by `observations.path`, and truth.json: what they were made with. Of several data sets each has these in a
/// folder of its name.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc simulate configs/demo.json --out demo_data")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), Failure> {
    args.output.check()?;
    let config = Config::load(&args.config)?;
    let sets = config.settings()?.sets;
    let simulation = |set: &DataSetSettings| match &set.source {
        ObservationSource::Simulate(simulation) => Some(simulation.clone()),
        ObservationSource::Files { .. } => None,
    };
    let Some(simulations) = sets.iter().map(simulation).collect::<Option<Vec<Simulation>>>() else {
        let problem = "missing, a simulation needs its spots, times and velocities";
        return Err(Failure::input(format!("{}: {}.simulate: {problem}", args.config.display(), sets[0].key)));
    };
    let scene = Scene::new(&config)?;
    args.output.spare(&scene.files(), |name| lsd::is_written(name) || name == truth::FILE)?;
    let truths: Vec<Truth> = simulations.iter().map(|simulation| scene.truth_of(simulation)).collect();
    let folder = args.output.create()?;
    let mut report = Report::default();
    for (s, ((set, simulation), truth)) in sets.iter().zip(&simulations).zip(&truths).enumerate() {
        let observations = Observations { profiles: scene.observations.profiles[scene.imager.profiles_of(s)].to_vec() };
        let folder = match sets.len() {
            1 => folder.to_owned(),
            _ => folder.join(&set.name),
        };
        let failed = |e| Failure::failed(format!("{}: cannot be created: {e}", folder.display()));
        std::fs::create_dir_all(&folder).map_err(failed)?;
        lsd::write(&folder, &observations)?;
        truth::write(&folder, truth)?;
        if sets.len() > 1 {
            report = report.line("data set", &set.name);
        }
        report = lines(report, simulation, truth, observations.profiles.len());
    }
    let files = "observations.txt, p000.prof ..., truth.json";
    let files = match sets.len() {
        1 => files.to_owned(),
        _ => format!("of each data set, in a folder of its name: {files}"),
    };
    report.written(folder, files).print();
    Ok(())
}

/// What is said of a data set.
fn lines(report: Report, simulation: &Simulation, truth: &Truth, profiles: usize) -> Report {
    let bins = simulation.bins;
    let snr = simulation.snr.map_or("without noise".into(), |snr| format!("S/N {snr}, seed {}", simulation.seed));
    let range = match simulation.is_changing() {
        true => {
            let least = truth.coverage.iter().copied().fold(f64::INFINITY, f64::min);
            let most = truth.coverage.iter().copied().fold(0.0, f64::max);
            format!(" in the mean, from {least:.5} to {most:.5} as spots come and go")
        }
        false => String::new(),
    };
    report
        .line("profiles", format!("{profiles} of {bins} bins, {snr}"))
        .line("spottedness", format!("{:.5}{range}", truth.spottedness))
}
