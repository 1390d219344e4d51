//! A landscape on disk: begun afresh, or gone on with to the same bytes (method section 6).
//!
//! The reference is that of `sample`: the best parameters by `search` over the axes. Nodes are reconstructed in batches, in the
//! order of the grid, so that the file does not depend on the number of threads, and a kill loses the batch under way. Left out:
//! how progress is shown, and what is read off a landscape (`landscape`).

use crate::config::GridSettings;
use crate::io::atomic::{WriteError, write_json};
use crate::io::landscape;
use crate::io::lines::{JournalError, LineFile};
use crate::landscape::{Grid, Landscape, LandscapeError, Node};
use crate::objective::Posterior;
use crate::origin::{self, Origin, OriginError};
use crate::scene::Scene;
use crate::search::Found;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Name of the file that says what a landscape was begun with.
pub const HEADER: &str = "landscape.json";

/// Name of the file with its nodes.
pub const NODES: &str = "landscape.jsonl";

/// Name of the file with its paraboloid, where the landscape is whole.
pub const PARABOLOID: &str = "paraboloid.json";

/// Nodes of a batch for each thread: enough that threads seldom wait for the slowest node.
const BATCH_PER_THREAD: usize = 8;

/// The content of `landscape.json`, written before the first node and never changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Config, data, program and reference.
    #[serde(flatten)]
    pub origin: Origin,
    /// Where the nodes are.
    pub grid: Grid,
}

/// A landscape with its nodes so far.
pub struct Survey {
    /// What it was begun with.
    pub header: Header,
    /// What is evaluated at the nodes, without its prior.
    pub posterior: Posterior,
    /// The nodes so far.
    pub landscape: Landscape,
    file: LineFile,
}

/// Why a landscape cannot begin, or go on.
#[derive(Debug, thiserror::Error)]
pub enum SurveyError {
    /// What it was begun with is missing, wrong, or not what is there now.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// The nodes on disk are wrong or locked, or cannot be written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The header cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The landscape refused a node: a fault of the program.
    #[error(transparent)]
    Landscape(#[from] LandscapeError),
}

impl Survey {
    /// Begins the landscape of `plan` in `folder`, which must be there, with the reference that a search over its axes `found`.
    /// A landscape that is there already is replaced if `replace`, and refused otherwise.
    ///
    /// # Errors
    /// [`SurveyError`]: files that are there already, or cannot be written.
    pub fn begin(
        scene: &Scene,
        plan: &GridSettings,
        found: Found,
        folder: &Path,
        replace: bool,
    ) -> Result<Self, SurveyError> {
        let grid = &plan.grid;
        let header = Header { origin: Origin::of(scene, &found), grid: grid.clone() };
        // the nodes first: whoever holds them may write the header
        let file = LineFile::create(&folder.join(NODES), replace)?;
        let path = folder.join(PARABOLOID);
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(WriteError { path, source })?,
            _ => {}
        }
        write_json(&folder.join(HEADER), &header)?;
        Ok(Survey { header, posterior: found.posterior, landscape: Landscape::new(grid.clone()), file })
    }

    /// Goes on with the landscape of `plan` in `folder`.
    ///
    /// # Errors
    /// [`SurveyError`]: no landscape there, changed config, grid or data, broken lines.
    pub fn resume(scene: &Scene, plan: &GridSettings, folder: &Path) -> Result<Self, SurveyError> {
        let header: Header = origin::read(folder, HEADER)?;
        header.origin.check(scene, folder)?;
        if let Some(what) = change(&header.grid, &plan.grid) {
            return Err(OriginError::Changed { folder: folder.into(), what }.into());
        }
        let (file, landscape) = landscape::recover(&folder.join(NODES), plan.grid.clone())?;
        let posterior = header.origin.posterior(scene, scene.space_of(&plan.free), folder)?;
        Ok(Survey { header, posterior, landscape, file })
    }

    /// Reconstructs until the landscape is whole or `stop` is set, after which no node is begun; every batch is on disk before
    /// the next one. Returns whether the landscape is whole.
    ///
    /// # Errors
    /// Nodes that cannot be written.
    pub fn go(&mut self, stop: &AtomicBool, mut on_batch: impl FnMut(&Landscape)) -> Result<bool, SurveyError> {
        let Survey { header: Header { grid, .. }, posterior, landscape, file } = self;
        while !landscape.is_whole() {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let first = landscape.nodes().len();
            let after = (first + BATCH_PER_THREAD * rayon::current_num_threads()).min(grid.len());
            let node = |index: usize| {
                let theta = grid.theta(index);
                let going = !stop.load(Ordering::Relaxed);
                going.then(|| Node { index, reconstruction: posterior.likelihood(&theta), theta })
            };
            let batch: Vec<Option<Node>> = (first..after).into_par_iter().with_max_len(1).map(node).collect();
            let batch: Vec<Node> = batch.into_iter().map_while(|node| node).collect();
            landscape::append(file, grid, &batch)?;
            batch.into_iter().try_for_each(|node| landscape.push(node))?;
            on_batch(landscape);
        }
        Ok(true)
    }
}

/// The first axis that is not the same.
fn change(then: &Grid, now: &Grid) -> Option<String> {
    let axis = |grid: &Grid, name: &str| grid.axes.iter().find(|axis| axis.name == name).cloned();
    let name = now.names().chain(then.names()).find(|name| axis(then, name) != axis(now, name))?;
    Some(format!("grid.axes.{name} of the config changed"))
}
