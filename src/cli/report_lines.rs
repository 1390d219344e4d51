//! Short results on stdout, one label and value per line.

use super::console;
use crate::numerics::text::escaped;
use std::fmt::Display;
use std::path::Path;

/// Lines of label and value.
#[derive(Default)]
pub struct Report {
    lines: Vec<(&'static str, String)>,
}

impl Report {
    /// Adds a line.
    pub fn line(mut self, label: &'static str, value: impl Display) -> Self {
        self.lines.push((label, value.to_string()));
        self
    }

    /// Adds a line that names the written files.
    pub fn written(self, folder: &Path, files: impl Display) -> Self {
        self.line("written", format!("{}: {files}", folder.display()))
    }

    /// Prints the lines, values aligned.
    pub fn print(self) {
        let width = self.lines.iter().map(|(label, _)| label.len()).max().unwrap_or(0);
        for (label, value) in &self.lines {
            console::line(format_args!("{label:width$}  {}", escaped(value)));
        }
    }
}
