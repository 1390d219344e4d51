//! `dimcmc periodogram`: the blind search for a planet.

use super::output::{Output, fitted, scene};
use super::signals::{RESULT, Signals};
use super::{Failure, Global, console, progress};
use crate::data::config::Config;
use crate::numerics::text::shown;
use crate::planets::periodogram::{FrequencySettings, SearchSettings};
use crate::runs::blind_search::{BlindSearch, BlindSearchError, BlindSearchOptions, FILES};
use crate::runs::maps;
use std::path::PathBuf;

/// Blind search for a planet over period, marginalised over the star's spots
///
/// Maps the star without a planet, then computes the improvement in ln L of a circular orbit at each trial period,
/// with spot-corrected RVs. K at the best period is also given with each night left out and, with static maps, for a
/// target chi2 3 % lower and higher. Free systemic velocity and stellar parameters are marginalised within their
/// priors. Writes rv.csv and covariance.csv (for any RV package), periodogram.csv and periodogram.json (best orbit,
/// peaks, FAP).
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
    /// Trial frequencies per inverse time base; 10 by default
    #[arg(long, value_name = "N")]
    oversampling: Option<f64>,
    /// Fit eccentric orbits around the peaks as well
    #[arg(long)]
    eccentric: bool,
    /// Number of planets to search for
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    planets: u8,
    /// Marginalise over the free systemic velocity and stellar parameters within their priors: the default
    #[arg(long, alias = "marginalize", conflicts_with = "fixed")]
    marginalise: bool,
    /// Fix systemic velocity and stellar parameters at the config's values
    #[arg(long)]
    fixed: bool,
    /// Number of planet-free Monte Carlo realisations for the FAP
    #[arg(long, value_name = "N", default_value_t = SearchSettings::DRAWS as u32)]
    #[arg(value_parser = clap::value_parser!(u32).range(1_000..=10_000_000))]
    draws: u32,
    /// Seed of the realisations
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    let scene = scene(&Config::load(&args.config)?)?;
    args.output.spare(&scene.files(), |name| FILES.contains(&name))?;
    let scene = fitted(global, scene);
    let spinner = progress::bar(global, None, "reconstructing");
    let found = BlindSearch::of(&scene, &options(args), &|what| spinner.set_message(what.to_owned()));
    let found = found.map_err(|error| {
        let is_of_maps = matches!(error, BlindSearchError::Detection(_));
        spinner.set_message("diagnosing the misfit");
        let reason = if is_of_maps { maps::reason(&scene) } else { String::new() };
        Failure::blind_search(&args.config, error).with(&reason)
    });
    spinner.finish_and_clear();
    let found = found?;
    signals.defer();
    let folder = args.output.create()?;
    found.write(&folder)?;
    let (table, files) = (found.table(), found.files().join(", "));
    console::line(format_args!("{table}written: {}: {files}", shown(&folder)));
    Ok(())
}

fn options(args: &Args) -> BlindSearchOptions {
    let Args { min_period_d, max_period_d, oversampling, .. } = *args;
    BlindSearchOptions {
        periods: FrequencySettings { min_period_d, max_period_d, oversampling },
        eccentric: args.eccentric,
        second_planet: args.planets == 2,
        fixed: args.fixed,
        draws: args.draws as usize,
        seed: args.seed,
        ..BlindSearchOptions::default()
    }
}
