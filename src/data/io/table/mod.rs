//! Tables of numbers in the formats of other programs: the text of a file in whatever encoding ([`text`]), lines
//! without comments, cells between commas, semicolons, tabs or blanks ([`Separator`]), names of columns with their
//! units ([`Name`]), and numbers ([`number()`]). The readers of LSD profiles, lists of them and light curves use it;
//! they decide on the meaning of columns and the choice of rows.

mod cells;
mod encoding;
mod names;
mod number;

pub use cells::Separator;
pub use encoding::{NotText, text};
pub use names::{Name, add_units, all_readings, bare, is_below_names, readings};
pub use number::{has_decimal_comma, is_dashes, is_missing, number};

/// Marks that begin a comment.
const COMMENT: [char; 4] = ['#', '*', '!', '%'];

/// Fewest numbers that make a row.
const FEWEST: usize = 2;

/// A line that is neither blank nor a comment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line<'a> {
    /// Its number, from 1.
    pub number: usize,
    /// Its content.
    pub text: &'a str,
}

/// The lines of a text, and the comments before the first of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Lines<'a> {
    /// Lines that are neither blank nor comments.
    pub lines: Vec<Line<'a>>,
    /// Comments before all of these, without their marks.
    pub comments: Vec<&'a str>,
}

impl<'a> Lines<'a> {
    /// The lines of a text.
    pub fn of(text: &'a str) -> Self {
        let filled = text.lines().enumerate().map(|(k, text)| Line { number: k + 1, text });
        let filled = filled.filter(|line| !line.text.trim().is_empty());
        let is_comment = |line: &Line| line.text.trim_start().starts_with(COMMENT);
        let uncommented = |line: Line<'a>| line.text.trim_start().trim_start_matches(COMMENT).trim_start();
        let comments = filled.clone().take_while(is_comment).map(uncommented).collect();
        Lines { lines: filled.filter(|line| !is_comment(line)).collect(), comments }
    }
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row<'a> {
    /// Its line, from 1.
    pub line: usize,
    /// Its cells, as text.
    pub cells: Vec<&'a str>,
}

impl<'a> Row<'a> {
    /// The cell of a column; empty where the row ends before it.
    pub fn cell(&self, column: usize) -> &'a str {
        self.cells.get(column).copied().unwrap_or("")
    }
}

/// A table as in its file. Rows need not have as many cells as others.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<'a> {
    /// The ways to read the names of the columns, the plain one first: of the last line before the rows, or of the last
    /// comment. Empty where there are none for the number of columns of the first row.
    pub names: Vec<Vec<Name>>,
    /// The rows, from the first that holds two numbers or more.
    pub rows: Vec<Row<'a>>,
}

impl<'a> Table<'a> {
    /// The table that is in a text.
    pub fn of(text: &'a str) -> Self {
        let Lines { lines, comments } = Lines::of(text);
        let numbers = |line: &Line| {
            let cells = Separator::of(None, std::iter::once(line.text)).cells(line.text);
            let is_number = |cell: &&str| !is_missing(cell) && (number(cell).is_ok() || has_decimal_comma(cell));
            cells.iter().filter(|cell| is_number(cell)).count()
        };
        let first = lines.iter().position(|line| numbers(line) >= FEWEST).unwrap_or(lines.len());
        let (before, rows) = lines.split_at(first);
        let names = |separator: Separator, columns: usize| {
            let below = before.iter().rev().take_while(|line| {
                let cells = separator.cells(line.text);
                cells.len() == columns && cells.iter().all(|cell| is_dashes(cell) || cell.is_empty())
            });
            let ruled = before.len() - below.count();
            let lines = before[..ruled].iter().rev().map(|line| line.text).chain(comments.iter().rev().copied());
            lines.map(|line| readings(line, columns)).find(|readings| !readings.is_empty())
        };
        let named = before.last().map(|line| line.text);
        let separator = Separator::of(named, rows.iter().map(|line| line.text));
        let rows: Vec<Row> =
            rows.iter().map(|line| Row { line: line.number, cells: separator.cells(line.text) }).collect();
        let columns = rows.first().map_or(0, |row| row.cells.len());
        Table { names: names(separator, columns).unwrap_or_default(), rows }
    }
}

/// A piece of text of the user, quoted, escaped and cut to a length that keeps a message on one line.
pub fn shown(text: &str) -> String {
    let short: String = text.chars().take(40).collect();
    format!("{short:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Vec<String>, Vec<(usize, Vec<&str>)>) {
        let Table { names, rows } = Table::of(text);
        let names = names.into_iter().next().unwrap_or_default().into_iter().map(|name| name.bare).collect();
        (names, rows.into_iter().map(|row| (row.line, row.cells)).collect())
    }

    #[test]
    fn one_table_however_it_is_written() {
        let due = ["time", "flux", "sigma"].map(str::to_owned).to_vec();
        for (text, line) in [
            ("time,flux,sigma\n1.5,2,3\n", 2),
            ("# TIC 12345\n# sector 12\n\ntime;flux;sigma\n1.5;2;3\n", 5),
            ("# time,flux,sigma\n1.5,2,3\n", 2),
            ("# time flux sigma\n1.5, 2, 3\n", 2),
            ("time (d)\tflux\tsigma\n----\t---\t---\n1.5\t2\t3\n", 3),
            ("a title\ntime flux sigma\n  1.5   2  3\n", 3),
        ] {
            assert_eq!(read(text), (due.clone(), vec![(line, vec!["1.5", "2", "3"])]), "{text:?}");
        }
    }

    #[test]
    fn rows_keep_what_is_empty_or_text() {
        let (names, rows) = read("time,flux,quality\n1,2,G\n,,\n# note\n3,,\"B, C\"\n");
        assert_eq!(names, ["time", "flux", "quality"]);
        assert_eq!(Row { line: 1, cells: vec!["1"] }.cell(2), "");
        assert_eq!(rows, [(2, vec!["1", "2", "G"]), (3, vec!["", ""]), (5, vec!["3", "", "B, C"])]);
    }

    #[test]
    fn a_table_may_have_no_names() {
        assert_eq!(read("1 2 3\n4 5 6\n"), (vec![], vec![(1, vec!["1", "2", "3"]), (2, vec!["4", "5", "6"])]));
        assert_eq!(read("").1.len(), 0);
    }
}
