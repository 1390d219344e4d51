//! The other processes of a job, as the commands see them. `mpi/` has them by MPI.

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Answers a question, from any thread; the flag is set when it should end soon.
pub type Answering<'a> = Box<dyn Fn(&[u8], &Arc<AtomicBool>) -> Vec<u8> + Sync + 'a>;

/// What a rank learns from a brief: how to answer questions on it.
///
/// # Errors
/// A density that cannot be built there.
pub type Learn<'a> = &'a dyn Fn(&[u8]) -> Result<Answering<'a>, Box<dyn Error>>;

/// This process among those of its job.
pub enum Rank {
    /// The only one.
    Only,
    /// The first, which asks the others.
    First(Box<dyn Ranks>),
    /// One of the others, which answer.
    Other(Box<dyn Worker>),
}

/// The others, from the first one; dropping it dismisses them.
pub trait Ranks: std::fmt::Debug {
    /// Number of questions answered at once.
    fn size(&self) -> usize;

    /// The answers to the first of the `questions` on `brief`: to all, unless `stop` is set meanwhile; after that no
    /// further question is asked, and pending ones are waited for.
    fn answers(&self, brief: &[u8], questions: &[Vec<u8>], stop: &AtomicBool) -> Vec<Vec<u8>>;
}

/// A process that answers.
pub trait Worker {
    /// The number of this rank, for messages.
    fn rank(&self) -> i32;

    /// Answers until dismissed, with the function that `learn` returns for each brief.
    ///
    /// # Errors
    /// That of `learn`; the other ranks then wait for this one, and must be ended.
    fn serve(&self, learn: Learn<'_>) -> Result<(), Box<dyn Error>>;

    /// Ends all processes of the job at once, with this exit code.
    fn abort(&self, code: i32);
}
