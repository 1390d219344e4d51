//! One page of what a folder holds: star and data, the verdict in plain words and what speaks against it, tables,
//! figures, the config and how to cite. A single HTML file that needs nothing else: no network, no script, figures as
//! SVG within it.

mod chapters;
mod citation;
mod html;
mod injection;
mod maps;
mod planned;
mod run;
mod subject;
mod verdicts;

use crate::figures::drawing::Figure;
use crate::figures::plot::{self, PlotError};
use crate::numerics::text::escaped;
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

impl Table {
    /// The same without columns that say nothing in any row.
    fn without_empty_columns(&self) -> Table {
        let says = |k: &usize| self.rows.iter().any(|row| row.get(*k).is_some_and(|cell| !is_empty(cell)));
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let kept: Vec<usize> = (0..columns).filter(says).collect();
        let of = |row: &Vec<String>| kept.iter().filter_map(|k| row.get(*k).cloned()).collect::<Vec<_>>();
        Table { head: of(&self.head), rows: self.rows.iter().map(of).collect() }
    }
}

/// What stands in a cell for which there is no number.
const NOTHING: &str = "–";

fn is_empty(cell: &str) -> bool {
    cell.is_empty() || cell == NOTHING
}

/// How a sentence is meant, for the colour that it has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// It can be relied on.
    Good,
    /// It is neither good nor bad.
    #[default]
    Neutral,
    /// It is to be doubted.
    Doubt,
}

/// What is said of one kind of result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chapter {
    /// Its heading.
    pub heading: String,
    /// What it comes to, a sentence each, the one that heads the result first.
    pub verdicts: Vec<(Tone, String)>,
    /// What speaks against it, or must be known beside it.
    pub warnings: Vec<String>,
    /// What helps to read it.
    pub notes: Vec<String>,
    /// Tables, each with a line above it.
    pub tables: Vec<(String, Table)>,
}

impl Chapter {
    /// The verdicts with the tones that they are shown in: nothing is good beside a warning.
    pub fn shown_verdicts(&self) -> impl Iterator<Item = (Tone, &str)> {
        let doubted = !self.warnings.is_empty() || self.verdicts.iter().any(|(tone, _)| *tone == Tone::Doubt);
        self.verdicts.iter().map(move |(tone, sentence)| match tone {
            Tone::Good if doubted => (Tone::Neutral, sentence.as_str()),
            tone => (*tone, sentence.as_str()),
        })
    }
}

/// The page.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// Name of the folder.
    pub title: String,
    /// Star and data, label and text a line.
    pub subject: Vec<(String, String)>,
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
    let title = title(folder);
    let mut page =
        Page { title, subject: Vec::new(), chapters: Vec::new(), figures, config: None, provenance: Vec::new() };
    for file in plot::kinds(folder) {
        page.chapters.push(chapters::of(folder, file)?);
        let about = subject::About::read(folder, file)?;
        if page.subject.is_empty() {
            page.subject = subject::lines(folder, &page.title, &about);
        }
        if page.provenance.is_empty() {
            page.provenance = about.provenance();
        }
        page.config = page.config.or(about.config);
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
