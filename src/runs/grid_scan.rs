//! A likelihood grid on disk: begun, or resumed to the same bytes (`docs/method.md` section 6).
//!
//! The reference is that of `sample`: the best parameters by `search` over the axes. Nodes are reconstructed in
//! batches, in the order of the grid, so that the file does not depend on the number of threads, and a kill loses only
//! the current batch.

use crate::data::config::{GridSettings, MOST_NODES};
use crate::data::io::atomic::{WriteError, clear_abandoned, write_json};
use crate::data::io::landscape;
use crate::data::io::lines::{self, Claim, JournalError, LineFile};
use crate::data::io::paraboloid::{self, ParaboloidFile};
use crate::data::io::saved::Saved;
use crate::data::scene::Scene;
use crate::inference::search::Found;
use crate::runs::origin::{self, Origin, OriginError};
use crate::runs::pool::{Asked, Brief, Pool, Task};
use crate::sampling::landscape::{
    Grid, Landscape, LandscapeError, Node, Paraboloid, Rule, Undefined, paraboloid as fit_paraboloid, paraboloid_table,
    table,
};
use crate::surface::LIKELIHOOD_NUMBERS;
use crate::surface::density::Density;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the header file of a likelihood grid.
pub const HEADER: &str = "landscape.json";

/// Name of the file with its nodes.
pub const NODES: &str = "landscape.jsonl";

/// Name of the file with its paraboloid, where the likelihood grid is complete.
pub const PARABOLOID: &str = "paraboloid.json";

/// Nodes per batch for each concurrent reconstruction: enough that threads or ranks seldom wait for the slowest node.
const BATCH_EACH: usize = 8;

/// Whether `folder` contains only an empty file of nodes, and the header if `header` is set: such a likelihood grid may
/// begin again.
pub fn is_false_start(folder: &Path, header: bool) -> bool {
    lines::is_false_start(folder, header.then_some(HEADER), NODES)
}

/// The content of `landscape.json`, written before the first node and never changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Config, data, program and reference.
    #[serde(flatten)]
    pub origin: Origin,
    /// The nodes of the grid.
    pub grid: Grid,
    /// Names of the other values at each node.
    #[serde(default = "likelihood_numbers")]
    pub numbers: Vec<String>,
}

fn likelihood_numbers() -> Vec<String> {
    LIKELIHOOD_NUMBERS.map(str::to_owned).to_vec()
}

impl Saved for Header {}

impl Header {
    /// Notes on the likelihood grid.
    pub fn notes(&self) -> Vec<String> {
        let axes: Vec<String> = self.grid.names().map(str::to_owned).collect();
        self.origin.reference.warnings(&axes)
    }

    /// Its origin, and the names of its parameters.
    fn parts(&self) -> (&Origin, Vec<String>) {
        (&self.origin, self.grid.names().map(str::to_owned).collect())
    }

    /// Reads the header of the likelihood grid in `folder`.
    ///
    /// # Errors
    /// A folder without one, or one that cannot be read or is inconsistent.
    pub fn read(folder: &Path) -> Result<Self, OriginError> {
        let header: Header = origin::read_header(folder, HEADER, Header::parts)?;
        let nodes = header.grid.axes.iter().try_fold(1usize, |all, axis| all.checked_mul(axis.nodes));
        let is_sound = (1..=3).contains(&header.grid.axes.len())
            && header.grid.axes.iter().all(|axis| axis.nodes >= 2 && axis.min < axis.max)
            && nodes.is_some_and(|nodes| nodes <= MOST_NODES);
        match is_sound {
            true => Ok(header),
            false => {
                let problem = format!("grid: must have 1 to 3 axes, each rising, and at most {MOST_NODES} nodes");
                Err(OriginError::Content { path: folder.join(HEADER), problem })
            }
        }
    }
}

/// A likelihood grid with its nodes so far.
pub struct GridScan {
    /// Its header.
    pub header: Header,
    /// The density at the nodes, without its prior; for a complete likelihood grid without its warm starts.
    posterior: Density,
    /// The nodes so far.
    pub landscape: Landscape,
    task: Task,
    file: LineFile,
}

/// Why a likelihood grid cannot begin or be resumed.
#[derive(Debug, thiserror::Error)]
pub enum GridScanError {
    /// Its header is missing, wrong, or does not match.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// The nodes on disk are wrong or locked, or cannot be written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The header cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The likelihood grid refused a node: a bug.
    #[error(transparent)]
    Landscape(#[from] LandscapeError),
}

impl GridScan {
    /// Whether `folder` contains only a likelihood grid that ended before its first node: another one may replace it.
    pub fn is_false_start(folder: &Path) -> bool {
        is_false_start(folder, true)
    }

    /// Creates and claims `folder` for a likelihood grid whose reference is not known yet: from now on others are
    /// refused.
    ///
    /// # Errors
    /// A folder that contains a likelihood grid already (unless `replace`), in which another process begins one, or
    /// that cannot be written.
    pub fn claim(folder: &Path, replace: bool) -> Result<Claim, GridScanError> {
        Ok(Claim::of(&folder.join(NODES), replace)?)
    }

    /// Begins the likelihood grid of `plan` in `folder`, which was claimed, with the reference that a search over its
    /// axes `found`.
    ///
    /// # Errors
    /// [`GridScanError`]: files that cannot be written.
    pub fn begin(
        scene: &Scene,
        plan: &GridSettings,
        found: Found,
        folder: &Path,
        claim: Claim,
    ) -> Result<Self, GridScanError> {
        let grid = &plan.grid;
        let numbers = found.posterior.likelihood_numbers().iter().map(|name| (*name).to_owned()).collect();
        let header = Header { origin: Origin::of(scene, &found), grid: grid.clone(), numbers };
        // the nodes first: a lock on them is required for writing the header
        let file = claim.begin()?;
        let path = folder.join(PARABOLOID);
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(WriteError { path, source })?,
            _ => {}
        }
        write_json(&folder.join(HEADER), &header)?;
        let landscape = Landscape::new(grid.clone(), header.numbers.clone());
        Ok(GridScan::new(scene, header, found.posterior, landscape, file))
    }

