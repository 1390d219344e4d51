//! `dimcmc survey`: the rate of planets in a sample of stars.

use super::output::Output;
use super::signals::{RESULT, Signals};
use super::{Failure, console};
use crate::numerics::text::shown;
use crate::planets::occurrence::RatePrior;
use crate::runs::survey::{COMPLETENESS, CSV, JSON, PlanetBox, Size, StarTable, Survey, SurveySettings};
use std::path::PathBuf;

/// Completeness of a sample of stars, and the rate of planets in it
///
/// Reads the searches (`periodogram`, or `sample` and `batch`) and detection limits (`limits`) of many stars, in the
/// folders or inside them. Results of the same observations belong to one star, named by `star.name`. Gives the verdict
/// and limits of each star, completeness over period and K (and M sin i, where `star.mass_msun` is set), and the
/// posterior of the fraction of stars with a planet in each box: binomial, with the completeness of each star, and with
/// the probability that each signal is a false alarm. Writes survey.csv, completeness.csv and survey.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc survey runs/demo_periodogram runs/demo_limits --out runs/demo_survey\n  \
                        dimcmc survey runs/demo_periodogram runs/demo_limits --box 0.5:5,0.05:1 \\\n    \
                        --box 5:20,0.05:1 --out runs/demo_survey_2")]
pub struct Args {
    /// Folders with searches and limits, at any depth up to 4
    #[arg(required = true, value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    #[command(flatten)]
    output: Output,
    /// Planets whose rate is estimated: periods (d) and K (km/s); may be repeated; 1:10,0.05:1 if no box is given
    #[arg(long = "box", value_name = "P1:P2,K1:K2", value_parser = of_amplitudes)]
    boxes: Vec<PlanetBox>,
    /// The same by periods (d) and M sin i (Jupiter masses); needs `star.mass_msun` of every star
    #[arg(long = "mass-box", value_name = "P1:P2,M1:M2", value_parser = of_masses)]
    mass_boxes: Vec<PlanetBox>,
    /// Table of the stars (CSV), their names in the column `name` or `star`, or in the first
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Column of the table: estimate the rate in each group, too
    #[arg(long, value_name = "COLUMN", requires = "table")]
    group: Option<String>,
    /// Column of the table: probability that a star's signal, unless it is noise, is a planet (0 to 1; empty: 1)
    #[arg(long, value_name = "COLUMN", requires = "table")]
    reliability: Option<String>,
    /// Jeffreys prior of each rate, Beta(1/2, 1/2), in place of a uniform one
    #[arg(long)]
    jeffreys: bool,
}

fn of_amplitudes(text: &str) -> Result<PlanetBox, String> {
    PlanetBox::from_text(text, Size::Amplitude)
}

fn of_masses(text: &str) -> Result<PlanetBox, String> {
    PlanetBox::from_text(text, Size::Mass)
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    args.output.spare(args.table.as_slice(), |name| [CSV, COMPLETENESS, JSON].contains(&name))?;
    let mut settings = SurveySettings {
        prior: if args.jeffreys { RatePrior::Jeffreys } else { RatePrior::Uniform },
        table: args.table.clone().map(|path| StarTable {
            path,
            group: args.group.clone(),
            reliability: args.reliability.clone(),
        }),
        ..SurveySettings::default()
    };
    let boxes: Vec<PlanetBox> = args.boxes.iter().chain(&args.mass_boxes).copied().collect();
    if !boxes.is_empty() {
        settings.boxes = boxes;
    }
    let survey = Survey::of(&args.folders, &settings)?;
    signals.defer();
    let folder = args.output.create()?;
    survey.write(&folder)?;
    console::line(format_args!("{}written: {}: {CSV}, {COMPLETENESS}, {JSON}", survey.table(), shown(&folder)));
    Ok(())
}
