//! Short results on stdout, a label and a value a line.

use std::fmt::Display;
use std::io::Write as _;
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

    /// Adds a line that names what was written.
    pub fn written(self, folder: &Path, files: impl Display) -> Self {
        self.line("written", format!("{}: {files}", folder.display()))
    }

    /// Prints the lines, values aligned. Whoever reads may stop reading.
    pub fn print(self) {
        let width = self.lines.iter().map(|(label, _)| label.len()).max().unwrap_or(0);
        let mut stdout = std::io::stdout().lock();
        for (label, value) in &self.lines {
            let _ = writeln!(stdout, "{label:width$}  {value}");
        }
    }
}
