//! `dimcmc simulate`: synthetic observations from a spot list and an orbit.

use super::Failure;
use super::output::Output;
use super::report_lines::Report;
use crate::data::config::{Config, ObservationSource};
use crate::data::io::{lsd, truth};
use crate::data::scene::Scene;
use std::path::PathBuf;

/// Simulate observations of a spotted star with a planet
///
/// Reads `observations.simulate` of the config. Writes observations.txt and the profiles it lists, which other commands
/// read by `observations.path`, and truth.json: what they were made with.
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
    let ObservationSource::Simulate(simulation) = config.settings()?.source else {
        let problem = "missing, a simulation needs its spots, times and velocities";
        return Err(Failure::input(format!("{}: observations.simulate: {problem}", args.config.display())));
    };
    let scene = Scene::new(&config)?;
    args.output.spare(&scene.files(), |name| lsd::is_written(name) || name == truth::FILE)?;
    let truth = scene.truth_of(&simulation);
    let folder = args.output.create()?;
    lsd::write(folder, &scene.observations)?;
    truth::write(folder, &truth)?;
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
    Report::default()
        .line("profiles", format!("{} of {bins} bins, {snr}", scene.observations.profiles.len()))
        .line("spottedness", format!("{:.5}{range}", truth.spottedness))
        .written(folder, "observations.txt, p000.prof ..., truth.json")
        .print();
    Ok(())
}
