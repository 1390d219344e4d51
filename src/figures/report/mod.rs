//! One page per star: the verdict with its caveats, then velocities, dynamic spectra, maps, periodogram, posterior and
//! limits, if folders contain them; the assumptions, and the citation. A self-contained HTML file: no network, figures
//! as SVG within it, and a script that rotates the star if there is a map.

mod assumed;
mod chapter;
mod chapters;
mod citation;
mod html;
mod injection;
mod maps;
mod planned;
mod run;
mod section;
mod subject;
mod verdicts;

use crate::figures::drawing::Figure;
use crate::figures::plot::{self, PlotError};
use crate::numerics::text::escaped;
use crate::runs::maps::AS_ORBIT;
use chapter::{Chapter, Table};
use html::{Page, Statement};
use section::Kind;
use serde_json::Value;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use subject::About;

/// The content of one folder.
struct Part<'a> {
    folder: &'a Path,
    /// The name of the folder.
    title: String,
    chapters: Vec<(Kind, Chapter)>,
    abouts: Vec<About>,
    figures: Vec<Figure>,
}

impl<'a> Part<'a> {
    fn read(folder: &'a Path) -> Result<Self, PlotError> {
        let figures = plot::figures(folder, None)?;
        let (mut read, mut abouts) = (Vec::new(), Vec::new());
        for file in plot::kinds(folder) {
            read.push((Kind::of_file(file), chapters::of(folder, file)?));
            abouts.push(About::read(folder, file)?);
        }
        Ok(Part { folder, title: title(folder), chapters: read, abouts, figures })
    }

    fn config(&self) -> Option<&Value> {
        self.abouts.iter().find_map(|about| about.config.as_ref())
    }

    /// The name of the star in the config.
    fn star_name(&self) -> Option<&str> {
        subject::given_name(self.config()?)
    }

    fn data(&self) -> Option<&str> {
        self.abouts.iter().find_map(|about| about.data_sha256.as_deref())
    }
}

/// The page of a star from the results in `folders`, as HTML.
///
/// # Errors
/// [`PlotError`]: a folder that does not exist or has no known results, files that are wrong, folders of different
/// stars.
pub fn report(folders: &[PathBuf]) -> Result<String, PlotError> {
    let parts = folders.iter().map(|folder| Part::read(folder)).collect::<Result<Vec<Part>, PlotError>>()?;
    for (k, part) in parts.iter().enumerate() {
        parts[..k].iter().try_for_each(|before| same_star(before, part))?;
    }
    let turning = folders.iter().find_map(|folder| plot::turning(folder).transpose()).transpose()?;
    Ok(html::page(&page(parts, turning)))
}

/// Refuses two folders of different stars, and a folder given twice.
fn same_star(first: &Part, other: &Part) -> Result<(), PlotError> {
    let refuse = |problem: String| Err(PlotError::Content { path: other.folder.to_owned(), problem });
    let folder = first.folder.display();
    let whole = |part: &Part| part.folder.canonicalize().unwrap_or_else(|_| part.folder.to_owned());
    if whole(first) == whole(other) {
        return refuse("is given twice".into());
    }
    match ((first.star_name(), other.star_name()), (first.data(), other.data())) {
        ((Some(a), Some(b)), _) if a == b => Ok(()),
        ((Some(a), Some(b)), _) => refuse(format!("is of another star ({b}) than {folder} ({a})")),
        (_, (Some(a), Some(b))) if a != b => refuse(format!(
            "is of other observations than {folder}; if they are of one star, give both configs the same star.name"
        )),
        _ => Ok(()),
    }
}

/// Warnings on the results, except for a planet signal in maps that a search has explained.
fn warnings(parts: &[Part]) -> Vec<String> {
    let chapters = || parts.iter().flat_map(|part| &part.chapters);
    let is_searched = chapters().any(|(kind, _)| *kind == Kind::Periodogram);
    let is_open = |warning: &&String| !(is_searched && warning.starts_with(AS_ORBIT));
    unique(chapters().flat_map(|(_, chapter)| &chapter.warnings).filter(is_open).cloned())
}

/// The content of the page, from the parts of one star.
fn page(parts: Vec<Part>, turning: Option<Value>) -> Page {
    let config = parts.iter().find_map(Part::config).cloned();
    let named = parts.iter().find_map(Part::star_name).map(str::to_owned);
    let title = named.unwrap_or_else(|| match &config {
        Some(config) => subject::name_from_folders(config, parts[0].folder),
        None => parts[0].title.clone(),
    });
    let kinds = parts.iter().flat_map(|part| part.chapters.iter().map(|(_, chapter)| chapter.heading.to_lowercase()));
    let kinds: Vec<String> = kinds.filter(|heading| !heading.is_empty()).collect();
    let lines =
        |part: &Part| part.abouts.iter().map(|about| subject::lines(part.folder, about)).find(|l| !l.is_empty());
    let measured = unique(
        parts
            .iter()
            .flat_map(|part| &part.abouts)
            .flat_map(|about| about.measured.lines().into_iter().map(|(label, text)| format!("{label}: {text}"))),
    );
    let configs: Vec<(&str, &Value)> =
        parts.iter().filter_map(|part| Some((part.title.as_str(), part.config()?))).collect();
    let mut assumed: Vec<(String, Table)> = Vec::new();
    if let Some(config) = &config {
        assumed.push(("Values of the config.".into(), assumed::fixed(config)));
        assumed.push(("Priors of the free parameters.".into(), assumed::priors(config)));
        assumed.push(("Priors of what is fitted before map and search.".into(), assumed::fitted(config)));
        assumed.push((
            "The folders have different configs; the tables above are of the first.".into(),
            assumed::differences(&configs),
        ));
    }
    Page {
        subtitle: format!("Report of dimcmc: {}", kinds.join(", ")),
        subject: parts.iter().find_map(lines).unwrap_or_default(),
        turning,
        statements: statements(&parts),
        warnings: warnings(&parts),
        provenance: parts
            .iter()
            .flat_map(|p| &p.abouts)
            .map(About::provenance)
            .find(|p| !p.is_empty())
            .unwrap_or_default(),
        sections: section::sections(parts),
        assumed,
        measured,
        config,
        title,
    }
}

/// The conclusions of all results: searches first, and no sentence twice.
fn statements(parts: &[Part]) -> Vec<Statement> {
    let mut all: Vec<&(Kind, Chapter)> = parts.iter().flat_map(|part| &part.chapters).collect();
    all.sort_by_key(|(kind, _)| kind.rank());
    let mut found: Vec<Statement> = Vec::new();
    for (kind, chapter) in all {
        for (tone, sentence) in chapter.shown_verdicts() {
            if found.iter().all(|one| one.sentence != sentence) {
                found.push(Statement { kind: *kind, tone, sentence: sentence.to_owned() });
            }
        }
    }
    found
}

/// The same, each once.
fn unique(lines: impl Iterator<Item = String>) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for line in lines {
        if !found.contains(&line) {
            found.push(line);
        }
    }
    found
}

/// Whether the file begins like a page.
pub fn is_page(file: &Path) -> bool {
    let mut beginning = vec![0; html::BEGINNING.len()];
    let read = std::fs::File::open(file).and_then(|mut file| file.read_exact(&mut beginning));
    read.is_ok() && beginning == html::BEGINNING.as_bytes()
}

/// The name of the folder.
fn title(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    escaped(&whole.file_name().unwrap_or(folder.as_os_str()).to_string_lossy()).into_owned()
}
