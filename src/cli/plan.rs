//! `dimcmc plan`: expected detection limits of planned profiles.

use super::output::Output;
use super::signals::{RESULT, Signals};
use super::{Failure, Global, console, progress};
use crate::data::config::Config;
use crate::numerics::text::shown;
use crate::planets::periodogram::FrequencySettings;
use crate::runs::plan::{CSV, Forecast, JSON, Next, PlanSettings};
use std::path::PathBuf;

/// Forecast the detection limits of an observing schedule
///
/// For an unobserved star the config gives schedule (or cycles), velocity bins and S/N under `observations.simulate`,
/// and the spots by `imaging.spot_amplitude`, `spot_slope`, `spot_lifetime_d` (default values if not given). For an
/// observed star the section `plan` gives the next nights. Sensitivities follow in closed form, marginalised over
/// evolving-spot maps; nothing is simulated. Several configs, or several numbers of nights, are compared. --next
/// chooses the nights that best constrain K of one planet. Writes plan.json and plan.csv (period, uncertainty of K, K
/// detected with a probability of 50 and 95 %).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc plan configs/demo.json --out runs/demo_plan\n  \
                        dimcmc plan configs/plan.json --nights 8,12,16 --out runs/plan\n  \
                        dimcmc plan configs/plan.json --next 6 --period-d 4.93 --out runs/next")]
pub struct Args {
    /// Config files (JSON), one per schedule
    #[arg(required = true)]
    configs: Vec<PathBuf>,
    #[command(flatten)]
    output: Output,
    /// Numbers of nights per season to compare, a schedule for each; of listed cycles the first nights are used
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = nights)]
    nights: Vec<usize>,
    /// Choose this number of the nights: those that most reduce the uncertainty of K of one planet
    #[arg(long, value_name = "N", value_parser = nights, conflicts_with = "nights")]
    next: Option<usize>,
    /// Period of that planet (d); by default that of the config's planet
    #[arg(long, value_name = "DAYS", value_parser = days, requires = "next")]
    period_d: Option<f64>,
    /// Choose the nights that best tell that planet from one of this period (d), an alias for example
    #[arg(long, value_name = "DAYS", value_parser = days, requires = "next")]
    alias_d: Option<f64>,
    /// Shortest period searched (d); by default that of `periodogram`
    #[arg(long, value_name = "DAYS")]
    min_period_d: Option<f64>,
    /// Longest period searched (d); by default twice the time base
    #[arg(long, value_name = "DAYS")]
    max_period_d: Option<f64>,
    /// Fix the free systemic velocity and stellar parameters at the config's values; by default they are marginalised
    /// within their priors
    #[arg(long)]
    fixed: bool,
    /// Number of spot maps drawn, over which medians are taken; 0 for an unspotted star
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(0..=1000))]
    maps: u16,
    /// Number of planet-free Monte Carlo realisations for the FAP
    #[arg(long, value_name = "N", default_value_t = 4_000)]
    #[arg(value_parser = clap::value_parser!(u32).range(1_000..=10_000_000))]
    draws: u32,
    /// Seed of maps and realisations
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

fn nights(text: &str) -> Result<usize, String> {
    let number = text.trim().parse::<usize>().ok().filter(|n| (1..=1000).contains(n));
    number.ok_or_else(|| "a whole number from 1 to 1000".into())
}

fn days(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|days| *days > 0.0 && days.is_finite());
    number.ok_or_else(|| "a period above 0 (d)".into())
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    args.output.spare(&args.configs, |name| [CSV, JSON].contains(&name))?;
    let configs = args.configs.iter().map(|path| Config::load(path)).collect::<Result<Vec<_>, _>>()?;
    let Args { min_period_d, max_period_d, maps, draws, seed, fixed, .. } = *args;
    let periods = FrequencySettings { min_period_d, max_period_d, oversampling: None };
    let settings = PlanSettings { maps: usize::from(maps), draws: draws as usize, seed, fixed };
    let next = args.next.map(|nights| Next { nights, period_d: args.period_d, other_d: args.alias_d });
    let spinner = progress::bar(global, None, "reading");
    let forecast =
        Forecast::of(&configs, (&args.nights, next), periods, &settings, &|text| spinner.set_message(text.to_owned()));
    spinner.finish_and_clear();
    let forecast = forecast.map_err(Failure::plan)?;
    signals.defer();
    let folder = args.output.create()?;
    forecast.write(&folder)?;
    console::line(format_args!("{}\nwritten: {}: {CSV}, {JSON}", forecast.table(), shown(&folder)));
    Ok(())
}
