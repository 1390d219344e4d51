//! A landscape as text: `landscape.jsonl`, one line per node, in the order of the grid.
//!
//! `{"index":0,"k_kms":0.0,...,"log_likelihood":-38.2,"spottedness":0.06,"entropy":-0.2,"chi2":2764.5,"lambda":0.001,
//! "passes":24,"status":"converged"}`.

use super::lines::{self, JournalError, LineFile, Refusal};
use crate::sampling::landscape::{Grid, Landscape, Node};
use crate::sampling::log_density::{Likelihood, Reconstruction, Status};
use serde::{Deserialize, Serialize, Serializer};
use std::collections::BTreeMap;
use std::path::Path;

/// Opens a landscape to go on with it: the nodes so far, and the file cut after them.
///
/// # Errors
/// [`JournalError`]: a file that cannot be opened, is being written, or does not hold the first nodes of `grid`.
pub fn recover(path: &Path, grid: Grid) -> Result<(LineFile, Landscape), JournalError> {
    let mut landscape = Landscape::new(grid);
    let file = LineFile::recover(path, &mut |line| take(&mut landscape, line))?;
    Ok((file, landscape))
}

/// Reads the nodes so far and leaves the file alone; it may be being written meanwhile.
///
/// # Errors
/// As [`recover`].
pub fn read(path: &Path, grid: Grid) -> Result<Landscape, JournalError> {
    let mut landscape = Landscape::new(grid);
    lines::read(path, &mut |line| take(&mut landscape, line))?;
    Ok(landscape)
}

/// Appends `nodes` of `grid` and hands them to the operating system.
///
/// # Errors
/// [`JournalError::Io`].
pub fn append(file: &mut LineFile, grid: &Grid, nodes: &[Node]) -> Result<(), JournalError> {
    file.append(nodes.iter().map(|node| {
        let Node { index, ref theta, reconstruction: Reconstruction { likelihood, passes, status } } = *node;
        Line {
            index,
            coordinates: Coordinates { grid, theta },
            log_likelihood: likelihood.map(|values| values.log_likelihood),
            spottedness: likelihood.map(|values| values.spottedness),
            entropy: likelihood.map(|values| values.entropy),
            chi2: likelihood.map(|values| values.chi2),
            lambda: likelihood.map(|values| values.lambda),
            passes,
            status,
        }
    }))
}

/// A node as text. The five values are null where the reconstruction failed.
#[derive(Serialize, Deserialize)]
struct Line<C> {
    index: usize,
    #[serde(flatten)]
    coordinates: C,
    log_likelihood: Option<f64>,
    spottedness: Option<f64>,
    entropy: Option<f64>,
    chi2: Option<f64>,
    lambda: Option<f64>,
    passes: u32,
    status: Status,
}

/// Names and values, in the order of the axes.
struct Coordinates<'a> {
    grid: &'a Grid,
    theta: &'a [f64],
}

impl Serialize for Coordinates<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.grid.names().zip(self.theta))
    }
}

fn take(landscape: &mut Landscape, text: &[u8]) -> Result<bool, Refusal> {
    let line: Line<BTreeMap<String, f64>> = serde_json::from_slice(text)?;
    let likelihood = line.likelihood();
    let Line { index, mut coordinates, passes, status, .. } = line;
    let mut coordinate = |name: &str| coordinates.remove(name).ok_or_else(|| format!("missing key `{name}`"));
    let theta = landscape.grid().names().map(&mut coordinate).collect::<Result<Vec<f64>, String>>()?;
    if let Some(name) = coordinates.keys().next() {
        return Err(format!("unknown key `{name}`").into());
    }
    let reconstruction = Reconstruction { likelihood, passes, status };
    landscape.push(Node { index, theta, reconstruction }).map_err(|error| error.to_string())?;
    Ok(true)
}

impl<C> Line<C> {
    /// The values, if all five are there.
    fn likelihood(&self) -> Option<Likelihood> {
        Some(Likelihood {
            log_likelihood: self.log_likelihood?,
            spottedness: self.spottedness?,
            entropy: self.entropy?,
            chi2: self.chi2?,
            lambda: self.lambda?,
        })
    }
}
