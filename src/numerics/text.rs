//! Tables as text, and untrusted text in one line.

use std::borrow::Cow;
use std::path::Path;

/// Untrusted text, such as a file's name, with control characters as escapes (`\n`, `\u{1b}`): it can neither break a
/// line nor command a terminal.
pub fn escaped(text: &str) -> Cow<'_, str> {
    if !text.contains(char::is_control) {
        return Cow::Borrowed(text);
    }
    let escape = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(escape).collect())
}

/// A path for display.
pub fn shown(path: &Path) -> String {
    escaped(&path.to_string_lossy()).into_owned()
}

/// Characters of a line that is printed.
pub const WIDTH: usize = 120;

/// A line, broken between words where it is longer than [`WIDTH`]: prose goes on two characters further in, and the
/// last column of a table below itself. A table whose last column begins beyond two thirds of the line stays whole.
fn wrapped(line: &str) -> Cow<'_, str> {
    if line.chars().count() <= WIDTH {
        return Cow::Borrowed(line);
    }
    let indent = line.len() - line.trim_start().len();
    let last = line.rfind("  ").map_or(0, |at| at + 2);
    let (begin, within) = if last > indent { (last, line[..last].chars().count()) } else { (indent, indent + 2) };
    if 3 * within > 2 * WIDTH {
        return Cow::Borrowed(line);
    }
    let (mut text, mut length) = (line[..begin].to_owned(), line[..begin].chars().count());
    for (k, word) in line[begin..].split(' ').enumerate() {
        let more = word.chars().count() + usize::from(k > 0);
        if k > 0 && length + more > WIDTH {
            text += "\n";
            text += &" ".repeat(within);
            length = within + more - 1;
        } else {
            text += if k > 0 { " " } else { "" };
            length += more;
        }
        text += word;
    }
    Cow::Owned(text)
}

/// What is printed of `text`: control characters escaped and long lines broken, but for names of files after
/// `written: `, which scripts read.
pub fn broken(text: &str) -> String {
    let line = |line: &str| match escaped(line) {
        line if line.starts_with("written: ") => line.into_owned(),
        line => wrapped(&line).into_owned(),
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// The plural of an English noun, after it: "s" unless there is one.
pub fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

/// Numbers by name to six digits, each after a comma.
pub fn listed<'a>(numbers: impl IntoIterator<Item = (&'a String, &'a f64)>) -> String {
    let one = |(name, value): (&String, &f64)| {
        let decimals = (5.0 - value.abs().max(1e-6).log10().floor()).clamp(0.0, 12.0) as usize;
        format!(", {name} {value:.decimals$}")
    };
    numbers.into_iter().map(one).collect()
}

/// Alignment of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// To the left.
    Left,
    /// To the right.
    Right,
}

/// Columns under each other: the first to the left, the others to the right. Rows are as long as the first one.
pub fn aligned(rows: &[Vec<String>]) -> String {
    let mut aligns = vec![Align::Right; rows.first().map_or(0, Vec::len)];
    if let Some(first) = aligns.first_mut() {
        *first = Align::Left;
    }
    columns(rows, &aligns)
}

/// Columns under each other, each set according to `aligns`; rows have equally many. Lines have no trailing blanks.
pub fn columns(rows: &[Vec<String>], aligns: &[Align]) -> String {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..aligns.len()).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).zip(aligns).map(|((cell, width), align)| match align {
            Align::Left => format!("{cell:<width$}"),
            Align::Right => format!("{cell:>width$}"),
        });
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

#[test]
fn numbers_have_six_digits() {
    let names = ["spottedness", "chi2", "log_evidence"].map(str::to_owned);
    let text = listed(names.iter().zip(&[0.0593004, 2764.5, -1.25e5]));
    assert_eq!(text, ", spottedness 0.0593004, chi2 2764.50, log_evidence -125000");
}

#[test]
fn long_lines_are_broken_between_words() {
    let short = "a ".repeat(60);
    assert!(matches!(wrapped(&short), Cow::Borrowed(_)));
    let prose = format!("note: {}end", "word ".repeat(50));
    let lines: Vec<String> = wrapped(&prose).split('\n').map(str::to_owned).collect();
    assert!(lines.iter().all(|line| line.chars().count() <= WIDTH), "{lines:?}");
    assert!(lines[1..].iter().all(|line| line.starts_with("  word")), "{lines:?}");
    assert_eq!(lines.iter().map(|line| line.trim_start()).collect::<Vec<_>>().join(" "), prose);
    let table = format!("star.vsini_kms  30.5  {}", "measured here ".repeat(12));
    let lines = wrapped(&table).into_owned();
    assert!(lines.lines().skip(1).all(|line| line.starts_with(&" ".repeat(22))), "{lines}");
    let wide = format!("{}{}", "1.234  ".repeat(20), "a b");
    assert_eq!(wrapped(&wide), wide);
}

#[test]
fn names_stay_in_their_line() {
    assert_eq!(escaped("a\nb\u{1b}[31m\u{9b}c\td\u{7f}"), "a\\nb\\u{1b}[31m\\u{9b}c\\td\\u{7f}");
    assert!(matches!(escaped("K \u{2212} \u{b1} \\ \"quoted\" 'one'"), Cow::Borrowed(_)));
}
