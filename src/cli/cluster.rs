//! The role of this process among the ranks of a cluster: the first one runs the command, the others evaluate for it.
//!
//! Without MPI (`mpi/`), or without a launcher, it is the only one.

use super::signals::Signals;
use super::{Failure, Global, console};
use crate::data::io::lines::Claim;
use crate::runs::batch::learn;
use crate::runs::pool::Pool;
use crate::runs::pool::ranks::{Rank, Ranks};
use std::cell::RefCell;
use std::error::Error;

/// The other ranks, until a command takes them.
pub type Others = RefCell<Option<Box<dyn Ranks>>>;

/// Joins the ranks that a launcher has started, this one answering so many questions at once if it is not the first.
pub type Join = fn(usize) -> Result<Rank, Box<dyn Error>>;

/// Remaining work after joining the others.
#[derive(PartialEq, Eq)]
pub enum Done {
    /// The command.
    Nothing,
    /// None: this rank has evaluated for the first one until its end.
    Everything,
}

/// The pool of a command, until a signal arrives.
pub fn pool(global: &Global, signals: &Signals) -> Pool {
    match global.ranks.take() {
        Some(ranks) => Pool::ranks(ranks, signals.flag()),
        None => Pool::threads(signals.flag()),
    }
}

/// Claims the output before a long search; a signal meanwhile releases it. One of several ranks may end the job where
/// it has no data, and nothing is written before: in that case the output is claimed by calling the returned function.
pub fn claim<E>(
    pool: &Pool,
    signals: &Signals,
    claim: impl Fn() -> Result<Claim, E>,
) -> Result<impl FnOnce() -> Result<Claim, E>, E> {
    let early = if pool.is_of_ranks() { None } else { Some(signals.undoing(&claim, Claim::undo)?) };
    Ok(move || early.map_or_else(claim, Ok))
}

/// Joins the other ranks, if there are any.
pub fn join(global: &Global, join: Join) -> Result<Done, Failure> {
    let given = global.threads.map(usize::from);
    match join(given.unwrap_or(1)).map_err(Failure::failed)? {
        Rank::Only => threads(given)?,
        Rank::First(ranks) => {
            threads(given)?;
            global.ranks.replace(Some(ranks));
        }
        Rank::Other(worker) => {
            threads(given.or(Some(1)))?;
            // the first rank decides when to stop; a signal to all must not kill the others
            let _signals = Signals::ignore()?;
            if let Err(error) = worker.serve(&learn) {
                console::error(format_args!("rank {}: {error}", worker.rank()));
                worker.abort(2);
            }
            return Ok(Done::Everything);
        }
    }
    Ok(Done::Nothing)
}

/// No others: a program without MPI.
///
/// # Errors
/// It was started as several ranks, which would all do the same in the same folder.
pub fn alone(_: usize) -> Result<Rank, Box<dyn Error>> {
    let several =
        |name| std::env::var(name).ok().and_then(|size: String| size.parse().ok()).is_some_and(|n: usize| n > 1);
    if ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"].into_iter().any(several) {
        return Err("started as several ranks, but built without MPI: cargo install --path mpi --features mpi, and \
                    dimcmc-mpi instead of dimcmc"
            .into());
    }
    Ok(Rank::Only)
}

/// Sets the number of threads of this process, if it is given.
fn threads(given: Option<usize>) -> Result<(), Failure> {
    let Some(threads) = given else { return Ok(()) };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|e| Failure::failed(format!("--threads {threads}: {e}")))
}
