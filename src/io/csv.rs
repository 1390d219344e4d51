//! Tables as comma-separated text. Floats are written so that they read back exactly.

use std::fmt::{Display, Write as _};

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
        self.cells(numbers.iter());
    }

    /// Adds a row of numbers and plain words, one cell a column; nothing in them is quoted.
    pub fn cells<C: Display>(&mut self, cells: impl IntoIterator<Item = C>) {
        let mut count = 0;
        for cell in cells {
            let comma = if count == 0 { "" } else { "," };
            // Writing to a String cannot fail.
            let _ = write!(self.text, "{comma}{cell}");
            count += 1;
        }
        assert_eq!(count, self.columns, "one cell a column");
        self.text.push('\n');
    }

    /// The text.
    pub fn into_bytes(self) -> Vec<u8> {
        self.text.into_bytes()
    }
}
