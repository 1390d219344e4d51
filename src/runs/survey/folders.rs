//! Searches and detection limits in folders, matched star by star.
//!
//! Results of the same observations belong to one star. Its name is `star.name` of the config, or else that of the
//! folder (of the parent, where it is named after a command). Two sets of observations with one name are refused.

use super::star::Star;
use crate::data::config::first_difference;
use crate::data::io::FileError;
use crate::data::io::csv::Columns;
use crate::data::io::saved::Saved;
use crate::planets::occurrence::Completeness;
use crate::planets::verdict::{Finding, Verdict};
use crate::runs::limits::{self, LimitsFile};
use crate::runs::origin::{self, OriginError};
use crate::runs::{blind_search, manifest};
use serde::Deserialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Why some folders do not form a sample.
#[derive(Debug, thiserror::Error)]
pub enum SurveyError {
    /// A result that cannot be read.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// A table that is wrong.
    #[error(transparent)]
    Table(#[from] FileError),
    /// No folder, or nothing in it.
    #[error("{}: {problem}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The problem.
        problem: String,
    },
    /// Stars that are incomplete or cannot be distinguished, by name.
    #[error("{0}")]
    Sample(String),
}

/// Depth of the search for results inside a folder.
const DEPTH: usize = 4;

/// Folders that are named after their content, not after a star.
const COMMANDS: [&str; 6] = ["periodogram", "search", "limits", "sample", "run", "chain"];

/// The part of a search that the survey needs: `periodogram.json`.
#[derive(Deserialize)]
struct SearchPart {
    verdict: Verdict,
    data_sha256: String,
    #[serde(default)]
    config: Value,
}

/// The same of a chain: `manifest.json`, which contains the search behind its verdict.
#[derive(Deserialize)]
struct ChainPart {
    blind_search: Option<VerdictPart>,
    data_sha256: String,
    #[serde(default)]
    config: Value,
}

impl Saved for SearchPart {}

impl Saved for ChainPart {}

#[derive(Deserialize)]
struct VerdictPart {
    verdict: Verdict,
}

/// A search with its folder.
struct Search {
    folder: PathBuf,
    part: SearchPart,
}

/// All results of one set of observations.
struct Observed {
    data_sha256: String,
    searches: Vec<Search>,
    chains: Vec<Search>,
    limits: Vec<(PathBuf, LimitsFile)>,
}

/// The stars whose results are in `folders`, in the order of appearance.
///
/// # Errors
/// [`SurveyError`].
pub fn stars(folders: &[PathBuf]) -> Result<Vec<Star>, SurveyError> {
    let mut found: Vec<Observed> = Vec::new();
    for folder in folders {
        let problem = |problem: &str| SurveyError::Folder { folder: folder.clone(), problem: problem.into() };
        if !folder.is_dir() {
            return Err(problem("no such folder"));
        }
        let mut inside = Vec::new();
        walk(folder, DEPTH, &mut inside);
        if inside.is_empty() {
            let files = [blind_search::FILE, manifest::FILE, limits::JSON].join(", ");
            return Err(problem(&format!("holds no search and no limits: none of {files}")));
        }
        for folder in inside {
            read(&folder, &mut found)?;
        }
    }
    check_names(&found)?;
    check_complete(&found)?;
    found.into_iter().map(Observed::star).collect()
}

