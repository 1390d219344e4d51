//! The cells of a line.

use super::number::has_decimal_comma;

/// What separates the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Separator {
    /// Blanks and tabs, as many as there are.
    Blanks,
    /// One tab: cells may be empty or contain blanks.
    Tab,
    /// A comma.
    Comma,
    /// A semicolon.
    Semicolon,
}

impl Separator {
    /// The separator of rows, from the first of them; `names` is the line of names above them, if there is one. Tabs
    /// count as blanks where all lines then have equal numbers of cells.
    pub fn of<'a>(names: Option<&str>, mut rows: impl Iterator<Item = &'a str> + Clone) -> Self {
        let first = rows.clone().next().unwrap_or_default();
        if first.contains(';') {
            return Separator::Semicolon;
        }
        let by_blanks = Separator::Blanks.cells(first);
        if first.contains(',') {
            let decimal = by_blanks.len() > 1 && by_blanks.iter().any(|cell| has_decimal_comma(cell));
            return if decimal { Separator::Blanks } else { Separator::Comma };
        }
        let even = |line: &str| Separator::Blanks.cells(line).len() == by_blanks.len();
        let by_tabs = |line: &str| Separator::Tab.cells(line).len();
        // a title is not a line of names
        let is_of_tabs = |names: &str| !even(names) && by_tabs(names) == by_tabs(first);
        match first.contains('\t') && (!rows.all(even) || names.is_some_and(is_of_tabs)) {
            true => Separator::Tab,
            false => Separator::Blanks,
        }
    }

    /// The cells of a line, without the quotes around them; one separator at the end is allowed, and in lines separated
    /// by blanks a `#` starts a comment.
    pub fn cells(self, line: &str) -> Vec<&str> {
        let mark = match self {
            Separator::Blanks => return words(line),
            Separator::Tab => '\t',
            Separator::Comma => ',',
            Separator::Semicolon => ';',
        };
        let line = line.trim_matches(|c: char| c.is_whitespace() && c != mark);
        let mut cells: Vec<&str> = parts(line, mark).map(unquoted).collect();
        if cells.len() > 1 && cells.last() == Some(&"") {
            cells.pop();
        }
        cells
    }
}

const QUOTES: [char; 2] = ['"', '\''];

/// A line split at separators outside of double quotes.
fn parts(line: &str, mark: char) -> impl Iterator<Item = &str> {
    let mut within = false;
    line.split(move |c: char| {
        within ^= c == '"';
        c == mark && !within
    })
}

fn unquoted(cell: &str) -> &str {
    let cell = cell.trim();
    let within = |quote: char| cell.strip_prefix(quote)?.strip_suffix(quote);
    QUOTES.into_iter().find_map(within).map_or(cell, str::trim)
}

/// The words of a line up to a comment; one in quotes may hold blanks.
fn words(line: &str) -> Vec<&str> {
    let (mut words, mut rest) = (Vec::new(), line.trim_start());
    while let Some(first) = rest.chars().next().filter(|c| *c != '#') {
        let quoted = QUOTES.contains(&first).then(|| rest[1..].split_once(first)).flatten();
        // a quote within a word closes nothing
        let quoted = quoted.filter(|(_, after)| after.is_empty() || after.starts_with(char::is_whitespace));
        let (word, after) =
            quoted.unwrap_or_else(|| rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())));
        words.push(word);
        rest = after.trim_start();
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_hold_blanks_and_separators() {
        assert_eq!(Separator::Blanks.cells("\"LO Peg/a.prof\" 1.5\t'b c' # d"), ["LO Peg/a.prof", "1.5", "b c"]);
        assert_eq!(Separator::Blanks.cells("it's 2\" 3"), ["it's", "2\"", "3"]);
        assert_eq!(Separator::Comma.cells("\"a, b\", 2 ,,"), ["a, b", "2", ""]);
        assert_eq!(Separator::Semicolon.cells(" 'x';1;"), ["x", "1"]);
    }

    #[test]
    fn rows_say_what_separates_them() {
        let of = |names: Option<&str>, rows: &[&str]| Separator::of(names, rows.iter().copied());
        assert_eq!(of(None, &["1,2,3"]), Separator::Comma);
        assert_eq!(of(None, &["1,5;2,5"]), Separator::Semicolon);
        assert_eq!(of(None, &["-50,4 0,99 0,001"]), Separator::Blanks);
        assert_eq!(of(None, &["-50,4\t0,99"]), Separator::Blanks);
        assert_eq!(of(None, &["1, 2, 3"]), Separator::Comma);
        assert_eq!(of(Some("v\tI"), &["1\t\t2", "3\t4"]), Separator::Blanks);
        assert_eq!(of(Some("v (km/s)\tI"), &["1\t2"]), Separator::Tab);
        assert_eq!(of(None, &["1\t2\t3", "1\t\t3"]), Separator::Tab);
        assert_eq!(of(Some("a title"), &["1\t\t2\t3"]), Separator::Blanks);
    }
}
