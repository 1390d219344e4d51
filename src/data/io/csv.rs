//! Tables as comma-separated text. Floats are written so that they read back exactly.

use super::FileError;
use super::saved::LARGEST;
use std::fmt::{Display, Write as _};
use std::path::{Path, PathBuf};

/// Column of the number of each profile's data set, from 1, where there are several.
pub const DATA_SET: &str = "data_set";

/// A table that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    path: PathBuf,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// The line number of each row.
    lines: Vec<usize>,
}

impl Columns {
    /// Reads a table with the names of its columns in the first line.
    ///
    /// # Errors
    /// [`FileError`]: a file that cannot be read, a line of another length, a cell that is not a number or out of
    /// range, no row.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = std::fs::read_to_string(path).map_err(|source| FileError::Read { path: path.into(), source })?;
        let mut lines = text.lines();
        let names: Vec<String> =
            lines.next().unwrap_or_default().split(',').map(|name| name.trim().to_owned()).collect();
        let mut columns = vec![Vec::new(); names.len()];
        let mut rows = Vec::new();
        for (k, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let wrong = |problem: String| FileError::Line { path: path.into(), line: k + 2, problem };
            let cells: Vec<&str> = line.split(',').collect();
            if cells.len() != names.len() {
                return Err(wrong(format!("{} columns instead of {}", cells.len(), names.len())));
            }
            for ((column, cell), name) in columns.iter_mut().zip(cells).zip(&names) {
                let cell = cell.trim();
                let number: f64 = cell.parse().map_err(|_| wrong(format!("{cell:?} is not a number")))?;
                if number.is_finite() && number.abs() > LARGEST {
                    return Err(wrong(format!("{name}: {cell} is out of range")));
                }
                column.push(number);
            }
            rows.push(k + 2);
        }
        if rows.is_empty() {
            return Err(FileError::Line { path: path.into(), line: 2, problem: "the table has no row".into() });
        }
        Ok(Columns { path: path.into(), names, columns, lines: rows })
    }

    /// Checks that there are `expected` rows; `because` names the source of that number.
    ///
    /// # Errors
    /// [`FileError::File`].
    pub fn check_rows(&self, expected: usize, because: &str) -> Result<(), FileError> {
        let found = self.lines.len();
        match found == expected {
            true => Ok(()),
            false => Err(FileError::of(&self.path, format!("{found} rows instead of {expected}: {because}"))),
        }
    }

    /// The numbers of a column, all of them in a range.
    ///
    /// # Errors
    /// [`FileError::File`] if there is none of that name; [`FileError::Line`] of the first that is not in it.
    pub fn column_within(&self, name: &str, [low, high]: [f64; 2]) -> Result<&[f64], FileError> {
        let column = self.column(name)?;
        match column.iter().position(|x| !(low..=high).contains(x)) {
            None => Ok(column),
            Some(k) => Err(FileError::Line {
                path: self.path.clone(),
                line: self.lines[k],
                problem: match low > 0.0 && column[k] <= 0.0 {
                    true => format!("{name}: {} must be above 0", column[k]),
                    false => format!("{name}: {} must be from {low:e} to {high:e}", column[k]),
                },
            }),
        }
    }

    /// The numbers of a column.
    ///
    /// # Errors
    /// [`FileError::File`] if there is none of that name.
    pub fn column(&self, name: &str) -> Result<&[f64], FileError> {
        let k = self.names.iter().position(|one| one == name);
        let missing = || FileError::of(&self.path, format!("no column {name}"));
        k.map(|k| self.columns[k].as_slice()).ok_or_else(missing)
    }
}

/// A table of words that was read, such as a catalogue of stars.
#[derive(Clone, Debug, PartialEq)]
pub struct Words {
    path: PathBuf,
    names: Vec<String>,
    rows: Vec<Vec<String>>,
    /// The line number of each row.
    lines: Vec<usize>,
}

impl Words {
    /// Reads a table with the names of its columns in the first line. Cells may be quoted.
    ///
    /// # Errors
    /// [`FileError`]: a file that cannot be read, a line of another length, no row.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = std::fs::read_to_string(path).map_err(|source| FileError::Read { path: path.into(), source })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let names = lines.next().map(|(_, line)| cells(line)).unwrap_or_default();
        let mut table = Words { path: path.into(), names, rows: Vec::new(), lines: Vec::new() };
        for (k, line) in lines {
            let row = cells(line);
            if row.len() != table.names.len() {
                let problem = format!("{} columns instead of {}", row.len(), table.names.len());
                return Err(FileError::Line { path: path.into(), line: k + 1, problem });
            }
            table.rows.push(row);
            table.lines.push(k + 1);
        }
        if table.rows.is_empty() { Err(FileError::of(path, "the table has no row")) } else { Ok(table) }
    }

    /// Whether there is a column of that name.
    pub fn has(&self, name: &str) -> bool {
        self.names.iter().any(|one| one == name)
    }

    /// Name of the first column.
    pub fn first(&self) -> &str {
        self.names.first().map_or("", String::as_str)
    }

    /// The line number of a row in the file.
    pub fn line(&self, row: usize) -> usize {
        self.lines[row]
    }

    /// The cells of a column.
    ///
    /// # Errors
    /// [`FileError::File`] if there is none of that name.
    pub fn column(&self, name: &str) -> Result<Vec<&str>, FileError> {
        let missing =
            || FileError::of(&self.path, format!("no column {name}; the columns are {}", self.names.join(", ")));
        let k = self.names.iter().position(|one| one == name).ok_or_else(missing)?;
        Ok(self.rows.iter().map(|row| row[k].as_str()).collect())
    }
}

/// The cells of a line; a quote within quotes is doubled.
fn cells(line: &str) -> Vec<String> {
    let (mut cells, mut inside) = (vec![String::new()], false);
    let mut characters = line.chars().peekable();
    while let Some(c) = characters.next() {
        let cell = cells.last_mut().expect("never empty");
        match c {
            '"' if inside && characters.peek() == Some(&'"') => {
                characters.next();
                cell.push('"');
            }
            '"' => inside = !inside,
            ',' if !inside => cells.push(String::new()),
            _ => cell.push(c),
        }
    }
    cells.iter().map(|cell| cell.trim().to_owned()).collect()
}

/// A word as a cell: in quotes where it contains a comma, a quote or the end of a line.
pub fn quoted(word: &str) -> String {
    if word.contains([',', '"', '\n', '\r']) { format!("\"{}\"", word.replace('"', "\"\"")) } else { word.to_owned() }
}

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

    /// Adds a row; one number per column.
    pub fn row(&mut self, numbers: &[f64]) {
        self.cells(numbers.iter());
    }

    /// Adds a row of numbers and plain words, one cell per column; nothing in them is quoted.
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

#[test]
fn words_are_read_as_they_are_written() {
    for word in ["AB Dor", "a, b", "the \"star\"", ""] {
        assert_eq!(cells(&format!("1,{},2", quoted(word))), ["1", word, "2"]);
    }
}
