//! The names of the columns of a table, with their units.

use super::cells::Separator;
use super::number::{is_dashes, number};
use std::ops::RangeInclusive;

/// The name of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Name {
    /// As written.
    pub written: String,
    /// Lower case, letters, digits and `/` alone, without the unit: the key for synonyms.
    pub bare: String,
    /// The unit in brackets after it or in the line below, bare as well; empty where there is none.
    pub unit: String,
}

impl Name {
    fn of(written: &str) -> Self {
        let (name, unit) = match written.split_once(['(', '[', '{']) {
            // a name that is all in brackets is a name
            Some((name, unit)) if !bare(name).is_empty() => (name, unit),
            _ => (written, ""),
        };
        Name { written: written.trim().to_owned(), bare: bare(name), unit: bare(unit) }
    }
}

/// Letters, digits and `/` of a text, lower case.
pub fn bare(text: &str) -> String {
    text.chars().filter(|c| c.is_alphanumeric() || *c == '/').flat_map(char::to_lowercase).collect()
}

/// Possible readings of a text line as the names of this many columns, the plain ones first: words by any separator,
/// words with units in brackets after them, or words separated by two blanks.
pub fn readings(line: &str, columns: usize) -> Vec<Vec<Name>> {
    all_readings(line, columns..=columns)
}

/// The same of any number of columns in a range, fewer first.
pub fn all_readings(line: &str, columns: RangeInclusive<usize>) -> Vec<Vec<Name>> {
    let split = |separator: Separator| separator.cells(line).into_iter().map(str::to_owned).collect();
    let [blanks, tab, comma, semicolon]: [Vec<String>; 4] =
        [Separator::Blanks, Separator::Tab, Separator::Comma, Separator::Semicolon].map(split);
    let wide =
        line.trim().replace('\t', "  ").split("  ").filter(|part| !part.trim().is_empty()).map(str::to_owned).collect();
    let with_units = with_units(&blanks);
    let mut all: Vec<Vec<Name>> = Vec::new();
    for words in [blanks, tab, comma, semicolon, with_units, wide] {
        let names: Vec<Name> = words.iter().map(|word| Name::of(word)).collect();
        if columns.contains(&names.len()) && !all.contains(&names) {
            all.push(names);
        }
    }
    all.sort_by_key(Vec::len);
    all
}

/// Words, brackets being part of the word before them.
fn with_units(words: &[String]) -> Vec<String> {
    let (mut joined, mut depth): (Vec<String>, i32) = (Vec::new(), 0);
    for word in words {
        match joined.last_mut().filter(|_| depth > 0 || word.starts_with(['(', '[', '{'])) {
            Some(before) => before.extend([" ", word]),
            None => joined.push(word.clone()),
        }
        depth += word.chars().map(|c| i32::from("([{".contains(c)) - i32::from(")]}".contains(c))).sum::<i32>();
    }
    joined
}

/// Whether the cells of a line below the names describe columns (dashes, units, types) and are not data.
pub fn is_below_names(cells: &[&str]) -> bool {
    let is_value = |cell: &&str| !is_dashes(cell) && !cell.is_empty() && number(cell).is_ok();
    !cells.is_empty() && !cells.iter().any(is_value)
}

/// Gives the units of a line below the names to those that have none.
pub fn add_units(names: &mut [Name], cells: &[&str]) {
    for (name, cell) in names.iter_mut().zip(cells).filter(|(name, _)| name.unit.is_empty()) {
        name.unit = bare(cell);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bares(line: &str, columns: usize) -> Vec<Vec<(String, String)>> {
        let pairs = |names: Vec<Name>| names.into_iter().map(|name| (name.bare, name.unit)).collect();
        readings(line, columns).into_iter().map(pairs).collect()
    }

    #[test]
    fn units_belong_to_names() {
        let due = [("velocity", "km/s"), ("i/ic", ""), ("sigma", "")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        for line in [
            "velocity (km/s)  I/Ic  sigma",
            "Velocity [km / s] I/Ic sigma",
            "velocity(km/s),I/Ic,sigma",
            "velocity (km/s)\tI/Ic\tsigma",
            "velocity (km/s); I/Ic; sigma;",
        ] {
            assert_eq!(bares(line, 3)[0], due, "{line:?}");
        }
        assert_eq!(bares("radial velocity  Stokes I  sigma I", 3)[0][1].0, "stokesi");
        assert!(readings("a title of five words", 3).is_empty());
    }

    #[test]
    fn rules_and_units_below_are_no_rows() {
        assert!(is_below_names(&["----", "---", "-----"]));
        assert!(is_below_names(&["km/s", "", "-"]));
        assert!(is_below_names(&["10N", "10N"]));
        assert!(!is_below_names(&["-50.4", "0.99", "x"]));
        let mut names = readings("v I s", 3).remove(0);
        add_units(&mut names, &["m/s", "", "-"]);
        assert_eq!(names.iter().map(|name| name.unit.as_str()).collect::<Vec<_>>(), ["m/s", "", ""]);
    }
}
