//! Execution of experiments: effort, folder, and finished cases.
//!
//! Every finished case has its own file, with its config. A stopped laboratory resumes at the first case that is
//! missing, or was run with another config or version.

use super::{Case, Failure, Outcome};
use dimcmc::Pool;
use dimcmc::internals::data::io::atomic::write_json;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Runs experiments and stores their outcomes.
pub struct Laboratory<'a> {
    /// Folder of the raw results, in a folder for each row.
    pub folder: PathBuf,
    /// A reduced version of everything, to check that it works: fewer cases, pixels and draws.
    pub quick: bool,
    /// Evaluator of reconstructions, until a stop is requested.
    pub pool: &'a Pool,
    /// Receives the progress.
    pub report: &'a (dyn Fn(&str) + Sync),
}

/// An experiment was stopped.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; the same command goes on where it was")]
pub struct Interrupted;

/// A finished star.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    /// The config, or the case, of the run.
    config: Value,
    version: String,
    result: T,
}

/// Name of the file of a finished case.
const OUTCOME: &str = "outcome.json";

impl Laboratory<'_> {
    /// Outcomes of the cases of `row`, in order; finished ones are read.
    pub fn outcomes(&self, row: &str, cases: &[Case]) -> Result<Vec<Outcome>, Failure> {
        let outcome = |(k, case): (usize, &Case)| {
            (self.report)(&format!("{row}, case {} of {}: {}", k + 1, cases.len(), case.name));
            self.kept(row, &case.name, case, |folder| case.run(folder, self.pool))
        };
        cases.iter().enumerate().map(outcome).collect()
    }

    /// The outcome of a star of a row by `work`, which receives a folder for it. It is read if already done with that
    /// config or case.
    pub fn kept<T: Serialize + DeserializeOwned>(
        &self,
        row: &str,
        star: &str,
        config: impl Serialize,
        work: impl FnOnce(&Path) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let folder = self.folder(&format!("{row}/{star}"))?;
        let path = folder.join(OUTCOME);
        let (config, version) = (serde_json::to_value(config)?, env!("CARGO_PKG_VERSION").to_owned());
        let read = || serde_json::from_slice::<Kept<T>>(&std::fs::read(&path).ok()?).ok();
        if let Some(kept) = read().filter(|kept| kept.config == config && kept.version == version) {
            return Ok(kept.result);
        }
        self.go_on()?;
        let kept = Kept { config, version, result: work(&folder)? };
        write_json(&path, &kept)?;
        Ok(kept.result)
    }

    /// A folder for raw results, made if need be.
    pub fn folder(&self, name: &str) -> Result<PathBuf, Failure> {
        let path = self.folder.join(name);
        std::fs::create_dir_all(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(path)
    }

    /// Whether to continue: if not, [`Interrupted`].
    pub fn go_on(&self) -> Result<(), Failure> {
        if self.pool.stopped() { Err(Interrupted.into()) } else { Ok(()) }
    }

    /// One or the other, for full or quick effort.
    pub fn full_or_quick<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// The first and the last of many cases for quick effort.
    pub fn some<T>(&self, mut all: Vec<T>) -> Vec<T> {
        if self.quick && all.len() > 2 {
            all.drain(1..all.len() - 1);
        }
        all
    }
}
