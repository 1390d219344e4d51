//! `dimcmc plan`: which planets profiles would show that are not yet taken.

use super::output::Output;
use super::{Failure, Global, console, progress};
use crate::data::config::Config;
use crate::numerics::text::shown;
use crate::planets::periodogram::FrequencySettings;
use crate::runs::plan::{CSV, Forecast, JSON, PlanSettings};
use std::path::PathBuf;

/// Forecast the detection limits of an observing schedule
///
/// Of a star that is not yet observed the config says when and how well it will be: `observations.simulate` with its
/// schedule (or cycles), velocity bins and S/N, and what its spots are like (`imaging.spot_amplitude`, `spot_slope`,
/// `spot_lifetime_d`; usual ones where they are not given). Of an observed star the section `plan` says which nights
/// come next. The spots are integrated out as with objective "marginal-likelihood", in closed form: nothing is
/// simulated. Several schedules are compared: several configs, or several numbers of nights. Writes plan.json and
/// plan.csv (period, error of K, K detected with a probability of 50 and 95 %); `plot` draws them.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc plan configs/demo.json --out runs/demo_plan\n  \
                        dimcmc plan configs/plan.json --nights 8,12,16 --out runs/plan")]
pub struct Args {
    /// Config files (JSON), one a schedule
    #[arg(required = true)]
    configs: Vec<PathBuf>,
    #[command(flatten)]
    output: Output,
    /// Numbers of nights (of a season), each a schedule; of cycles that are listed, the first nights
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = nights)]
    nights: Vec<usize>,
    /// Shortest period searched (d); by default as `periodogram` would choose it
    #[arg(long, value_name = "DAYS")]
    min_period_d: Option<f64>,
    /// Longest period searched (d); by default twice the time base
    #[arg(long, value_name = "DAYS")]
    max_period_d: Option<f64>,
    /// Hold the systemic velocity and stellar parameters that are free in the config at its values; otherwise they are
    /// integrated out within their priors
    #[arg(long)]
    fixed: bool,
    /// Spot maps drawn, of which medians are taken; 0 for lines of a star without spots
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(0..=1000))]
    maps: u16,
    /// Number of stars without a planet that false alarms are taken from
    #[arg(long, value_name = "N", default_value_t = 4_000)]
    #[arg(value_parser = clap::value_parser!(u32).range(1_000..=10_000_000))]
    draws: u32,
    /// Seed of both
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

fn nights(text: &str) -> Result<usize, String> {
    let number = text.trim().parse::<usize>().ok().filter(|n| (1..=1000).contains(n));
    number.ok_or_else(|| "a whole number from 1 to 1000".into())
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    args.output.check()?;
    args.output.spare(&args.configs, |name| [CSV, JSON].contains(&name))?;
    let configs = args.configs.iter().map(|path| Config::load(path)).collect::<Result<Vec<_>, _>>()?;
    let Args { min_period_d, max_period_d, maps, draws, seed, fixed, .. } = *args;
    let periods = FrequencySettings { min_period_d, max_period_d, oversampling: None };
    let settings = PlanSettings { maps: usize::from(maps), draws: draws as usize, seed, fixed };
    let spinner = progress::bar(global, None, "reading");
    let forecast =
        Forecast::of(&configs, &args.nights, periods, &settings, &|message| spinner.set_message(message.to_owned()));
    spinner.finish_and_clear();
    let forecast = forecast.map_err(Failure::plan)?;
    let folder = args.output.create()?;
    forecast.write(folder)?;
    console::line(format_args!("{}\nwritten: {}: {CSV}, {JSON}", forecast.table(), shown(folder)));
    Ok(())
}
