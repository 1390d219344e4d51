//! Tables of numbers as comma-separated text. Floats are written so that they read back exactly.

use std::fmt::Write as _;

/// A table under construction.
#[derive(Clone, Debug)]
pub struct Table {
    text: String,
    columns: usize,
}

impl Table {
    /// An empty table with the names of its columns.
    pub fn new(columns: &[&str]) -> Self {
        Table { text: columns.join(",") + "\n", columns: columns.len() }
    }

    /// Adds a row; one number a column.
    pub fn row(&mut self, numbers: &[f64]) {
        assert_eq!(numbers.len(), self.columns, "one number a column");
        for (k, number) in numbers.iter().enumerate() {
            let comma = if k == 0 { "" } else { "," };
            // Writing to a String cannot fail.
            let _ = write!(self.text, "{comma}{number}");
        }
        self.text.push('\n');
    }

    /// The text.
    pub fn into_bytes(self) -> Vec<u8> {
        self.text.into_bytes()
    }
}
