//! All ranks of a job.

use mpi::environment::Universe;
use mpi::topology::{Process, SimpleCommunicator};
use mpi::traits::Communicator as _;

/// Ends all ranks at once.
pub(super) fn abort(code: i32) {
    SimpleCommunicator::world().abort(code)
}

/// Rank 0.
pub(super) fn first(world: &SimpleCommunicator) -> Process<'_> {
    world.process_at_rank(0)
}

/// The ranks, and MPI itself until this is dropped.
pub(super) struct Ranks {
    pub(super) world: SimpleCommunicator,
    _universe: Universe,
}

impl Ranks {
    pub(super) fn new(universe: Universe) -> Self {
        Ranks { world: universe.world(), _universe: universe }
    }
}
