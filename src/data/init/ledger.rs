//! Values with their sources.

use super::known::Given;

/// The source of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The profiles.
    Data,
    /// The user, or the file that is imported.
    Given,
    /// Assumed: to be checked.
    Assumed,
    /// Unknown and without a default: to be filled in.
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
    pub key: String,
    /// The value as text.
    pub value: String,
    /// Its unit; empty for none.
    pub unit: &'static str,
    /// Its source.
    pub source: Source,
    /// Its quality, or how to change it.
    pub remark: String,
}

impl Entry {
    /// The order of its section in a config.
    pub(super) fn section(&self) -> usize {
        const SECTIONS: [&str; 7] =
            ["star", "instrument", "planet", "observations", "photometry", "imaging", "parameters"];
        let section = self.key.split(['.', '[']).next();
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
        key: impl Into<String>,
        value: impl ToString,
        unit: &'static str,
        source: Source,
        remark: impl Into<String>,
    ) {
        self.entries.push(Entry { key: key.into(), value: value.to_string(), unit, source, remark: remark.into() });
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

    /// Copies the entries of `other` on data set `s`, of several.
    pub fn take_set(&mut self, other: &Ledger, s: usize) {
        let own = |entry: &Entry| {
            let key = of_set(&entry.key, s)?;
            Some(Entry { key, ..entry.clone() })
        };
        self.entries.extend(other.entries.iter().filter_map(own));
    }

    /// The same for the first data set, with all its entries on the star.
    pub fn take_first(&mut self, other: Ledger) {
        let own = |entry: Entry| Entry {
            key: of_set(&entry.key, 0).filter(|_| entry.key != INSTRUMENT).unwrap_or(entry.key),
            ..entry
        };
        self.entries.extend(other.entries.into_iter().map(own));
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

/// The key of the resolving power, which is that of the first data set.
const INSTRUMENT: &str = "instrument.resolving_power";

/// A key of the config as that of data set `s` of several; `None` for common keys.
fn of_set(key: &str, s: usize) -> Option<String> {
    let own = match key {
        INSTRUMENT => "resolving_power",
        _ => key.strip_prefix("observations.").or_else(|| key.strip_prefix("imaging."))?,
    };
    let is_own = key.starts_with("observations.") || own.starts_with("nuisances.") || own == "resolving_power";
    (is_own && own != "velocity_jitter_kms").then(|| format!("observations[{s}].{own}"))
}

/// The given source of a value, or its source otherwise.
pub(super) fn origin<T>(given: &Option<Given<T>>, otherwise: &str) -> (Source, String) {
    match given {
        Some(given) => (Source::Given, given.by.clone()),
        None => (Source::Data, otherwise.to_owned()),
    }
}