/// `folder` and the folders in it that hold results, in the order of their names.
fn walk(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) {
    let holds = |file: &str| folder.join(file).is_file();
    if [blind_search::FILE, manifest::FILE, limits::JSON].into_iter().any(holds) {
        found.push(folder.to_owned());
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut inside: Vec<PathBuf> = entries.filter(|path| path.is_dir()).collect();
    inside.sort();
    for folder in inside.iter().filter(|_| depth > 0) {
        walk(folder, depth - 1, found);
    }
}

/// Adds the results in `folder`; those that were added already, by another path, are skipped.
fn read(folder: &Path, found: &mut Vec<Observed>) -> Result<(), SurveyError> {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let is_new = |known: &Path| known.canonicalize().unwrap_or_else(|_| known.to_owned()) != whole;
    let folder_of = |data_sha256: String, found: &mut Vec<Observed>| -> usize {
        let known = found.iter().position(|of| of.data_sha256 == data_sha256);
        known.unwrap_or_else(|| {
            found.push(Observed { data_sha256, searches: Vec::new(), chains: Vec::new(), limits: Vec::new() });
            found.len() - 1
        })
    };
    if folder.join(blind_search::FILE).is_file() {
        let part: SearchPart = origin::read(folder, blind_search::FILE)?;
        let k = folder_of(part.data_sha256.clone(), found);
        if found[k].searches.iter().all(|search| is_new(&search.folder)) {
            found[k].searches.push(Search { folder: folder.into(), part });
        }
    }
    if folder.join(manifest::FILE).is_file() {
        let ChainPart { blind_search, data_sha256, config } = origin::read(folder, manifest::FILE)?;
        let k = folder_of(data_sha256.clone(), found);
        if let Some(VerdictPart { verdict }) = blind_search
            && found[k].chains.iter().all(|chain| is_new(&chain.folder))
        {
            let part = SearchPart { verdict, data_sha256, config };
            found[k].chains.push(Search { folder: folder.into(), part });
        }
    }
    if folder.join(limits::JSON).is_file() {
        let file: LimitsFile = origin::read(folder, limits::JSON)?;
        let k = folder_of(file.provenance.data_sha256.clone(), found);
        if found[k].limits.iter().all(|(folder, _)| is_new(folder)) {
            found[k].limits.push((folder.into(), file));
        }
    }
    Ok(())
}

impl Observed {
    /// Folders and configs of all results, searches first.
    fn results(&self) -> impl Iterator<Item = (&Path, &Value)> {
        let searches = self.searches.iter().chain(&self.chains).map(|one| (one.folder.as_path(), &one.part.config));
        searches.chain(self.limits.iter().map(|(folder, file)| (folder.as_path(), &file.provenance.config)))
    }

    fn folders(&self) -> String {
        self.results().map(|(folder, _)| folder.display().to_string()).collect::<Vec<_>>().join(", ")
    }

    fn name(&self) -> String {
        let mut names = self.results().filter_map(|(_, config)| config["star"]["name"].as_str());
        names.next().map_or_else(|| name_by_folder(self.results().map(|(folder, _)| folder)), str::to_owned)
    }

    fn has_search(&self) -> bool {
        !(self.searches.is_empty() && self.chains.is_empty())
    }

    /// The star, which has a search and limits.
    fn star(mut self) -> Result<Star, SurveyError> {
        let name = self.name();
        for folders in [
            self.searches.iter().map(|search| search.folder.display().to_string()).collect::<Vec<_>>(),
            self.limits.iter().map(|(folder, _)| folder.display().to_string()).collect(),
        ] {
            if folders.len() > 1 {
                return Err(SurveyError::Sample(format!(
                    "{name}: {}: several results of the same observations; give one of them",
                    folders.join(", ")
                )));
            }
        }
        let masses = |config: &Value| config["star"]["mass_msun"].as_f64();
        let mass_msun = self.results().find_map(|(_, config)| masses(config));
        self.searches.append(&mut self.chains);
        let (search, (folder, limits)) = (self.searches.swap_remove(0), self.limits.swap_remove(0));
        let completeness = completeness(&folder, &limits)?;
        let mut warnings: Vec<String> = limits.warnings.iter().map(|warning| format!("limits: {warning}")).collect();
        if let Some(key) = first_difference(&search.part.config, &limits.provenance.config) {
            warnings.push(format!("limits are of another config than the search: {key}; repeat `dimcmc limits`"));
        }
        let verdict = search.part.verdict;
        if verdict.finding == Finding::Candidate && !verdict.against.is_empty() {
            warnings.push(format!(
                "the candidate counts by its FAP, despite caveats: {}; to weigh it, give --reliability",
                verdict.against.join("; ")
            ));
        }
        Ok(Star { name, mass_msun, verdict, limits, completeness, group: None, planet: 1.0, warnings })
    }
}

/// The name of a folder, or of its parent where it is named after a command.
fn name_by_folder<'a>(mut folders: impl Iterator<Item = &'a Path>) -> String {
    let Some(folder) = folders.next() else { return String::new() };
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    match whole.parent() {
        Some(around) if COMMANDS.contains(&name(&whole).as_str()) => name(around),
        _ => name(&whole),
    }
}

fn check_names(found: &[Observed]) -> Result<(), SurveyError> {
    for (k, of) in found.iter().enumerate() {
        let name = of.name();
        if let Some(other) = found[..k].iter().find(|other| other.name() == name) {
            return Err(SurveyError::Sample(format!(
                "{name}: {} and {} are of different observations; give results of one of them, or two names by \
                 star.name",
                other.folders(),
                of.folders()
            )));
        }
    }
    Ok(())
}

/// Checks that every star has a search and limits; the error names all others.
fn check_complete(found: &[Observed]) -> Result<(), SurveyError> {
    let of = |is: &dyn Fn(&Observed) -> bool| -> Vec<String> {
        found.iter().filter(|of| is(of)).map(Observed::name).collect()
    };
    let (no_search, no_limits) = (of(&|of| !of.has_search()), of(&|of| of.limits.is_empty()));
    let mut problems = Vec::new();
    for (names, what, command) in [(no_search, "search", "periodogram"), (no_limits, "limits", "limits")] {
        if !names.is_empty() {
            problems.push(format!(
                "no {what} of {} of {} stars: {}: run `dimcmc {command} CONFIG --out FOLDER` for each, and give the \
                folders",
                names.len(),
                found.len(),
                names.join(", ")
            ));
        }
    }
    if problems.is_empty() { Ok(()) } else { Err(SurveyError::Sample(problems.join("; "))) }
}

/// The fractions in `limits.csv`.
fn completeness(folder: &Path, file: &LimitsFile) -> Result<Completeness, SurveyError> {
    let path = folder.join(limits::CSV);
    let table = Columns::read(&path)?;
    let (periods, tried) = (file.limits.iter().map(|limit| limit.period_d).collect::<Vec<_>>(), &file.k_kms);
    table.check_rows(periods.len() * tried.len(), &format!("periods times semi-amplitudes, by {}", limits::JSON))?;
    let (phases, recovered) = (table.column("phases")?, table.column("recovered")?);
    let fractions = phases.iter().zip(recovered).map(|(phases, recovered)| recovered / phases).collect();
    let wrong = || FileError::of(&path, "fractions beyond 0 to 1, or periods and K that do not rise");
    Ok(Completeness::new(&periods, tried, fractions).ok_or_else(wrong)?)
}
