//! Many stars: the chain of every config of a list, each in its own folder, several at once.
//!
//! A star that is done is skipped, one that was interrupted is resumed, and one that fails stops no other.

use crate::data::io::FileError;
use crate::data::io::atomic::write_json;
use crate::data::scene::Scene;
use crate::inference::search;
use crate::planets::verdict::Verdict;
use crate::runs::fitted::fitted;
use crate::runs::manifest::{self, Manifest, RunSummary};
use crate::runs::pool::ranks::Answering;
use crate::runs::pool::{Answer, Brief, Pool, Question, orbit_from_bytes};
use crate::runs::run::{CHAIN, Run, RunError, SUMMARY, StartFrom};
use crate::sampling::chain::ParameterSummary;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Name of the file with all results.
pub const FILE: &str = "batch.json";

/// Name of the file that is locked while a batch is running, so that no other one overwrites its table.
pub const LOCK: &str = ".batch.lock";

/// A star of a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Star {
    /// The config's name without its extension, which is also the name of its folder.
    pub name: String,
    /// Its config.
    pub config: PathBuf,
    /// Folder of its run.
    pub folder: PathBuf,
}

/// The result for a star.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// It has a chain of the length that its config requires, and a summary.
    Sampled,
    /// It was interrupted; the same command resumes it.
    Interrupted,
    /// It has no chain, for this reason.
    Failed(String),
}

/// Reads a list: the path of a config in each line, from the list's folder; `#` begins a comment. Runs go into `out`.
///
/// # Errors
/// [`FileError`].
pub fn read_list(path: &Path, out: &Path) -> Result<Vec<Star>, FileError> {
    let text = std::fs::read_to_string(path).map_err(|source| FileError::Read { path: path.into(), source })?;
    let mut stars: Vec<Star> = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let wrong = |problem: String| FileError::Line { path: path.into(), line: k + 1, problem };
        let config = path.parent().unwrap_or(Path::new("")).join(line);
        let Some(name) = config.file_stem().map(|name| name.to_string_lossy().into_owned()) else {
            return Err(wrong(format!("{line} is no file")));
        };
        if let Some(other) = stars.iter().find(|star| star.name == name) {
            let problem = format!("{line} would share the folder {name} with {}; rename one", other.config.display());
            return Err(wrong(problem));
        }
        stars.push(Star { folder: out.join(&name), name, config });
    }
    if stars.is_empty() { Err(FileError::of(path, "names no config")) } else { Ok(stars) }
}

/// Samples all stars, as many at once as the pool is large; `done` is called for each that ends on this machine.
/// Returns the results, in order; stars that were not begun when the pool was told to stop count as interrupted.
pub fn sample_all(stars: &[Star], pool: &Pool, done: &(dyn Fn() + Sync)) -> Vec<End> {
    let stop = pool.shared_stop();
    let here = |star: &Star| {
        let end = sample(star, &Pool::threads(stop.clone()));
        done();
        end
    };
    let mut ends = pool.answers_apart(&Brief::Stars.to_bytes(), stars, here);
    ends.resize(stars.len(), End::Interrupted);
    ends
}

/// Samples a star, or resumes it.
pub fn sample(star: &Star, pool: &Pool) -> End {
    match tried(star, pool) {
        Ok(end) => end,
        Err(error) => match error.downcast_ref::<RunError>() {
            Some(RunError::Interrupted) => End::Interrupted,
            _ => End::Failed(error.to_string()),
        },
    }
}

fn tried(star: &Star, pool: &Pool) -> Result<End, Box<dyn Error>> {
    let mut scene = Scene::load(&star.config)?;
    scene.settings.require_free()?;
    let folder = &star.folder;
    // a chain without a line was killed at its beginning
    let has_lines = std::fs::metadata(folder.join(CHAIN)).is_ok_and(|chain| chain.len() > 0);
    let is_begun = folder.join(manifest::FILE).exists() || has_lines;
    let mut run = if is_begun {
        let manifest = Manifest::read(folder)?;
        manifest.origin.check(&scene, folder)?;
        if folder.join(SUMMARY).exists() && manifest.origin.config == scene.settings.resolved {
            return Ok(End::Sampled);
        }
        Run::resume(&scene, folder, None, pool)?
    } else {
        let claim = Run::claim(folder, true)?;
        scene = fitted(scene, &|_| ());
        let settings = scene.search_settings();
        let found = search::find(&scene.imager, &scene.space, settings, &|_| ())?;
        Run::in_memory(&scene, found, StartFrom::Optimum, pool)?.kept_by(claim, folder)?
    };
    if run.go(pool, |_, _| ())? == crate::sampling::ensemble::StopReason::Interrupted {
        return Ok(End::Interrupted);
    }
    let (summary, _) = run.manifest.summarise(&scene.settings, &run.chain)?;
    write_json(&folder.join(SUMMARY), &summary)?;
    Ok(End::Sampled)
}

/// A star in [`FILE`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Its config.
    pub config: PathBuf,
    /// The result.
    pub end: End,
    /// Whether its chain has converged.
    pub converged: Option<bool>,
    /// The verdict on a planet.
    #[serde(default)]
    pub verdict: Option<Verdict>,
    /// Evaluations of its chain.
    pub evaluations: Option<usize>,
    /// The parameters by name.
    pub parameters: BTreeMap<String, ParameterSummary>,
}

/// The results for the stars, with the values in their summaries.
pub fn rows(stars: &[Star], ends: &[End]) -> Vec<Row> {
    let row = |(star, end): (&Star, &End)| {
        let summary =
            || -> Option<RunSummary> { serde_json::from_slice(&std::fs::read(star.folder.join(SUMMARY)).ok()?).ok() };
        let summary = if *end == End::Sampled { summary() } else { None };
        Row {
            name: star.name.clone(),
            config: star.config.clone(),
            end: end.clone(),
            converged: summary.as_ref().map(|summary| summary.converged),
            verdict: summary.as_ref().and_then(|summary| summary.verdict.clone()),
            evaluations: summary.as_ref().map(|summary| summary.evaluations),
            parameters: summary.map(|summary| summary.chain.parameters).unwrap_or_default(),
        }
    };
    stars.iter().zip(ends).map(row).collect()
}

impl Question for Star {
    fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).expect("plain data")
    }
}

impl Answer for End {
    fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).expect("plain data")
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        serde_json::from_slice(bytes).ok()
    }
}

/// The function with which a rank answers the questions on a brief.
///
/// # Errors
/// A density that cannot be built there.
pub fn learn(brief: &[u8]) -> Result<Answering<'static>, Box<dyn Error>> {
    Ok(match Brief::from_bytes(brief).expect("a rank of this very program asks") {
        Brief::Density(task) => {
            let answer = task.answerer()?;
            Box::new(move |question, _| answer(question))
        }
        Brief::Injections(way) => {
            let search = way.searcher(way.scene()?);
            Box::new(move |question, _| {
                search(&orbit_from_bytes(question).expect("a rank of this very program asks")).to_bytes()
            })
        }
        Brief::Stars => Box::new(|question, stop| {
            if stop.load(std::sync::atomic::Ordering::Relaxed) {
                return End::Interrupted.to_bytes();
            }
            let star: Star = serde_json::from_slice(question).expect("a rank of this very program asks");
            sample(&star, &Pool::threads(stop.clone())).to_bytes()
        }),
    })
}
