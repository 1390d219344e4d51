//! Waiting without burning a processor: naps that grow with the wait.
//!
//! MPI's own blocking calls spin. Left out: what is waited for.

use std::time::{Duration, Instant};

/// Share of the wait so far that a nap takes, and so the most that waiting this way adds to it.
const SHARE: u32 = 20;

/// The shortest nap; the kernel adds some 50 us.
const SHORTEST: Duration = Duration::from_micros(10);

/// The longest: so long does a rank that was idle take to hear that it is wanted. A look costs some 10 us, 1 % of the processor.
const LONGEST: Duration = Duration::from_millis(1);

/// A wait that began when this was made.
pub(super) struct Nap(Instant);

impl Nap {
    pub(super) fn new() -> Self {
        Nap(Instant::now())
    }

    /// How long the next nap is.
    pub(super) fn length(&self) -> Duration {
        (self.0.elapsed() / SHARE).clamp(SHORTEST, LONGEST)
    }

    /// Takes it.
    pub(super) fn take(&self) {
        std::thread::sleep(self.length());
    }
}
