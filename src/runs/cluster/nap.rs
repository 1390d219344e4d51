//! Waiting without burning a processor: naps that grow with the wait.
//!
//! MPI's own blocking calls spin.

use std::time::{Duration, Instant};

/// Share of the wait so far that a nap takes, and so the most that waiting this way adds to it.
const SHARE: u32 = 20;

/// The shortest nap; the kernel adds some 50 us.
const SHORTEST: Duration = Duration::from_micros(10);

/// The longest of who has nothing to do: so long does it take at most to hear that it is wanted. A look costs some 10
/// us, 3 % of its processor.
pub(super) const WHILE_IDLE: Duration = Duration::from_micros(250);

/// The longest of rank 0 while all have something to do: so long does it take to see that the job is to stop.
pub(super) const WHILE_BUSY: Duration = Duration::from_millis(5);

/// A wait that began when this was made.
pub(super) struct Wait(Instant);

impl Wait {
    pub(super) fn new() -> Self {
        Wait(Instant::now())
    }

    /// How long the next nap is.
    pub(super) fn nap(&self) -> Duration {
        self.0.elapsed() / SHARE
    }
}

/// Sleeps for about so long.
pub(super) fn nap(length: Duration, longest: Duration) {
    std::thread::sleep(length.clamp(SHORTEST, longest));
}
