//! `dimcmc limits`: which planets the profiles would show.

use super::output::{Output, fitted, remarks, scene};
use super::signals::{Signals, before_the_first};
use super::{Failure, Global, cluster, console, progress};
use crate::data::config::Config;
use crate::data::scene::Scene;
use crate::model::for_blind_search;
use crate::numerics::text::shown;
use crate::planets::periodogram::{FrequencySettings, SearchSettings, Unbounded};
use crate::runs::blind_search::BlindSearchOptions;
use crate::runs::limits::{
    self, BestOrbit, CSV, Comparison, JSON, LimitSettings, LimitsFile, Orbits, Searches, Shortcut, WholeWay,
};
use crate::runs::pool::Brief;
use crate::star::Orbit;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// What limits that are interrupted have not come to.
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
    /// Largest K (km/s); by default four times the K detected with certainty at most periods
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
    let settings = settings(args, &scene)?;
    let spinner = progress::bar(global, None, "planet-free map");
    let shortcut =
        Shortcut::new(&scene.imager, for_blind_search(scene.settings.values, &scene.settings.free), &settings);
    spinner.finish_and_clear();
    let shortcut = shortcut.map_err(|error| Failure::blind_search(&args.config, error.into()))?;
    let orbits = orbits(args, &shortcut)?;
    let meter = Meter::new(global, orbits.count());
    let searches = shortcut.searches(orbits.k_kms.last().copied().unwrap_or_default());
    let cells = limits::recovered(&searches, &orbits, &|done| meter.show(done));
    meter.bar.finish_and_clear();
    let rotation_period_d = scene.imager.star.rotation_period_d;
    let found = limits::limits(&cells, rotation_period_d);
    let drawn = limits::drawn(&shortcut, &found, usize::from(args.full));
    let comparisons = whole_way(global, &signals, &scene, (&shortcut, &searches), &drawn)?;
    let file = LimitsFile::new(&shortcut, &orbits, found, comparisons, rotation_period_d, scene.provenance());
    let folder = args.output.create()?;
    file.write(&cells, rotation_period_d, folder)?;
    console::line(format_args!("{}written: {}: {CSV}, {JSON}", file.table(), shown(folder)));
    Ok(())
}

/// The orbits both ways.
fn whole_way(
    global: &Global,
    signals: &Signals,
    scene: &Scene,
    (shortcut, searches): (&Shortcut, &Searches),
    orbits: &[Orbit],
) -> Result<Vec<Comparison>, Failure> {
    let pool = cluster::pool(global, signals);
    if orbits.is_empty() {
        return Ok(Vec::new());
    }
    let way = WholeWay::new(scene, shortcut);
    let search = way.searcher(scene.clone());
    let brief = Brief::Injections(Box::new(way)).to_bytes();
    let meter = Meter::new(global, orbits.len());
    signals.defer();
    let mut comparisons = Vec::with_capacity(orbits.len());
    for some in orbits.chunks(pool.size().max(1)) {
        let found = pool.answers(&brief, some, &search);
        if found.len() < some.len() {
            meter.bar.finish_and_clear();
            return Err(signals.interrupted(before_the_first(LIMIT)));
        }
        meter.show(some.len());
        let both = |(orbit, full): (&Orbit, _)| Comparison { orbit: *orbit, shortcut: searches.of(orbit), full };
        comparisons.extend(some.iter().zip(found).map(both));
    }
    meter.bar.finish_and_clear();
    Ok(comparisons)
}

/// How orbits are looked for.
fn settings(args: &Args, scene: &Scene) -> Result<LimitSettings, Failure> {
    let Args { min_period_d, max_period_d, without_best, with_best, seed, .. } = *args;
    let best = match (without_best, with_best) {
        (true, _) => BestOrbit::Out,
        (_, true) => BestOrbit::In,
        _ => BestOrbit::OutIfCandidate,
    };
    let options = BlindSearchOptions {
        periods: FrequencySettings { min_period_d, max_period_d, oversampling: None },
        fixed: args.fixed,
        draws: args.draws as usize,
        seed,
        ..BlindSearchOptions::default()
    };
    let frequencies = options.frequencies(scene);
    let frequencies = frequencies.map_err(|error| Failure::blind_search(&args.config, error.into()))?;
    Ok(LimitSettings { detection: options.detection(scene), frequencies, best })
}

/// The injected orbits.
fn orbits(args: &Args, shortcut: &Shortcut) -> Result<Orbits, Failure> {
    let unbounded = || Failure::failed(format!("{}: {Unbounded}", args.config.display()));
    let (least, most) = shortcut.k_range_kms().ok_or_else(unbounded)?;
    let (min, max) = (args.min_k_kms.unwrap_or(least), args.max_k_kms.unwrap_or(most));
    if !(min > 0.0 && min < max && max.is_finite()) {
        return Err(Failure::input(format!(
            "--min-k-kms, --max-k-kms: {min} to {max} km/s is no range, both must be above 0, the first below the \
            second"
        )));
    }
    let (low, high) = shortcut.settings.frequencies.range();
    Ok(Orbits {
        porb_over_prot: limits::even_in_logarithm(1.0 / high, 1.0 / low, usize::from(args.periods)),
        k_kms: limits::even_in_logarithm(min, max, usize::from(args.amplitudes)),
        phases: usize::from(args.phases),
    })
}

/// What is shown while orbits are tried.
struct Meter {
    bar: indicatif::ProgressBar,
    began: Instant,
    total: usize,
    done: AtomicUsize,
}

impl Meter {
    fn new(global: &Global, total: usize) -> Self {
        let bar = progress::bar(global, Some(total as u64), "first orbits");
        Meter { bar, began: Instant::now(), total, done: AtomicUsize::new(0) }
    }

    fn show(&self, orbits: usize) {
        let done = self.done.fetch_add(orbits, Relaxed) + orbits;
        let rate = done as f64 / self.began.elapsed().as_secs_f64().max(1e-9);
        let left = Duration::from_secs_f64(self.total.saturating_sub(done) as f64 / rate);
        self.bar.set_position(done as u64);
        self.bar.set_message(format!("{done}/{} orbits, {:#} left", self.total, indicatif::HumanDuration(left)));
    }
}
