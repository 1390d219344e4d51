//! Where experiments are run: with what effort, in which folder; and what is done already.
//!
//! Every case is a file of its own once it is done, with the config that it was run with. A laboratory that was stopped
//! goes on with the first case that is not there, or was run with another config or version.

use super::{Case, Outcome};
use crate::data::config::ConfigError;
use crate::data::io::atomic::{WriteError, write_json};
use crate::data::scene::SceneError;
use crate::inference::search::SearchError;
use crate::planets::periodogram::FrequencyError;
use crate::runs::comparison::PairError;
use crate::runs::grid_scan::GridScanError;
use crate::runs::pool::Pool;
use crate::runs::run::RunError;
use crate::sampling::chain::ChainError;
use crate::surface::ReferenceError;
use crate::surface::SurfaceError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Runs experiments and keeps what they came to.
pub struct Laboratory<'a> {
    /// Folder of the raw results, in a folder for each row.
    pub folder: PathBuf,
    /// A reduced version of everything, to see that it works: fewer cases, pixels and draws.
    pub quick: bool,
    /// Who reconstructs, until told to stop.
    pub pool: &'a Pool,
    /// Told what is under way.
    pub report: &'a (dyn Fn(&str) + Sync),
}

/// Why an experiment came to nothing.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// It was stopped.
    #[error("interrupted; the same command goes on where it was")]
    Interrupted,
    /// A config of an experiment does not resolve: a fault of the program.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Its observations cannot be made: a fault of the program.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// No reference.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// No image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No landscape.
    #[error(transparent)]
    GridScan(#[from] GridScanError),
    /// No chain.
    #[error(transparent)]
    Run(#[from] RunError),
    /// No summary of it.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// No comparison of the two.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// No trial periods.
    #[error(transparent)]
    Frequency(#[from] FrequencyError),
    /// No periodogram.
    #[error(transparent)]
    Detection(#[from] SurfaceError),
    /// A folder that cannot be made.
    #[error("{}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file that cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl ExperimentError {
    /// Whether it lies in the star: one that cannot be imaged, or has no best orbit, is a result of an experiment.
    pub(super) fn is_of_the_star(&self) -> bool {
        use ExperimentError::{Detection, Reference, Run, Search};
        matches!(
            self,
            Search(_) | Reference(_) | Detection(_) | Run(RunError::UnresolvedSpots(_) | RunError::PriorStart)
        )
    }
}

/// A star that is done.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    config: Value,
    version: String,
    result: T,
}

/// Name of the file of a case that is done.
const OUTCOME: &str = "outcome.json";

impl Laboratory<'_> {
    /// What the cases of `row` come to, in order; those that are done are read.
    ///
    /// # Errors
    /// [`ExperimentError`].
    pub fn outcomes(&self, row: &str, cases: &[Case]) -> Result<Vec<Outcome>, ExperimentError> {
        let outcome = |(k, case): (usize, &Case)| {
            (self.report)(&format!("{row}, case {} of {}: {}", k + 1, cases.len(), case.name));
            self.outcome(row, case)
        };
        cases.iter().enumerate().map(outcome).collect()
    }

    fn outcome(&self, row: &str, case: &Case) -> Result<Outcome, ExperimentError> {
        let folder = self.folder(&format!("{row}/{}", case.name))?;
        let path = folder.join(OUTCOME);
        if let Some(done) = done(&path, case) {
            return Ok(done);
        }
        self.go_on()?;
        let outcome = case.run(&folder, self.pool)?;
        write_json(&path, &outcome)?;
        Ok(outcome)
    }

    /// What a star of a row comes to by `work`, which is given a folder for it. It is read where it is done already
    /// with that config.
    ///
    /// # Errors
    /// [`ExperimentError`].
    pub fn kept<T: Serialize + DeserializeOwned>(
        &self,
        row: &str,
        star: &str,
        config: &Value,
        work: impl FnOnce(&Path) -> Result<T, ExperimentError>,
    ) -> Result<T, ExperimentError> {
        let name = format!("{row}/{star}");
        let path = self.folder.join(&name).join(OUTCOME);
        let read = || serde_json::from_slice::<Kept<T>>(&std::fs::read(&path).ok()?).ok();
        if let Some(kept) = read().filter(|kept| kept.config == *config && kept.version == env!("CARGO_PKG_VERSION")) {
            return Ok(kept.result);
        }
        self.go_on()?;
        let (config, version) = (config.clone(), env!("CARGO_PKG_VERSION").to_owned());
        let kept = Kept { config, version, result: work(&self.folder(&name)?)? };
        write_json(&path, &kept)?;
        Ok(kept.result)
    }

    /// A folder for raw results, made if need be.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn folder(&self, name: &str) -> Result<PathBuf, ExperimentError> {
        let path = self.folder.join(name);
        std::fs::create_dir_all(&path).map_err(|source| ExperimentError::Folder { path: path.clone(), source })?;
        Ok(path)
    }

    /// Whether to go on.
    ///
    /// # Errors
    /// [`ExperimentError::Interrupted`].
    pub fn go_on(&self) -> Result<(), ExperimentError> {
        if self.pool.stopped() { Err(ExperimentError::Interrupted) } else { Ok(()) }
    }

    /// The one or the other, as the effort is full or quick.
    pub fn full_or_quick<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// The first and the last of many cases where it has to be quick.
    pub fn some<T>(&self, mut all: Vec<T>) -> Vec<T> {
        if self.quick && all.len() > 2 {
            all.drain(1..all.len() - 1);
        }
        all
    }
}

/// The outcome at `path`, if it is that of the case as it is now.
fn done(path: &Path, case: &Case) -> Option<Outcome> {
    let outcome: Outcome = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    let same = outcome.config == case.config && outcome.version == env!("CARGO_PKG_VERSION");
    let asked = [case.grid.is_some(), case.chain, case.periodogram.is_some()];
    let there = [outcome.grid.is_some(), outcome.chain.is_some(), outcome.periodogram.is_some()];
    (same && (asked == there || outcome.failed.is_some())).then_some(outcome)
}
