//! One page of what a folder holds: star and data, the verdict in plain words and what speaks against it, tables,
//! figures, the config and how to cite. A single HTML file that needs nothing else: no network, no script, figures as
//! SVG within it.

mod chapter;
mod chapters;
mod citation;
mod html;
mod injection;
mod maps;
mod planned;
mod run;
mod subject;
mod verdicts;

use crate::figures::plot::{self, PlotError};
use crate::numerics::text::escaped;
use html::Page;
use std::io::Read as _;
use std::path::Path;

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
