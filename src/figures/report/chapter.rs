//! The text on one kind of result: sentences and tables.

use crate::figures::plot::symbols::label;
use crate::model::{Parameter, ParameterValues};

/// A table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub head: Vec<String>,
    /// The rows, with as many cells as the head.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// The same without columns that are empty in all rows.
    pub fn without_empty_columns(&self) -> Table {
        let says = |k: &usize| self.rows.iter().any(|row| row.get(*k).is_some_and(|cell| !is_empty(cell)));
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let kept: Vec<usize> = (0..columns).filter(says).collect();
        let of = |row: &Vec<String>| kept.iter().filter_map(|k| row.get(*k).cloned()).collect::<Vec<_>>();
        Table { head: of(&self.head), rows: self.rows.iter().map(of).collect() }
    }
}

/// The text of a cell without a number.
pub(super) const NOTHING: &str = "–";

fn is_empty(cell: &str) -> bool {
    cell.is_empty() || cell == NOTHING
}

/// The meaning of a sentence, for its colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// Reliable.
    Good,
    /// Neutral.
    #[default]
    Neutral,
    /// Doubtful.
    Doubt,
}

/// The text on one kind of result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chapter {
    /// Its heading.
    pub heading: String,
    /// Its conclusions, one sentence each, the main one first.
    pub verdicts: Vec<(Tone, String)>,
    /// Caveats and warnings.
    pub warnings: Vec<String>,
    /// Notes for reading it.
    pub notes: Vec<String>,
    /// Tables, each with a caption.
    pub tables: Vec<(String, Table)>,
    /// Tables on the performance of a sampler, which are folded.
    pub diagnostics: Vec<(String, Table)>,
}

impl Chapter {
    /// The verdicts with their displayed tones: none is good in the presence of a warning.
    pub fn shown_verdicts(&self) -> impl Iterator<Item = (Tone, &str)> {
        let doubted = !self.warnings.is_empty() || self.verdicts.iter().any(|(tone, _)| *tone == Tone::Doubt);
        self.verdicts.iter().map(move |(tone, sentence)| match tone {
            Tone::Good if doubted => (Tone::Neutral, sentence.as_str()),
            tone => (*tone, sentence.as_str()),
        })
    }
}

/// A number with so many decimals; a dash where there is none.
pub(super) fn number(value: impl Into<Option<f64>>, digits: usize) -> String {
    value.into().filter(|x| x.is_finite()).map_or_else(|| NOTHING.into(), |x| format!("{x:.digits$}"))
}

/// A table of names and values, without empty values.
pub(super) fn pairs(rows: &[(&str, String)]) -> Table {
    let told = rows.iter().filter(|(_, value)| !is_empty(value));
    Table { head: Vec::new(), rows: told.map(|(name, value)| vec![(*name).to_owned(), value.clone()]).collect() }
}

/// A table with these names of the columns.
pub(super) fn table(head: &[&str], rows: Vec<Vec<String>>) -> Table {
    Table { head: head.iter().map(|text| (*text).to_owned()).collect(), rows }
}

/// The tone of a sentence, good or doubtful.
pub(super) fn tone(good: bool) -> Tone {
    if good { Tone::Good } else { Tone::Doubt }
}

/// The given parameters, and the injected ones if they are known.
pub(super) fn parameters(
    values: &ParameterValues,
    truth: Option<&ParameterValues>,
    is_shown: impl Fn(&Parameter) -> bool,
) -> Table {
    let row = |parameter: Parameter| {
        let mut row = vec![label(parameter.name()), number(values.get(parameter)?, 4)];
        row.extend(truth.map(|truth| number(truth.get(parameter), 4)));
        Some(row)
    };
    let head: &[&str] = if truth.is_some() { &["parameter", "value", "injected"] } else { &["parameter", "value"] };
    table(head, Parameter::ALL.into_iter().filter(is_shown).filter_map(row).collect())
}
