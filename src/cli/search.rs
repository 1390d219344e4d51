//! The search for the best parameters with its display, for the commands that begin with one.

use super::{Failure, Global, progress};
use crate::data::scene::Scene;
use crate::inference::search::{Found, Progress, find};
use crate::model::ParameterSpace;
use std::path::Path;
use std::time::Instant;

/// Searches `space` in the `scene` of the config at `path`.
pub fn search(global: &Global, path: &Path, scene: &Scene, space: &ParameterSpace) -> Result<Found, Failure> {
    let spinner = progress::bar(global, None, "searching");
    let began = Instant::now();
    let report = |progress| spinner.set_message(message(progress, began.elapsed().as_secs_f64()));
    let found = find(&scene.imager, space, scene.search_settings(), &report);
    spinner.finish_and_clear();
    found.map_err(|e| Failure::search(path, e))
}

fn message(Progress { stage, evaluations }: Progress, elapsed_s: f64) -> String {
    match evaluations {
        0 => stage.to_string(),
        n => format!("{stage}, {n} reconstructions, {:.0}/s", n as f64 / elapsed_s.max(1e-9)),
    }
}
