//! Runs of independent ensembles joined into one: the samples of an array of jobs, as if they were one chain.
//!
//! Runs can be joined if they have the same program, config and data, start every evaluation from the same reference,
//! and have different seeds. Steps beyond the shortest of them are omitted, because a step contains all ensembles.

use crate::data::config::{self, Config, ConfigError};
use crate::data::io::atomic::{WriteError, write_set};
use crate::data::io::journal::{Journal, JournalError};
use crate::data::io::lines;
use crate::runs::manifest::Manifest;
use crate::runs::origin::OriginError;
use crate::runs::run::{CHAIN, SUMMARY, read_chain};
use crate::sampling::chain::{Chain, ChainError, Record};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Joined runs.
#[derive(Debug)]
pub struct Merged {
    /// Their manifest, as one run of all their ensembles.
    pub manifest: Manifest,
    /// The first steps of all of them.
    pub chain: Chain,
    /// Omitted steps of each run.
    pub beyond: Vec<usize>,
}

/// Why runs are not joined: one line naming folders.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// There is only one run.
    #[error("give two or more runs")]
    One,
    /// A run cannot be read.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// Its chain cannot be read, or the joined one cannot be written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// Its config does not resolve.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The steps of a run do not fit: a bug.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The joined manifest cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A chain without a step.
    #[error("{}: no complete step to merge", .0.display())]
    Empty(PathBuf),
    /// Two runs are the same chain.
    #[error("{} and {}: both have the seed {seed} (sampler.seed): they are the same \
    chain", first.display(), second.display())]
    Same {
        /// One folder.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// The seed.
        seed: u64,
    },
    /// Two runs cannot be joined.
    #[error("{} and {}: {what}", first.display(), second.display())]
    Apart {
        /// One folder.
        first: PathBuf,
        /// The other.
        second: PathBuf,
        /// The difference.
        what: String,
    },
}

/// Joins the runs in `folders`, in this order.
///
/// # Errors
/// [`MergeError`]: runs that cannot be read, or cannot be joined.
pub fn merge(folders: &[PathBuf]) -> Result<Merged, MergeError> {
    if folders.len() < 2 {
        return Err(MergeError::One);
    }
    let manifests: Vec<Manifest> = folders.iter().map(|folder| Manifest::read(folder)).collect::<Result<_, _>>()?;
    for (k, other) in manifests.iter().enumerate() {
        for (first, before) in folders.iter().zip(&manifests[..k]) {
            let (first, second) = (first.clone(), folders[k].clone());
            if let Some(what) = difference(before, other) {
                return Err(MergeError::Apart { first, second, what });
            }
            if let Some(seed) = before.seeds().into_iter().find(|seed| other.seeds().contains(seed)) {
                return Err(MergeError::Same { first, second, seed });
            }
        }
    }
    let read = |(folder, manifest): (&PathBuf, &Manifest)| read_chain(folder, manifest);
    let chains: Vec<Chain> = folders.iter().zip(&manifests).map(read).collect::<Result<_, _>>()?;
    let steps = chains.iter().map(Chain::steps).min().unwrap_or(0);
    if let Some(k) = chains.iter().position(|chain| chain.steps() == 0) {
        return Err(MergeError::Empty(folders[k].clone()));
    }
    let manifest = joined(&manifests, &folders[0])?;
    let mut chain = Chain::new(manifest.shape());
    for step in 0..steps {
        chain.push_step(&all_of(&chains, step))?;
    }
    Ok(Merged { manifest, chain, beyond: chains.iter().map(|chain| chain.steps() - steps).collect() })
}

impl Merged {
    /// Writes it as a run into the existing `folder`, the chain as a whole: a shorter one would be read as complete. An
    /// existing run is replaced if `replace`, unless it is being written, and refused otherwise.
    ///
    /// # Errors
    /// [`MergeError`].
    pub fn write(&self, folder: &Path, replace: bool) -> Result<(), MergeError> {
        let path = folder.join(CHAIN);
        let before = lines::hold(&path)?;
        if before.is_some() && !replace {
            return Err(JournalError::Io { path, source: std::io::ErrorKind::AlreadyExists.into() }.into());
        }
        match std::fs::remove_file(folder.join(SUMMARY)) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                Err(WriteError { path: folder.join(SUMMARY), source }.into())
            }
            _ => Ok(write_set(folder, &|stage| self.fill(stage))?),
        }
    }

    fn fill(&self, folder: &Path) -> Result<(), WriteError> {
        let mut journal = Journal::create(&folder.join(CHAIN), self.manifest.shape(), false)?;
        for step in self.chain.records().chunks(self.chain.shape().size()) {
            journal.append(step)?;
        }
        self.manifest.write(folder)
    }
}

/// The first difference that prevents joining two runs.
fn difference(first: &Manifest, second: &Manifest) -> Option<String> {
    let (a, b) = (&first.origin, &second.origin);
    // keys that may differ are copied from the first
    let mut alike = b.config.clone();
    for key in ["seed", "ensembles"] {
        if let (Some(to), Some(from)) = (alike.pointer_mut("/sampler"), a.config.pointer(&format!("/sampler/{key}"))) {
            to[key] = from.clone();
        }
    }
    if let Some(key) = config::first_difference(&a.config, &alike) {
        return Some(format!(
            "{} of the config is not the same",
            key.replace(" then, ", " and ").replace(" now)", ")")
        ));
    }
    let what = match () {
        _ if a.data_sha256 != b.data_sha256 => "the observations are not the same".to_owned(),
        _ if a.version != b.version => format!("they are of versions {} and {} of the program", a.version, b.version),
        _ if a.reference != b.reference => {
            "their references are not the same: the search found another maximum, or the processors are of another kind"
                .to_owned()
        }
        _ => return None,
    };
    Some(what)
}

/// The common manifest of all runs.
fn joined(manifests: &[Manifest], folder: &Path) -> Result<Manifest, MergeError> {
    let first = &manifests[0];
    let ensembles = manifests.iter().map(|manifest| manifest.ensembles).sum();
    let mut config = first.origin.config.clone();
    if let Some(sampler) = config.get_mut("sampler").and_then(Value::as_object_mut) {
        sampler.insert("ensembles".into(), json!(ensembles));
    }
    let settings = Config::at(config.clone(), &folder.join(crate::runs::manifest::FILE)).settings()?;
    let mut manifest = Manifest { ensembles, extend_to: None, ..first.clone() };
    (manifest.origin.config, manifest.origin.config_sha256) = (settings.resolved, settings.sha256);
    manifest.start = manifests.iter().flat_map(|one| one.start.clone()).collect();
    manifest.merged_seeds = manifests.iter().flat_map(Manifest::seeds).collect();
    Ok(manifest)
}

/// A step of all runs, the ensembles numbered consecutively.
fn all_of(chains: &[Chain], step: usize) -> Vec<Record> {
    let mut before = 0;
    let mut records = Vec::new();
    for chain in chains {
        let size = chain.shape().size();
        let one = &chain.records()[step * size..(step + 1) * size];
        records.extend(one.iter().map(|record| Record { ensemble: before + record.ensemble, ..record.clone() }));
        before += chain.shape().ensembles;
    }
    records
}
