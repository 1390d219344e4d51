//! The role of this process among the ranks of a cluster: the first one runs the command, the others evaluate for it.
//!
//! Without the feature `mpi`, or without a launcher, it is the only one.

use super::signals::Signals;
use super::{Failure, Global};
use crate::data::io::lines::Claim;
use crate::runs::pool::Pool;

/// The other ranks, until a command takes them.
#[cfg(feature = "mpi")]
pub type Ranks = std::cell::RefCell<Option<crate::runs::cluster::Queue>>;

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
    #[cfg(feature = "mpi")]
    if let Some(queue) = global.ranks.take() {
        return Pool::ranks(queue, signals.flag());
    }
    let _ = global;
    Pool::threads(signals.flag())
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
#[cfg(not(feature = "mpi"))]
pub fn join(global: &Global) -> Result<Done, Failure> {
    // as many programs as ranks would do the same in the same folder
    let several =
        |name| std::env::var(name).ok().and_then(|size: String| size.parse().ok()).is_some_and(|n: usize| n > 1);
    if ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"].into_iter().any(several) {
        return Err(Failure::input(
            "started as several ranks, but built without MPI: cargo build --release --features mpi",
        ));
    }
    threads(global.threads.map(Into::into))?;
    Ok(Done::Nothing)
}

/// Joins the other ranks, if there are any.
#[cfg(feature = "mpi")]
pub fn join(global: &Global) -> Result<Done, Failure> {
    use crate::runs::cluster::{self, Rank};
    let given = global.threads.map(usize::from);
    match cluster::join(given.unwrap_or(1)).map_err(Failure::failed)? {
        Rank::Only => threads(given)?,
        Rank::First(queue) => {
            threads(given)?;
            global.ranks.replace(Some(queue));
        }
        Rank::Other(worker) => {
            threads(given.or(Some(1)))?;
            // the first rank decides when to stop; a signal to all must not kill the others
            let _signals = Signals::ignore()?;
            if let Err(error) = worker.serve(crate::runs::batch::learn) {
                super::console::error(format_args!("rank {}: {error}", worker.rank()));
                cluster::abort(2);
            }
            return Ok(Done::Everything);
        }
    }
    Ok(Done::Nothing)
}

/// Sets the number of threads of this process, if it is given.
fn threads(given: Option<usize>) -> Result<(), Failure> {
    let Some(threads) = given else { return Ok(()) };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|e| Failure::failed(format!("--threads {threads}: {e}")))
}