    /// Resumes the likelihood grid of `plan` in `folder`.
    ///
    /// # Errors
    /// [`GridScanError`]: no likelihood grid there, changed config, grid or data, broken lines.
    pub fn resume(scene: &Scene, plan: &GridSettings, folder: &Path) -> Result<Self, GridScanError> {
        clear_abandoned(folder);
        let header = Header::read(folder)?;
        header.origin.check(scene, folder)?;
        if let Some(what) = change(&header.grid, &plan.grid) {
            return Err(OriginError::Changed { folder: folder.into(), what }.into());
        }
        let (file, landscape) = landscape::recover(&folder.join(NODES), plan.grid.clone(), &header.numbers)?;
        let posterior = header.origin.posterior(scene, scene.space_of(&plan.free), folder)?;
        Ok(GridScan::new(scene, header, posterior, landscape, file))
    }

    /// With warm starts where they pay off for nodes far from the reference.
    fn new(scene: &Scene, header: Header, posterior: Density, landscape: Landscape, file: LineFile) -> Self {
        let grid = landscape.grid();
        // for all nodes, however many remain: a resumed likelihood grid has its original warm starts
        let nodes = if landscape.is_whole() { 0 } else { grid.len() };
        let thetas: Vec<Vec<f64>> = (0..nodes).map(|index| grid.theta(index)).collect();
        let posterior = posterior.with_warm_starts_for(&thetas, nodes);
        let warm_starts = posterior.warm_starts();
        let names = posterior.space().names();
        let task = Task::new(scene, &header.origin, names, Asked::Likelihood { warm_starts });
        GridScan { header, posterior, landscape, task, file }
    }

    /// Images, besides the reference, that nodes start from; none where no node remains.
    pub fn warm_starts(&self) -> usize {
        self.posterior.warm_starts().len()
    }

    /// Fits the paraboloid of a complete likelihood grid by `rule` and writes it into `folder`; returns the tables of
    /// both.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn conclude(&self, folder: &Path, rule: Rule) -> Result<String, WriteError> {
        let truth = self.header.origin.truth.as_ref();
        let found = fit_paraboloid(&self.landscape, rule);
        ParaboloidFile::new(self.landscape.grid(), rule, truth, &found).write(&folder.join(PARABOLOID))?;
        Ok(tables(&self.header, &self.landscape, &found))
    }

    /// Reconstructs until the likelihood grid is complete or `pool` is told to stop; every batch is on disk before the
    /// next one, and the finished part of the last one. Returns whether the likelihood grid is complete.
    ///
    /// # Errors
    /// Nodes that cannot be written.
    pub fn go(&mut self, pool: &Pool, mut on_batch: impl FnMut(&Landscape)) -> Result<bool, GridScanError> {
        let GridScan { header: Header { grid, .. }, posterior, landscape, task, file } = self;
        let brief = Brief::Density(Box::new(task.clone())).to_bytes();
        while !landscape.is_whole() {
            if pool.stopped() {
                return Ok(false);
            }
            let first = landscape.nodes().len();
            let after = (first + BATCH_EACH * pool.size()).min(grid.len());
            let thetas: Vec<Vec<f64>> = (first..after).map(|index| grid.theta(index)).collect();
            let found = pool.answers(&brief, &thetas, |theta| posterior.likelihood(theta));
            let node = |(index, (theta, evaluation))| Node { index, theta, evaluation };
            let batch: Vec<Node> = (first..).zip(thetas.into_iter().zip(found)).map(node).collect();
            landscape::append(file, landscape, &batch)?;
            batch.into_iter().try_for_each(|node| landscape.push(node))?;
            on_batch(landscape);
        }
        Ok(true)
    }
}

/// The printed output for the likelihood grid in `folder`, complete or not.
///
/// # Errors
/// A folder without one, or files that are broken.
pub fn printed(folder: &Path) -> Result<String, GridScanError> {
    let header = Header::read(folder)?;
    let landscape = landscape::read(&folder.join(NODES), header.grid.clone(), &header.numbers)?;
    let text = match landscape.is_whole() {
        true => tables(&header, &landscape, &fit_paraboloid(&landscape, paraboloid::rule(&folder.join(PARABOLOID)))),
        false => {
            let (done, all) = (landscape.nodes().len(), landscape.grid().len());
            table(&landscape, header.origin.truth.as_ref()) + &format!("{done} of {all} nodes so far\n")
        }
    };
    Ok(text + &header.notes().iter().map(|note| format!("note: {note}\n")).collect::<String>())
}

/// A likelihood grid and its paraboloid as text.
fn tables(header: &Header, landscape: &Landscape, found: &Result<Paraboloid, Undefined>) -> String {
    let truth = header.origin.truth.as_ref();
    table(landscape, truth) + &paraboloid_table(found, landscape.grid(), truth)
}

/// The first axis that differs.
fn change(then: &Grid, now: &Grid) -> Option<String> {
    let axis = |grid: &Grid, name: &str| grid.axes.iter().find(|axis| axis.name == name).cloned();
    let name = now.names().chain(then.names()).find(|name| axis(then, name) != axis(now, name))?;
    Some(format!("grid.axes.{name} of the config changed"))
}
