//! This process among those that a launcher has started, and their end.

use super::queue::Queue;
use super::worker::Worker;
use super::world::abort;
use dimcmc::internals::runs::pool::ranks::Rank;
use mpi::traits::Communicator as _;
use std::error::Error;

/// Exit code of a job that a panic ended, as that of a program that panics.
const PANICKED: i32 = 101;

/// Variables that MPI launchers set for every rank.
const LAUNCHED: [&str; 5] = ["OMPI_COMM_WORLD_SIZE", "PMI_RANK", "PMIX_RANK", "MPI_LOCALRANKID", "PALS_RANKID"];

/// Why there are no ranks.
#[derive(Debug, thiserror::Error)]
enum ClusterError {
    /// MPI does not start, or was started before.
    #[error("MPI does not start")]
    Start,
    /// Panics could not end the job from their thread.
    #[error("this MPI does not allow calls from several threads (MPI_THREAD_MULTIPLE)")]
    Threads,
}

/// Joins the ranks that a launcher has started, this one answering so many questions at once if it is not the first;
/// without a launcher this is the only rank, and MPI is not used.
///
/// # Errors
/// MPI does not start, or does not allow calls from several threads.
pub fn join(at_once: usize) -> Result<Rank, Box<dyn Error>> {
    if !LAUNCHED.iter().any(|name| std::env::var_os(name).is_some()) {
        return Ok(Rank::Only);
    }
    let threading = mpi::Threading::Multiple;
    let (universe, provided) = mpi::initialize_with_threading(threading).ok_or(ClusterError::Start)?;
    if provided < threading {
        return Err(ClusterError::Threads.into());
    }
    let world = universe.world();
    if world.size() == 1 {
        return Ok(Rank::Only);
    }
    abort_on_panic();
    Ok(match world.rank() {
        0 => Rank::First(Box::new(Queue::new(universe))),
        _ => Rank::Other(Box::new(Worker::new(universe, at_once))),
    })
}

/// Ends all ranks after the message of a panic.
fn abort_on_panic() {
    let message = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        message(panic);
        abort(PANICKED);
    }));
}
