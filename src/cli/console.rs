//! The only way to the terminal: results on stdout, errors on stderr. An error of either stream stops neither a command
//! nor the thread that waits for signals: output to a closed stream is dropped, and results lost on a full disk are a
//! failure once the command has ended.

use super::Failure;
use crate::numerics::text::{broken, escaped};
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal as _, Write as _};
use std::sync::Mutex;

/// The system's message when results could not be printed for the first time.
static LOST: Mutex<Option<String>> = Mutex::new(None);

/// Prints results, with control characters escaped and long lines broken.
pub fn print(text: impl Display) {
    print_bytes(broken(&text.to_string()).as_bytes());
}

/// Prints a line of results.
pub fn line(text: impl Display) {
    print(format_args!("{text}\n"));
}

/// Prints results unescaped. A closed pipe is no failure.
pub fn print_bytes(bytes: &[u8]) {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            let mut lost = LOST.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            lost.get_or_insert_with(|| error.to_string());
        }
        _ => {}
    }
}

/// Prints an error on stderr, in one line for searches in logs; ignored if stderr is closed.
pub fn error(message: impl Display) {
    aside(&format!("error: {}", escaped(&message.to_string())));
}

/// Prints a note on the results on stderr.
pub fn note(message: impl Display) {
    aside(&broken(&format!("note: {}", escaped(&message.to_string()))));
}

fn aside(text: &str) {
    // one write, so that no line of another process comes between
    let _ = std::io::stderr().write_all(format!("{text}\n").as_bytes());
}

/// The same where a terminal may be in the middle of the progress line.
pub fn error_below_progress(message: impl Display) {
    if std::io::stderr().is_terminal() {
        let _ = std::io::stderr().write_all(b"\n");
    }
    error(message);
}

/// The end of a command: its error, if it has one, and the exit code.
pub fn end(result: Result<(), Failure>) -> u8 {
    let lost = LOST.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
    let lost = lost.map(|problem| Failure::failed(format!("standard output: cannot write: {problem}")));
    match result.and_then(|()| lost.map_or(Ok(()), Err)) {
        Ok(()) => 0,
        Err(failure) => {
            error(&failure);
            failure.exit_code()
        }
    }
}
