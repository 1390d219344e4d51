//! Ctrl-C, SIGTERM and SIGUSR1: they stop a command at once where no results would be lost, and otherwise after the
//! current reconstructions.
//!
//! SIGTERM and SIGUSR1 come from a scheduler at the end of the allocated time, and the exit code tells that the same
//! command resumes.

use super::failure::{INTERRUPTED, RESUME};
use super::{Failure, console};
use signal_hook::consts::SIGINT;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The missing result of commands that write everything at once.
pub const RESULT: &str = "result";

/// Cleanup before a signal ends the program.
type Undo = Box<dyn FnOnce() + Send>;

/// The handling of signals from now on.
pub struct Signals {
    stop: Arc<AtomicBool>,
    deferred: Arc<AtomicBool>,
    code: Arc<AtomicU8>,
    undo: Arc<Mutex<Option<Undo>>>,
}

impl Signals {
    /// Catches the signals: until [`Signals::defer`], the first one ends the program with a message; after it, the
    /// first one sets the flag, and a second Ctrl-C ends the program. The message names the result that has not begun:
    /// the first `unit`. Before this call the system handles signals: call it first.
    pub fn catch(unit: &'static str) -> Result<Self, Failure> {
        let signals = Signals {
            stop: Arc::default(),
            deferred: Arc::default(),
            code: Arc::new(INTERRUPTED.into()),
            undo: Arc::default(),
        };
        let Signals { stop, deferred, code, undo } = &signals;
        let (stop, deferred) = (Arc::clone(stop), Arc::clone(deferred));
        let (code, undo) = (Arc::clone(code), Arc::clone(undo));
        let incoming = incoming().map_err(|e| Failure::failed(format!("signals cannot be caught: {e}")))?;
        std::thread::spawn(move || {
            for signal in incoming {
                let by_hand = signal == SIGINT;
                if !by_hand {
                    code.store(RESUME, Ordering::SeqCst);
                }
                // held to the end: nothing is created after this
                let mut undo = undo.lock().unwrap_or_else(PoisonError::into_inner);
                if !deferred.load(Ordering::SeqCst) {
                    if let Some(undo) = undo.take() {
                        undo();
                    }
                    console::error_below_progress(before_the_first(unit));
                    std::process::exit(code.load(Ordering::SeqCst).into());
                }
                drop(undo);
                if stop.swap(true, Ordering::SeqCst) && by_hand {
                    std::process::exit(INTERRUPTED.into());
                }
            }
        });
        Ok(signals)
    }

    /// Catches the signals without an effect: another process decides when to stop.
    pub fn ignore() -> Result<Self, Failure> {
        let signals = Signals::catch("answer")?;
        signals.defer();
        Ok(signals)
    }

    /// Creates an object that is removed again if a signal ends the program before [`Signals::defer`]; a signal
    /// meanwhile waits.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn undoing<T, E, U: FnOnce() + Send + 'static>(
        &self,
        make: impl FnOnce() -> Result<T, E>,
        undo: impl FnOnce(&T) -> U,
    ) -> Result<T, E> {
        let mut held = self.undo.lock().unwrap_or_else(PoisonError::into_inner);
        let made = make()?;
        *held = Some(Box::new(undo(&made)));
        Ok(made)
    }

    /// From now on an interruption would lose results.
    pub fn defer(&self) {
        let _held = self.undo.lock().unwrap_or_else(PoisonError::into_inner);
        self.deferred.store(true, Ordering::SeqCst);
    }

    /// Set once a signal has arrived.
    pub fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    /// The failure by a signal, with its exit code.
    pub fn interrupted(&self, message: impl std::fmt::Display) -> Failure {
        Failure::interrupted(self.code.load(Ordering::SeqCst), message)
    }
}

/// An iterator that waits for the signals.
#[cfg(unix)]
fn incoming() -> io::Result<impl Iterator<Item = i32> + Send> {
    use signal_hook::consts::{SIGTERM, SIGUSR1};
    let mut all = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGUSR1])?;
    Ok(std::iter::from_fn(move || all.forever().next()))
}

/// The same where signals only set flags.
#[cfg(not(unix))]
fn incoming() -> io::Result<impl Iterator<Item = i32> + Send> {
    const LOOK: std::time::Duration = std::time::Duration::from_millis(50);
    let signals = [SIGINT, signal_hook::consts::SIGTERM];
    let flags = [(); 2].map(|()| Arc::new(AtomicBool::new(false)));
    for (signal, flag) in signals.into_iter().zip(&flags) {
        signal_hook::flag::register(signal, Arc::clone(flag))?;
    }
    Ok(std::iter::from_fn(move || {
        loop {
            let come = signals.iter().zip(&flags).find(|(_, flag)| flag.swap(false, Ordering::SeqCst));
            if let Some((signal, _)) = come {
                return Some(*signal);
            }
            std::thread::sleep(LOOK);
        }
    }))
}

/// The message that nothing has begun yet.
pub fn before_the_first(unit: &str) -> String {
    format!("interrupted before the first {unit}; nothing was written")
}
