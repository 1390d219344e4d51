//! A likelihood grid as text: `landscape.jsonl`, one line per node, in the order of the grid.
//!
//! `{"index":0,"k_kms":0.0,...,"log_likelihood":-38.2,"spottedness":0.06,"entropy":-0.2,"chi2":2764.5,"lambda":0.001,
//! "model_applications":24,"status":"converged"}`.

use super::lines::{self, JournalError, LineFile, Refusal};
use crate::sampling::landscape::{Grid, Landscape, Node};
use crate::sampling::log_density::{Evaluation, Status};
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;
use std::path::Path;

/// Opens a likelihood grid to resume it: the nodes so far, and the file cut after them.
///
/// # Errors
/// [`JournalError`]: a file that cannot be opened, is being written, or does not hold the first nodes of `grid` with
/// these `numbers`.
pub fn recover(path: &Path, grid: Grid, numbers: &[String]) -> Result<(LineFile, Landscape), JournalError> {
    let mut landscape = Landscape::new(grid, numbers.to_vec());
    let file = LineFile::recover(path, &mut |line| take(&mut landscape, line))?;
    Ok((file, landscape))
}

/// Reads the nodes so far without changing the file, which may be written at the same time.
///
/// # Errors
/// As [`recover`].
pub fn read(path: &Path, grid: Grid, numbers: &[String]) -> Result<Landscape, JournalError> {
    let mut landscape = Landscape::new(grid, numbers.to_vec());
    lines::read(path, &mut |line| take(&mut landscape, line))?;
    Ok(landscape)
}

/// Appends the next `nodes` of a `landscape` and hands them to the operating system.
///
/// # Errors
/// [`JournalError::Io`].
pub fn append(file: &mut LineFile, landscape: &Landscape, nodes: &[Node]) -> Result<(), JournalError> {
    file.append(nodes.iter().map(|node| {
        let Node { index, theta, evaluation: Evaluation { log_prob, numbers, model_applications, status } } = node;
        let names = landscape.numbers().iter().enumerate();
        Line {
            index: *index,
            coordinates: Named(landscape.grid().names().zip(theta.iter().copied().map(Some)).collect()),
            log_likelihood: Some(*log_prob).filter(|ln_l| ln_l.is_finite()),
            numbers: Named(names.map(|(i, name)| (name.as_str(), numbers.get(i).copied())).collect()),
            model_applications: *model_applications,
            status: *status,
        }
    }))
}

/// A node as text. ln L and the numbers beside it are null where the evaluation failed.
#[derive(Serialize)]
struct Line<'a> {
    index: usize,
    #[serde(flatten)]
    coordinates: Named<'a>,
    log_likelihood: Option<f64>,
    #[serde(flatten)]
    numbers: Named<'a>,
    model_applications: u32,
    status: Status,
}

/// Names and values, in order.
struct Named<'a>(Vec<(&'a str, Option<f64>)>);

impl Serialize for Named<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
}

/// The same, with coordinates and numbers not yet separated.
#[derive(Deserialize)]
struct ReadLine {
    index: usize,
    log_likelihood: Option<f64>,
    #[serde(alias = "passes")]
    model_applications: u32,
    status: Status,
    #[serde(flatten)]
    named: BTreeMap<String, Option<f64>>,
}

fn take(landscape: &mut Landscape, text: &[u8]) -> Result<bool, Refusal> {
    let ReadLine { index, log_likelihood, model_applications, status, mut named } = serde_json::from_slice(text)?;
    let missing = |name: &str| format!("missing key `{name}`");
    let mut coordinate = |name: &str| named.remove(name).flatten().ok_or_else(|| missing(name));
    let theta = landscape.grid().names().map(&mut coordinate).collect::<Result<Vec<f64>, String>>()?;
    let numbers: Vec<Option<Option<f64>>> = landscape.numbers().iter().map(|name| named.remove(name)).collect();
    if let Some(name) = named.keys().next() {
        return Err(format!("unknown key `{name}`").into());
    }
    if let Some((name, _)) = landscape.numbers().iter().zip(&numbers).find(|(_, number)| number.is_none()) {
        return Err(missing(name).into());
    }
    let evaluation = Evaluation {
        log_prob: log_likelihood.unwrap_or(f64::NEG_INFINITY),
        numbers: numbers.into_iter().flatten().flatten().collect(),
        model_applications,
        status,
    };
    landscape.push(Node { index, theta, evaluation }).map_err(|error| error.to_string())?;
    Ok(true)
}
