//! A first config with the sources of its values, and their table.

use super::known::Given;
use super::ledger::{Entry, Source};
use super::light::LightCurve;
use crate::data::config::{Draft, IndicatorSection};
use crate::data::dataset::SceneError;
use crate::numerics::text::{Align, columns};
use crate::surface::calibration::first_look::LookError;
use std::path::{Path, PathBuf};

/// Paths of inputs and outputs.
#[derive(Clone, Debug)]
pub struct Place<'a> {
    /// The config that will be written.
    pub config: &'a Path,
    /// The lists of profiles, one at least.
    pub lists: Vec<List<'a>>,
    /// Light curves beside them.
    pub light_curves: Vec<LightCurve>,
    /// Activity indicators, their tables relative to the config's folder.
    pub indicators: Vec<IndicatorSection>,
    /// The JSON Schema as the config names it.
    pub schema: Option<String>,
}

/// A list of profiles.
#[derive(Clone, Debug)]
pub struct List<'a> {
    /// The list.
    pub list: &'a Path,
    /// Its content, which need not have been written.
    pub list_bytes: &'a [u8],
    /// The list as the config names it, relative to the config's folder.
    pub list_in_config: PathBuf,
    /// Its name, where it is one of several.
    pub name: Option<String>,
    /// Resolving power of its spectrograph, where it differs from that of the first.
    pub resolving_power: Option<Given<f64>>,
    /// Wavelength (nm) of its profiles, where it differs from that of the first.
    pub wavelength_nm: Option<Given<f64>>,
}

impl Place<'_> {
    /// The list to name in errors that concern all.
    pub(super) fn first_list(&self) -> &Path {
        self.lists[0].list
    }
}

/// A config and the sources of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The config, as text.
    pub json: String,
    /// What was observed, in a line.
    pub observed: String,
    /// All relevant values with their sources.
    pub entries: Vec<Entry>,
    /// The result of the test, and suspicious values.
    pub notes: Vec<String>,
    /// Whether a map can be made from the config without changes.
    pub complete: bool,
}

/// Why there is no proposal: one line that names the file at fault.
#[derive(Debug, thiserror::Error)]
pub enum ProposalError {
    /// The list or a profile, or a given value that is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The profiles show no star.
    #[error("{}: {error}", .list.display())]
    Look {
        /// The list of profiles.
        list: PathBuf,
        /// What is wrong with them.
        error: LookError,
    },
    /// The model is inconsistent with the profiles.
    #[error("{}: no map fits unless the errors are {factor:.1} times as large: {reason}", .list.display())]
    OutOfReach {
        /// The list of profiles.
        list: PathBuf,
        /// Factor on the uncertainties from the continuum at which a map would fit.
        factor: f64,
        /// The likely reason, from tests.
        reason: String,
    },
    /// Uncertainties that are variances, and no continuum to scale them by.
    #[error("{}: {text}", .list.display())]
    Variances {
        /// The list of profiles.
        list: PathBuf,
        /// Their description.
        text: String,
    },
    /// No map can be made of the profiles with these values.
    #[error("{}: `map` would find no maps of these profiles{status}: {reason}", .list.display())]
    NoMaps {
        /// The list of profiles.
        list: PathBuf,
        /// How the reconstruction ended, in parentheses.
        status: String,
        /// The likely reason.
        reason: String,
    },
    /// A path that JSON cannot hold.
    #[error("{}: the path of the observations cannot be written in JSON: {problem}", .config.display())]
    Path {
        /// The config.
        config: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl Proposal {
    /// What was observed and every value by its source, aligned; then the notes.
    pub fn table(&self) -> String {
        let shown = |source: Source| self.entries.iter().filter(move |entry| entry.source == source);
        let mut ordered: Vec<&Entry> = Source::ALL.into_iter().flat_map(shown).collect();
        ordered.sort_by_key(|entry| (entry.source as usize, entry.section()));
        let cells =
            |entry: &&Entry| vec![entry.key.clone(), entry.value.clone(), entry.unit.into(), entry.remark.clone()];
        let rows: Vec<Vec<String>> = ordered.iter().map(cells).collect();
        let table = columns(&rows, &[Align::Left, Align::Right, Align::Left, Align::Left]);
        let mut text = format!("{}\n", self.observed);
        let mut last = None;
        for (entry, line) in ordered.iter().zip(table.lines()) {
            if last.replace(entry.source) != Some(entry.source) {
                text += &format!("\n{}\n", entry.source.title());
            }
            text += &format!("  {line}\n");
        }
        if !self.notes.is_empty() {
            text.push('\n');
        }
        for note in &self.notes {
            text += &format!("note: {note}\n");
        }
        text
    }
}

/// The config as text.
pub(super) fn to_json(draft: &Draft, config: &Path) -> Result<String, ProposalError> {
    draft.to_json().map_err(|e| ProposalError::Path { config: config.into(), problem: e.to_string() })
}
