//! The result of a row: a table, and summary numbers; as `table.csv` and `summary.json` in a folder of its name.

use crate::cases::Failure;
use crate::rows::Row;
use dimcmc::internals::data::io::atomic::{write, write_json};
use dimcmc::internals::data::io::csv::Table;
use serde::Serialize;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

/// Name of the table.
pub const TABLE: &str = "table.csv";

/// Name of the summary.
pub const SUMMARY: &str = "summary.json";

/// The result of a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Names of the columns, units at their end.
    pub columns: Vec<String>,
    /// One number per column; NaN where there is none.
    pub rows: Vec<Vec<f64>>,
    /// Summary numbers.
    pub numbers: Map<String, Value>,
    /// The columns that the figure shows.
    pub figure: Vec<Panel>,
    /// Raw results with separate figures.
    pub drawn: Vec<Drawn>,
}

/// Raw results for plotting.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Prefix of the names of the figures.
    pub name: String,
    /// Their folder.
    pub folder: PathBuf,
    /// Folder of a chain whose contours go over them.
    pub chain: Option<PathBuf>,
}

/// One panel of the figure: columns against a column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Panel {
    /// Column along the x axis.
    pub x: String,
    /// Label of the y axis, with its unit.
    pub label: String,
    /// The series.
    pub series: Vec<Series>,
    /// Column of the injected values, plotted as a line.
    pub truth: Option<String>,
    /// Whether points of a series are joined.
    pub joined: bool,
    /// Only rows with this number in this column.
    pub only: Option<(String, f64)>,
}

/// Columns of a panel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Column of the values.
    pub y: String,
    /// Columns of the lower and upper ends of the error bars.
    pub interval: Option<[String; 2]>,
}

/// The provenance of a row in `summary.json`.
#[derive(Debug, Serialize)]
pub struct Made {
    /// Its command.
    pub command: String,
    /// Whether it is the reduced version.
    pub quick: bool,
    /// Seconds; less where parts were already done.
    pub seconds: f64,
    /// Threads.
    pub threads: usize,
}

/// The content of `summary.json`.
#[derive(Serialize)]
struct Summary<'a> {
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
    /// A table without rows.
    pub fn new(columns: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Report { columns: columns.into_iter().map(Into::into).collect(), ..Report::default() }
    }

    /// Adds a row.
    pub fn row(&mut self, numbers: Vec<f64>) {
        assert_eq!(numbers.len(), self.columns.len(), "one number a column");
        self.rows.push(numbers);
    }

    /// Adds a summary number.
    pub fn number(&mut self, name: &str, value: impl Into<Value>) {
        self.numbers.insert(name.to_owned(), value.into());
    }

    /// Writes both files into `folder`, which must exist.
    pub fn write(&self, row: &Row, made: &Made, folder: &Path) -> Result<(), Failure> {
        let columns: Vec<&str> = self.columns.iter().map(String::as_str).collect();
        let mut table = Table::new(&columns);
        self.rows.iter().for_each(|numbers| table.row(numbers));
        write(&folder.join(TABLE), &table.into_bytes())?;
        let summary = Summary {
            row: row.name,
            title: row.title,
            paper: row.paper,
            version: env!("CARGO_PKG_VERSION"),
            made,
            seed: "chains 1; noise 1, or what the column `seed` says",
            figure: &self.figure,
            numbers: &self.numbers,
        };
        // the summary last: a row is finished where it exists
        Ok(write_json(&folder.join(SUMMARY), &summary)?)
    }

    /// The summary numbers, one per line.
    pub fn text(&self) -> String {
        let mut text = String::new();
        lines(&mut text, "", &self.numbers);
        text
    }
}

/// To five decimals: more are meaningless.
pub fn rounded(x: f64) -> f64 {
    (1e5 * x).round() / 1e5
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
