//! The results of a row as files: `table.csv` and `summary.json` in a folder of its name.

use super::report::Panel;
use super::{Report, Row};
use crate::data::io::atomic::{WriteError, write, write_json};
use crate::data::io::csv::Table;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::Path;

/// Name of the table.
pub const TABLE: &str = "table.csv";

/// Name of what sums it up.
pub const SUMMARY: &str = "summary.json";

/// What `summary.json` says of where a row came from.
#[derive(Clone, Debug, Serialize, Deserialize)]
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

/// The content of `summary.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SummaryFile {
    /// Its name.
    pub row: String,
    /// What was done.
    pub title: String,
    /// What the paper found.
    pub paper: String,
    /// Version of the program.
    pub version: String,
    /// How it was made.
    #[serde(flatten)]
    pub made: Made,
    /// Where the random numbers are from.
    pub seed: String,
    /// The columns that the figure shows.
    pub figure: Vec<Panel>,
    /// What sums it up.
    pub numbers: Map<String, Value>,
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
            row: row.name.into(),
            title: row.title.into(),
            paper: row.paper.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            made: made.clone(),
            seed: "chains 1; noise 1, or what the column `seed` says".into(),
            figure: self.figure.clone(),
            numbers: self.numbers.clone(),
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
