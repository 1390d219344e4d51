//! Waiting with little processor time: naps that grow with the wait.
//!
//! MPI's own blocking calls spin.

use std::time::{Duration, Instant};

/// Length of a nap as a fraction of the wait so far, and so the largest relative delay.
const SHARE: u32 = 20;

/// The shortest nap; the kernel adds some 50 us.
const SHORTEST: Duration = Duration::from_micros(10);

/// The longest nap of an idle rank: the delay of its next message. A check costs some 10 us, 3 % of its processor.
pub(super) const WHILE_IDLE: Duration = Duration::from_micros(250);

/// The longest nap of rank 0 while all ranks are busy: the delay in noticing that the job should stop.
pub(super) const WHILE_BUSY: Duration = Duration::from_millis(5);

/// A wait that began with its construction.
pub(super) struct Wait(Instant);

impl Wait {
    pub(super) fn new() -> Self {
        Wait(Instant::now())
    }

    /// Length of the next nap.
    pub(super) fn nap(&self) -> Duration {
        self.0.elapsed() / SHARE
    }
}

/// Sleeps for about this long.
pub(super) fn nap(length: Duration, longest: Duration) {
    std::thread::sleep(length.clamp(SHORTEST, longest));
}
