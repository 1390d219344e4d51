//! `dimcmc limits`: detection limits of the profiles.

use super::output::{Output, fitted, remarks, scene};
use super::signals::{Signals, before_the_first};
use super::{Failure, Global, cluster, console, progress};
use crate::data::config::Config;
use crate::numerics::text;
use crate::planets::periodogram::{FrequencySettings, SearchSettings};
use crate::runs::detection_limits::{DetectionLimits, LimitsError, LimitsOptions, LimitsProgress};
use crate::runs::limits::{BestOrbit, CSV, JSON};
use indicatif::{HumanDuration, ProgressBar};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The first result that interrupted limits lack.
const LIMIT: &str = "limit";

/// Detection limits from injection-recovery tests in period, K and phase
///
/// Injects circular orbits and searches for each as `periodogram` does. Recovered means FAP < 1 % at the right period.
/// Injections are linearised: an orbit is a shift of the velocities around the planet-free map. With --full, some
/// orbits near the limit go through the full pipeline: resampled profiles, a new map, a new search. A candidate already
/// present in the profiles is subtracted first. Writes limits.csv (recovered phases per period and K) and limits.json
/// (K at 50 and 95 %, the comparison).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc limits configs/demo.json --periods 12 --full 2 --out runs/demo_limits")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Shortest period injected and searched (d); by default that of `periodogram`
    #[arg(long, value_name = "DAYS")]
    min_period_d: Option<f64>,
    /// Longest period injected and searched (d); by default twice the time base
    #[arg(long, value_name = "DAYS")]
    max_period_d: Option<f64>,
    /// Number of injected periods, evenly spaced in their logarithm
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u16).range(2..=1000))]
    periods: u16,
    /// Smallest K (km/s); by default a third of the lowest detectable K
    #[arg(long, value_name = "KMS")]
    min_k_kms: Option<f64>,
    /// Largest K (km/s); by default four times the K that is recovered at all phases for nine of ten periods
    #[arg(long, value_name = "KMS")]
    max_k_kms: Option<f64>,
    /// Number of semi-amplitudes, evenly spaced in their logarithm
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u16).range(2..=1000))]
    amplitudes: u16,
    /// Number of phases
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(2..=1000))]
    phases: u16,
    /// Number of orbits near the limit to pass through the full pipeline
    #[arg(long, value_name = "N", default_value_t = 0)]
    full: u16,
    /// Subtract the best orbit of the observed profiles first, even if it is no candidate
    #[arg(long, conflicts_with = "with_best")]
    without_best: bool,
    /// Keep the best orbit of the observed profiles, even if it is a candidate
    #[arg(long)]
    with_best: bool,
    /// Marginalise over the free systemic velocity and stellar parameters, as `periodogram` does
    #[arg(long, alias = "marginalize", conflicts_with = "fixed", hide = true)]
    marginalise: bool,
    /// Fix the free systemic velocity and stellar parameters at the config's values
    #[arg(long)]
    fixed: bool,
    /// Number of planet-free Monte Carlo realisations for the FAP
    #[arg(long, value_name = "N", default_value_t = SearchSettings::DRAWS as u32)]
    #[arg(value_parser = clap::value_parser!(u32).range(1_000..=10_000_000))]
    draws: u32,
    /// Seed of the realisations, and of the orbits of --full
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(LIMIT)?;
    args.output.check()?;
    let scene = scene(&Config::load(&args.config)?)?;
    args.output.spare(&scene.files(), |name| [CSV, JSON].contains(&name))?;
    remarks(&scene);
    let scene = fitted(global, scene);
    let pool = cluster::pool(global, &signals);
    let shown = Shown::new(global);
    let report = |progress| {
        // from here on an interruption would lose results
        if matches!(progress, LimitsProgress::Full { done: 0, .. }) {
            signals.defer();
        }
        shown.show(progress);
    };
    let found = DetectionLimits::of(&scene, &options(args), &pool, &report);
    shown.end();
    let found = found.map_err(|error| match error {
        LimitsError::Interrupted => signals.interrupted(before_the_first(LIMIT)),
        error => Failure::limits(&args.config, error),
    })?;
    let folder = args.output.create()?;
    found.write(&folder)?;
    console::line(format_args!("{}written: {}: {CSV}, {JSON}", found.table(), text::shown(&folder)));
    Ok(())
}

/// The options in the library's form.
fn options(args: &Args) -> LimitsOptions {
    let Args { min_period_d, max_period_d, without_best, with_best, .. } = *args;
    LimitsOptions {
        range: FrequencySettings { min_period_d, max_period_d, oversampling: None },
        periods: args.periods.into(),
        min_k_kms: args.min_k_kms,
        max_k_kms: args.max_k_kms,
        amplitudes: args.amplitudes.into(),
        phases: args.phases.into(),
        full: args.full.into(),
        best: match (without_best, with_best) {
            (true, _) => BestOrbit::Out,
            (_, true) => BestOrbit::In,
            _ => BestOrbit::OutIfCandidate,
        },
        fixed: args.fixed,
        draws: args.draws as usize,
        seed: args.seed,
    }
}

/// The bar of the current stage, one after the other.
struct Shown {
    is_wanted: bool,
    bar: Mutex<(ProgressBar, Instant)>,
}

impl Shown {
    fn new(global: &Global) -> Self {
        Shown { is_wanted: !global.quiet, bar: Mutex::new((ProgressBar::hidden(), Instant::now())) }
    }

    fn show(&self, progress: LimitsProgress) {
        let mut bar = self.bar.lock().unwrap_or_else(PoisonError::into_inner);
        let (done, total) = match progress {
            LimitsProgress::Map => {
                *bar = (progress::bar_if(self.is_wanted, None, "planet-free map"), Instant::now());
                return;
            }
            LimitsProgress::Injections { done, total } | LimitsProgress::Full { done, total } => (done, total),
        };
        if done == 0 {
            bar.0.finish_and_clear();
            *bar = (progress::bar_if(self.is_wanted, Some(total as u64), "first orbits"), Instant::now());
            return;
        }
        let (bar, began) = &*bar;
        let rate = done as f64 / began.elapsed().as_secs_f64().max(1e-9);
        let left = Duration::from_secs_f64(total.saturating_sub(done) as f64 / rate);
        bar.set_position(done as u64);
        bar.set_message(format!("{done}/{total} orbits, {:#} left", HumanDuration(left)));
    }

    fn end(self) {
        self.bar.into_inner().unwrap_or_else(PoisonError::into_inner).0.finish_and_clear();
    }
}
