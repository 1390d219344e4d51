//! Values with their sources.

use super::known::Given;

/// Where a value came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The profiles.
    Data,
    /// The user, or the file that is imported.
    Given,
    /// Nobody: to be checked.
    Assumed,
    /// Nobody, and nothing can be assumed: to be filled in.
    Missing,
}

impl Source {
    pub(super) const ALL: [Source; 4] = [Source::Data, Source::Given, Source::Assumed, Source::Missing];

    pub(super) fn title(self) -> &'static str {
        match self {
            Source::Data => "from the profiles",
            Source::Given => "given",
            Source::Assumed => "assumed, please check",
            Source::Missing => "still to be given",
        }
    }
}

/// A key of the config with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The key with its parents, dotted.
    pub key: &'static str,
    /// The value as text.
    pub value: String,
    /// Its unit; empty for none.
    pub unit: &'static str,
    /// Where it came from.
    pub source: Source,
    /// How good it is, or how to give another.
    pub remark: String,
}

impl Entry {
    /// Where its section stands in a config.
    pub(super) fn section(&self) -> usize {
        const SECTIONS: [&str; 6] = ["star", "instrument", "planet", "observations", "imaging", "parameters"];
        let section = self.key.split('.').next();
        SECTIONS.iter().position(|name| section == Some(name)).unwrap_or(SECTIONS.len())
    }
}

/// The entries so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Ledger {
    pub entries: Vec<Entry>,
}

impl Ledger {
    pub fn note(
        &mut self,
        key: &'static str,
        value: impl ToString,
        unit: &'static str,
        source: Source,
        remark: impl Into<String>,
    ) {
        self.entries.push(Entry { key, value: value.to_string(), unit, source, remark: remark.into() });
    }

    /// The given value, or another one with its source and remark; noted either way.
    pub fn settle<T: ToString + Clone>(
        &mut self,
        (key, unit): (&'static str, &'static str),
        given: &Option<Given<T>>,
        otherwise: (T, Source, &str),
    ) -> T {
        let (value, source, remark) = match given {
            Some(given) => (given.value.clone(), Source::Given, given.by.as_str()),
            None => otherwise,
        };
        self.note(key, value.to_string(), unit, source, remark);
        value
    }

    /// Another value, from the data, for a key that is there.
    pub fn replace(&mut self, key: &str, value: impl ToString, remark: &str) {
        for entry in self.entries.iter_mut().filter(|entry| entry.key == key) {
            entry.value = value.to_string();
            entry.source = Source::Data;
            entry.remark = remark.to_owned();
        }
    }
}

/// Whether a value was given, or where it came from otherwise.
pub(super) fn origin<T>(given: &Option<Given<T>>, otherwise: &str) -> (Source, String) {
    match given {
        Some(given) => (Source::Given, given.by.clone()),
        None => (Source::Data, otherwise.to_owned()),
    }
}
