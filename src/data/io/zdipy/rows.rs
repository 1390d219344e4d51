//! Rows of ZDIpy's input files: lines that are not comments, with line numbers, read one by one.

use super::Field;
use crate::data::io::FileError;
use std::path::Path;

/// The remaining rows.
pub(super) struct Rows<'a> {
    path: &'a Path,
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
}

/// A line that is not a comment.
pub(super) struct Row<'a> {
    path: &'a Path,
    /// Its number (from 1).
    pub line: usize,
    fields: Vec<&'a str>,
}

impl<'a> Rows<'a> {
    pub fn new(path: &'a Path, text: &'a str) -> Self {
        Rows { path, lines: text.lines().enumerate() }
    }

    /// The next row, if there is one.
    pub fn another(&mut self) -> Option<Row<'a>> {
        let path = self.path;
        self.lines.find_map(|(k, text)| {
            let fields: Vec<&str> = text.split_whitespace().take_while(|f| !f.starts_with('#')).collect();
            (!fields.is_empty()).then_some(Row { path, line: k + 1, fields })
        })
    }

    /// The next row, which holds `what`.
    pub fn next(&mut self, what: &'static str) -> Result<Row<'a>, FileError> {
        self.another().ok_or_else(|| FileError::of(self.path, format!("ends before {what}")))
    }
}

impl<'a> Row<'a> {
    /// How many values there are.
    pub fn columns(&self) -> usize {
        self.fields.len()
    }

    /// A value of this line.
    pub fn field<T>(&self, value: T) -> Field<T> {
        Field { value, line: self.line }
    }

    pub fn fault(&self, problem: String) -> FileError {
        FileError::Line { path: self.path.into(), line: self.line, problem }
    }

    /// The text in a column (from 0), which holds `name`.
    pub fn text(&self, column: usize, name: &str) -> Result<&'a str, FileError> {
        let missing = || self.fault(format!("{} columns, the {name} is due in column {}", self.columns(), column + 1));
        self.fields.get(column).copied().ok_or_else(missing)
    }

    pub fn number(&self, column: usize, name: &str) -> Result<f64, FileError> {
        let text = self.text(column, name)?;
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.fault(format!("the {name} is {}, not a number", shown(text)))),
        }
    }

    pub fn positive(&self, column: usize, name: &str) -> Result<f64, FileError> {
        self.within(column, name, 0.0, f64::INFINITY)
    }

    /// A number above `min` and up to `max`.
    pub fn within(&self, column: usize, name: &str, min: f64, max: f64) -> Result<f64, FileError> {
        let value = self.number(column, name)?;
        match (value > min && value <= max, max.is_finite()) {
            (true, _) => Ok(value),
            (false, true) => Err(self.fault(format!("the {name} is {value}, it must be above {min} and up to {max}"))),
            (false, false) => Err(self.fault(format!("the {name} is {value}, it must be above {min}"))),
        }
    }

    /// A whole number above 0.
    pub fn count(&self, column: usize, name: &str) -> Result<usize, FileError> {
        let text = self.text(column, name)?;
        match text.parse() {
            Ok(value) if (1..=MOST).contains(&value) => Ok(value),
            _ => Err(self.fault(format!("the {name} is {}, not a whole number from 1 to {MOST}", shown(text)))),
        }
    }
}

/// No count is larger.
const MOST: usize = 10_000;

/// A piece of text of the user, quoted and cut to a length that keeps a message on one line.
fn shown(text: &str) -> String {
    format!("{:?}", text.chars().take(40).collect::<String>())
}
