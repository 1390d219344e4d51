//! One page of what a folder holds: tables, the verdict in plain words, notes, figures, the config and how to cite. A single
//! HTML file that needs nothing else: no network, no script, figures as SVG within it.
//!
//! Left out: figures (`plot`), and how the page looks (`html`).

mod chapters;
mod citation;
mod html;
mod injection;
mod run;

use crate::figure::Figure;
use crate::plot::{self, PlotError};
use crate::text::escaped;
use serde_json::Value;
use std::io::Read as _;
use std::path::Path;

/// A table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Names of the columns.
    pub head: Vec<String>,
    /// The rows, as long as the head.
    pub rows: Vec<Vec<String>>,
}

/// What is said of one kind of result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chapter {
    /// Its heading.
    pub heading: String,
    /// Whether it can be trusted, and a sentence that says so.
    pub verdict: Option<(bool, String)>,
    /// Tables, each with a line above it.
    pub tables: Vec<(String, Table)>,
    /// What to bear in mind.
    pub notes: Vec<String>,
}

/// The page.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// Name of the folder.
    pub title: String,
    /// What the folder holds, kind by kind.
    pub chapters: Vec<Chapter>,
    /// All figures.
    pub figures: Vec<Figure>,
    /// The config with all defaults filled in, where a file has it.
    pub config: Option<Value>,
    /// Version of the program and fingerprint of the data, where a file has them.
    pub provenance: Vec<(String, String)>,
}

/// The page of what `folder` holds, as HTML.
///
/// # Errors
/// [`PlotError`]: a folder that is not there or holds nothing that is known, files that are wrong.
pub fn report(folder: &Path) -> Result<String, PlotError> {
    let figures = plot::figures(folder, None)?;
    let mut page = Page { title: title(folder), chapters: Vec::new(), figures, config: None, provenance: Vec::new() };
    for file in plot::kinds(folder) {
        let (chapter, whole) = chapters::of(folder, file)?;
        page.chapters.push(chapter);
        page.config = page.config.or_else(|| whole.get("config").cloned());
        if page.provenance.is_empty() {
            page.provenance = provenance(&whole);
        }
    }
    Ok(html::page(&page))
}

/// Whether the file begins as a page does.
pub fn is_page(file: &Path) -> bool {
    let mut beginning = vec![0; html::BEGINNING.len()];
    let read = std::fs::File::open(file).and_then(|mut file| file.read_exact(&mut beginning));
    read.is_ok() && beginning == html::BEGINNING.as_bytes()
}

/// The folder's own name.
fn title(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    escaped(&whole.file_name().unwrap_or(folder.as_os_str()).to_string_lossy()).into_owned()
}

fn provenance(file: &Value) -> Vec<(String, String)> {
    let entries = [("version", "dimcmc"), ("data_sha256", "SHA-256 of the observations")];
    let text = |(key, label): (&str, &str)| Some((label.to_owned(), file.get(key)?.as_str()?.to_owned()));
    entries.into_iter().filter_map(text).collect()
}
