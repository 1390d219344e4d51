//! MPI ranks: rank 0 asks, the others answer, in bytes. One queue: every question goes to a free rank, and the answers
//! come in the order of the questions.
//!
//! A panic on any rank, on any thread, ends them all: otherwise the others would wait indefinitely. Waiting uses almost
//! no processor time (`nap`).
//!
//! The library of the commands is compiled without MPI: it knows `runs::pool::ranks` alone.

// tested without an MPI, too
#[cfg(any(feature = "mpi", test))]
mod hands;
#[cfg(feature = "mpi")]
mod job;
#[cfg(feature = "mpi")]
mod message;
#[cfg(feature = "mpi")]
mod nap;
#[cfg(feature = "mpi")]
mod queue;
#[cfg(feature = "mpi")]
mod worker;
#[cfg(feature = "mpi")]
mod world;

#[cfg(feature = "mpi")]
pub use job::join;
