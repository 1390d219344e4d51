//! What a row comes to: a table of numbers, and the few that sum it up.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::path::PathBuf;

/// The result of a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    /// Names of the columns, units at their end.
    pub columns: Vec<String>,
    /// One number a column; NaN where there is none.
    pub rows: Vec<Vec<f64>>,
    /// What sums it up.
    pub numbers: Map<String, Value>,
    /// The columns that the figure shows.
    pub figure: Vec<Panel>,
    /// Raw results that have figures of their own.
    pub drawn: Vec<Drawn>,
}

/// Raw results that are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// What the names of the figures begin with.
    pub name: String,
    /// Their folder.
    pub folder: PathBuf,
    /// Folder of a chain whose contours go over them.
    pub chain: Option<PathBuf>,
}

/// One panel of the figure: columns against a column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// Column along the x axis.
    pub x: String,
    /// What the y axis is, with its unit.
    pub label: String,
    /// The series.
    pub series: Vec<Series>,
    /// Column of the values injected, drawn as a line.
    pub truth: Option<String>,
    /// Whether points of a series are joined.
    pub joined: bool,
    /// Only rows with this number in this column.
    pub only: Option<(String, f64)>,
}

/// Columns of a panel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Column of the values.
    pub y: String,
    /// Columns of the lower and upper ends of the error bars.
    pub interval: Option<[String; 2]>,
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

    /// Adds a number that sums it up.
    pub fn number(&mut self, name: &str, value: impl Into<Value>) {
        self.numbers.insert(name.to_owned(), value.into());
    }
}
