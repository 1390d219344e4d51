//! Ctrl-C and SIGTERM: at once where there is nothing to lose, at the end of a half-step or a batch where there is.

use super::Failure;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals as Incoming;
use std::io::IsTerminal as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What signals do from now on.
pub struct Signals {
    stop: Arc<AtomicBool>,
    deferred: Arc<AtomicBool>,
}

impl Signals {
    /// Catches the signals: until [`Signals::defer`], the first one ends the program with a message; after it, the first one
    /// sets the flag, and the second one ends the program. The message names what has not begun: the first `unit`.
    pub fn catch(unit: &'static str) -> Result<Self, Failure> {
        let signals = Signals { stop: Arc::default(), deferred: Arc::default() };
        let (stop, deferred) = (Arc::clone(&signals.stop), Arc::clone(&signals.deferred));
        let mut incoming =
            Incoming::new([SIGINT, SIGTERM]).map_err(|e| Failure::failed(format!("signals cannot be caught: {e}")))?;
        std::thread::spawn(move || {
            for _ in &mut incoming {
                if !deferred.load(Ordering::SeqCst) {
                    // a terminal is in the middle of the progress line
                    let line_break = if std::io::stderr().is_terminal() { "\n" } else { "" };
                    eprintln!("{line_break}error: interrupted before the first {unit}; nothing was written");
                    std::process::exit(1);
                }
                if stop.swap(true, Ordering::SeqCst) {
                    std::process::exit(1);
                }
            }
        });
        Ok(signals)
    }

    /// From now on there is something to lose.
    pub fn defer(&self) {
        self.deferred.store(true, Ordering::SeqCst);
    }

    /// Set once a signal has come.
    pub fn flag(&self) -> &AtomicBool {
        &self.stop
    }
}
