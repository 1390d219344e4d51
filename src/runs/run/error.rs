//! Why a run cannot begin or be resumed.

use crate::data::config::ConfigError;
use crate::data::io::atomic::WriteError;
use crate::data::io::journal::JournalError;
use crate::inference::search::SearchError;
use crate::runs::origin::OriginError;
use crate::sampling::chain::ChainError;
use crate::sampling::ensemble::EnsembleError;
use crate::surface::density::UnresolvedSpotsError;
use std::path::PathBuf;

/// Draws from the prior tried for one walker.
pub(super) const PRIOR_TRIES: usize = 100;

/// Why a run cannot begin or be resumed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The config does not describe a chain, or is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The search for the best parameters failed.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// The start is invalid, or the sampler's settings are wrong.
    #[error(transparent)]
    Ensemble(#[from] EnsembleError),
    /// A walker found no point in the prior where a reconstruction succeeds.
    #[error(
        "start from the prior: no reconstruction succeeds at {} draws; narrow the priors under `parameters`",
        PRIOR_TRIES
    )]
    PriorStart,
    /// The unresolved spots have no size that fits.
    #[error(transparent)]
    UnresolvedSpots(#[from] UnresolvedSpotsError),
    /// Merged runs have no common random numbers to continue with.
    #[error("{}: a merged run: extend its runs, then merge again", .0.display())]
    Merged(PathBuf),
    /// It was stopped before anything was written.
    #[error("interrupted before the first step; nothing was written")]
    Interrupted,
    /// The manifest of the run is missing, wrong, or does not match.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// The chain on disk is wrong or locked.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The folder cannot be created or cleared.
    #[error("{}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The chain on disk has no summary.
    #[error("{}: {source}", path.display())]
    Analysis {
        /// The chain.
        path: PathBuf,
        /// Why.
        source: ChainError,
    },
    /// The chain refused a step: a bug.
    #[error(transparent)]
    Chain(#[from] ChainError),
}
