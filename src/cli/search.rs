//! The search for the best parameters with its display, for the commands that begin with one.

use super::{Failure, Global, progress};
use crate::data::scene::Scene;
use crate::data::search::{Found, Progress, SearchSettings, Stage, find};
use crate::posterior::objective::ParameterSpace;
use std::path::Path;
use std::time::Instant;

/// Searches `space` in the `scene` of the config at `path`.
pub fn search(global: &Global, path: &Path, scene: &Scene, space: &ParameterSpace) -> Result<Found, Failure> {
    let spinner = progress::bar(global, None, "searching");
    let began = Instant::now();
    let report = |progress| spinner.set_message(message(progress, began.elapsed().as_secs_f64()));
    let found = find(&scene.imager, space, SearchSettings::new(&scene.settings), &report);
    spinner.finish_and_clear();
    found.map_err(|e| Failure::search(path, e))
}

fn message(Progress { stage, evaluations }: Progress, elapsed_s: f64) -> String {
    let stage = match stage {
        Stage::FirstImage => "reconstructing at the config's values".to_string(),
        Stage::Climbing { done, starts } => format!("searching, {done} of {starts} climbs done"),
        Stage::Reference => "reference image and trade-off curve".to_string(),
        Stage::Refining => "refining the best parameters".to_string(),
    };
    match evaluations {
        0 => stage,
        n => format!("{stage}, {n} reconstructions, {:.0}/s", n as f64 / elapsed_s.max(1e-9)),
    }
}
