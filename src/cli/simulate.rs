//! `dimcmc simulate`: synthetic observations from a spot list and an orbit.

use super::Failure;
use super::output::Output;
use super::report_lines::Report;
use super::signals::{RESULT, Signals};
use crate::data::config::Config;
use crate::runs::simulated::Simulated;
use std::path::PathBuf;

/// Simulate observations of a spotted star with a planet
///
/// Reads `observations.simulate` of the config. Writes observations.txt, the profiles it lists (read by
/// `observations.path`) and truth.json, the injected values. Each of several data sets gets a folder of its name. Light
/// curves (`photometry.simulate`) go to NAME.csv, read by `photometry.path`.
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
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    let simulated = Simulated::of(&Config::load(&args.config)?)?;
    args.output.spare(simulated.read(), |name| simulated.writes(name))?;
    signals.defer();
    let folder = args.output.create()?;
    simulated.write(&folder)?;
    let lines = simulated.lines().into_iter();
    let report = lines.fold(Report::default(), |report, (label, text)| report.line(label, text));
    let files = "observations.txt, p000.prof ..., truth.json";
    let files = match simulated.sets().len() {
        1 => files.to_owned(),
        _ => format!("of each data set, in a folder of its name: {files}"),
    };
    report.written(&folder, files).print();
    Ok(())
}
