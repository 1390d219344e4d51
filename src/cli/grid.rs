//! `dimcmc grid`: the likelihood grid and its paraboloid.

use super::output::{Output, fitted, remarks, scene};
use super::search::search;
use super::signals::Signals;
use super::{Failure, Global, cluster, console, progress};
use crate::data::config::Config;
use crate::data::io::effort::{EFFORT, Effort};
use crate::numerics::text::shown;
use crate::runs::grid_scan::{GridScan, HEADER, NODES, PARABOLOID};
use crate::sampling::landscape::{Landscape, Rule};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Compute a likelihood grid: a map at every node
///
/// The axes are those under `grid` in the config, one to three parameters; all others are fixed at the config's values.
/// ln L is the log-probability of `sample` without the prior, relative to the same reference, the best parameters along
/// the axes. A paraboloid is fitted to chi2 = -2 ln L around the highest node: its vertex is the estimate, the
/// half-width of Delta chi2 = 1 along each axis the error bar. Writes landscape.json, landscape.jsonl (one line per
/// node) and paraboloid.json. Interrupted grids can be resumed with `--resume`; the result is bit-identical to an
/// uninterrupted one. A finished grid gets a new paraboloid.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc grid configs/demo.json --out runs/demo_grid\n  \
                        dimcmc grid configs/demo.json --out runs/demo_grid --resume")]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Resume the grid in the folder
    #[arg(long)]
    resume: bool,
    /// Fit the paraboloid to the N highest nodes; by default to all up to 4 above the lowest chi2, or the fewest it
    /// needs
    #[arg(long, value_name = "N")]
    fit_nodes: Option<NonZeroUsize>,
    /// Fit it to nodes at most N steps from the highest one along each axis
    #[arg(long, value_name = "N")]
    fit_radius: Option<NonZeroUsize>,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let began = Instant::now();
    let signals = Signals::catch("node")?;
    let resume = args.resume && !args.output.cannot_go_on();
    if !resume {
        args.output.check()?;
    }
    let scene = scene(&Config::load(&args.config)?)?;
    args.output.spare(&scene.files(), |name| [HEADER, NODES, PARABOLOID, EFFORT].contains(&name))?;
    remarks(&scene);
    let plan = scene.settings.require_grid()?;
    let folder = args.output.folder();
    let failed = |e| Failure::grid_scan(&args.config, e);
    let pool = cluster::pool(global, &signals);
    let mut scan = if resume {
        signals.defer();
        let spinner = progress::bar(global, None, "reading the grid, reference image");
        let scan = GridScan::resume(&scene, plan, folder);
        spinner.finish_and_clear();
        scan.map_err(failed)?
    } else {
        let claim = || GridScan::claim(folder, args.output.replaces());
        let claim = cluster::claim(&pool, &signals, claim).map_err(failed)?;
        let scene = fitted(global, scene.clone());
        let found = search(global, &args.config, &scene, &scene.space_of(&plan.free))?;
        signals.defer();
        let spinner = progress::bar(global, None, "start images for distant nodes");
        let scan = claim().and_then(|claim| GridScan::begin(&scene, plan, found, folder, claim));
        spinner.finish_and_clear();
        scan.map_err(failed)?
    };
    let mut meter = Meter::new(global, &scan.landscape);
    let whole = scan.go(&pool, |landscape| meter.show(landscape));
    meter.bar.finish_and_clear();
    let noted = Effort::add(folder, !resume, began.elapsed().as_secs_f64(), pool.size());
    if !whole.map_err(failed)? {
        let (config, folder, nodes) = (args.config.display(), folder.display(), scan.landscape.nodes().len());
        return Err(signals.interrupted(format!(
            "interrupted after {nodes} nodes; resume with: dimcmc grid {config} --out {folder} --resume"
        )));
    }
    noted?;
    let rule = Rule { nodes: args.fit_nodes.map(NonZeroUsize::get), radius: args.fit_radius.map(NonZeroUsize::get) };
    // a reader may close the pipe
    console::print(scan.conclude(folder, rule)?);
    let images = match scan.warm_starts() {
        0 => String::new(),
        others => format!(" from {} images", others + 1),
    };
    console::line(format_args!("{}{images}", meter.cost(&scan.landscape)));
    for note in scan.header.notes() {
        console::line(format_args!("note: {note}"));
    }
    console::line(format_args!("written: {}: {HEADER}, {NODES}, {PARABOLOID}", shown(folder)));
    Ok(())
}

/// Progress of a grid, and its duration.
struct Meter {
    bar: indicatif::ProgressBar,
    began: Instant,
    /// Nodes from an earlier session.
    before: usize,
}

impl Meter {
    fn new(global: &Global, landscape: &Landscape) -> Self {
        let bar = progress::bar(global, Some(landscape.grid().len() as u64), "first nodes");
        let before = landscape.nodes().len();
        bar.set_position(before as u64);
        Meter { bar, began: Instant::now(), before }
    }

    fn show(&mut self, landscape: &Landscape) {
        let (done, total) = (landscape.nodes().len(), landscape.grid().len());
        let rate = (done - self.before) as f64 / self.began.elapsed().as_secs_f64().max(1e-9);
        let left = Duration::from_secs_f64((total - done) as f64 / rate);
        self.bar.set_position(done as u64);
        self.bar.set_message(format!("{done}/{total}, {:#} left, {rate:.0} rec/s", indicatif::HumanDuration(left)));
    }

    /// Seconds of this part of the computation, without the preceding search and the warm-start images.
    fn cost(&self, landscape: &Landscape) -> String {
        let nodes = landscape.nodes().len() - self.before;
        let now = if self.before == 0 { "" } else { " now" };
        format!("{nodes} nodes{now} in {:.1} s", self.began.elapsed().as_secs_f64())
    }
}
