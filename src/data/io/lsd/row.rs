//! A row of a profile, and what can be wrong with a line.

/// What is used of a row.
pub(super) struct Row {
    pub line: usize,
    pub velocity: f64,
    pub intensity: f64,
    pub sigma: f64,
}

/// What is wrong with a line (counted from 1), or with the file as a whole (line 0).
#[derive(Debug, PartialEq)]
pub(super) struct Fault {
    pub line: usize,
    pub problem: String,
}

pub(super) fn fault<T>(line: usize, problem: String) -> Result<T, Fault> {
    Err(Fault { line, problem })
}

/// A piece of the user's text, quoted, escaped and cut to a length that keeps a message on one line.
pub(super) fn shown(text: &str) -> String {
    let short: String = text.chars().take(40).collect();
    format!("{short:?}")
}
