//! `dimcmc map`: one reconstruction at the config's parameter values.

use super::output::{Output, fitted, scene};
use super::report_lines::Report;
use super::signals::{RESULT, Signals};
use super::{Failure, Global, progress};
use crate::data::config::Config;
use crate::data::io::map;
use crate::runs::maps::Maps;
use std::path::PathBuf;

/// Reconstruct the spots at the config's parameter values
///
/// With the objective "marginal-likelihood" (the default) spots evolve: their amplitude, power-law index and lifetime
/// are fitted. map.json holds the most probable map and its standard deviation per night, or at the given times. With
/// the other objectives the map is static: the one of maximum entropy at `imaging.chi2_target`.
///
/// Writes map.json, profiles.csv (observed and model profiles), rv.csv (RVs before and after removal of the spot
/// signal) and fit.json (goodness of fit); with light curves (`photometry`) lightcurve.csv, and, if activity indicators
/// enter the fit, indicators.csv.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc map configs/demo.json --out demo_map")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Times (d) of evolving maps, in the time system of the profiles; by default the mean time of each night
    #[arg(long, value_name = "D,D,...", value_delimiter = ',', allow_negative_numbers = true)]
    times: Option<Vec<f64>>,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    let scene = scene(&Config::load(&args.config)?)?;
    args.output.spare(&scene.files(), map::is_file)?;
    let scene = fitted(global, scene);
    let spinner = progress::bar(global, None, "reconstructing");
    let maps = Maps::of(&scene, args.times.as_deref(), &|what| spinner.set_message(what));
    spinner.finish_and_clear();
    let maps = maps.map_err(Failure::maps)?;
    signals.defer();
    let folder = args.output.create()?;
    maps.write(&folder)?;
    let report = maps.lines().into_iter().fold(Report::default(), |report, (label, text)| report.line(label, text));
    report.written(&folder, maps.files().join(", ")).print();
    Ok(())
}
