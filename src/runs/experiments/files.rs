//! The results of a row as files: `table.csv` and `summary.json` in a folder of its name.

use super::report::Panel;
use super::{Report, Row};
use crate::data::io::atomic::{WriteError, write, write_json};
use crate::data::io::csv::Table;
use serde::Serialize;
use serde_json::{Map, Value};
use std::path::Path;

/// Name of the table.
pub const TABLE: &str = "table.csv";

/// Name of what sums it up.
pub const SUMMARY: &str = "summary.json";

/// What `summary.json` says of where a row came from.
#[derive(Clone, Debug, Serialize)]
pub struct Made {
    /// The command that made it.
    pub command: String,
    /// Whether it is the reduced version.
    pub quick: bool,
    /// Seconds that it took; less where some of it was done before.
    pub seconds: f64,
    /// Threads.
    pub threads: usize,
}

#[derive(Serialize)]
struct SummaryFile<'a> {
    row: &'a str,
    title: &'a str,
    paper: &'a str,
    version: &'a str,
    #[serde(flatten)]
    made: &'a Made,
    seed: &'a str,
    figure: &'a [Panel],
    numbers: &'a Map<String, Value>,
}

impl Report {
    /// Writes both files into `folder`, which must be there.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, row: &Row, made: &Made, folder: &Path) -> Result<(), WriteError> {
        let columns: Vec<&str> = self.columns.iter().map(String::as_str).collect();
        let mut table = Table::new(&columns);
        self.rows.iter().for_each(|numbers| table.row(numbers));
        write(&folder.join(TABLE), &table.into_bytes())?;
        let summary = SummaryFile {
            row: row.name,
            title: row.title,
            paper: row.paper,
            version: env!("CARGO_PKG_VERSION"),
            made,
            seed: "chains 1; noise 1, or what the column `seed` says",
            figure: &self.figure,
            numbers: &self.numbers,
        };
        // the summary last: a row is done where it is there
        write_json(&folder.join(SUMMARY), &summary)
    }

    /// The numbers that sum it up, a line each.
    pub fn text(&self) -> String {
        let mut text = String::new();
        lines(&mut text, "", &self.numbers);
        text
    }
}

/// A line for each number, named with all its parents; lists of more than a few are left out.
fn lines(text: &mut String, parents: &str, numbers: &Map<String, Value>) {
    for (name, value) in numbers {
        match value {
            Value::Object(inner) => lines(text, &format!("{parents}{name} "), inner),
            Value::Array(all) if all.len() > 4 || all.iter().any(Value::is_object) => {}
            Value::Array(all) if all.is_empty() => {}
            value => text.push_str(&format!("  {parents}{name}: {value}\n")),
        }
    }
}
