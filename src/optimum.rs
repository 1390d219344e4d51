//! What `optimise` found: `optimum.json`, and the same as a table.

use crate::blind_search::BlindSearch;
use crate::io::provenance::Provenance;
use crate::origin::{OptimumRecord, ReferenceRecord, by_name};
use crate::scene::Scene;
use crate::search::{Attempt, Found};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The content of `optimum.json`.
#[derive(Clone, Debug, Serialize)]
pub struct OptimumFile {
    /// Names of the free parameters, in the order of the matrices.
    pub names: Vec<String>,
    /// Best value and standard deviation of each, and the log-probability there.
    #[serde(flatten)]
    pub optimum: OptimumRecord,
    /// chi2 of the reconstruction at the optimum.
    pub chi2: f64,
    /// Spottedness there.
    pub spottedness: f64,
    /// Whether the curvature is positive definite: without that the standard deviations mean nothing.
    pub well_defined: bool,
    /// Whether the search met its tolerance.
    pub converged: bool,
    /// Covariance of the parameters from the curvature.
    pub covariance: Vec<Vec<f64>>,
    /// Minus the Hessian of the log-probability in internal coordinates, where K and phi (if both are free) are K cos and
    /// K sin of the orbital phase at mid-time.
    pub internal_curvature: Vec<Vec<f64>>,
    /// The blind search that the verdict rests on; absent where no orbit was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blind_search: Option<BlindSearch>,
    /// Injected values, for simulated data.
    pub truth: Option<BTreeMap<String, f64>>,
    /// The reference image.
    pub reference: ReferenceRecord,
    /// Where the climbs started and ended, by regularised likelihood.
    pub starts: Vec<StartRecord>,
    /// Where all this came from.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// One climb.
#[derive(Clone, Debug, Serialize)]
pub struct StartRecord {
    /// Where it started.
    pub start: Vec<f64>,
    /// Where it ended; null if it failed.
    pub end: Option<Vec<f64>>,
    /// The regularised log-probability there.
    pub log_prob: Option<f64>,
    /// Whether the climb met its tolerance.
    pub converged: bool,
    /// Evaluations it took.
    pub evaluations: usize,
}

impl OptimumFile {
    /// The file for what a search in `scene` found.
    pub fn new(scene: &Scene, found: &Found) -> Self {
        let optimum = &found.optimum;
        let rows = |m: &nalgebra::DMatrix<f64>| m.row_iter().map(|row| row.iter().copied().collect()).collect();
        OptimumFile {
            names: scene.space.names().to_vec(),
            optimum: OptimumRecord::of(scene.space.names(), optimum),
            chi2: optimum.evaluation.chi2,
            spottedness: optimum.evaluation.spottedness,
            well_defined: optimum.well_defined,
            converged: optimum.converged,
            covariance: rows(&optimum.written_covariance),
            internal_curvature: rows(&optimum.curvature),
            blind_search: BlindSearch::of(scene),
            truth: scene.truth.map(|values| by_name(&values)),
            reference: ReferenceRecord::of(found.posterior.reference()),
            starts: found.attempts.iter().map(StartRecord::of).collect(),
            provenance: scene.provenance(),
        }
    }

    /// A table of the parameters and a verdict.
    pub fn table(&self) -> String {
        let width = self.names.iter().map(String::len).max().unwrap_or(0).max("parameter".len());
        let sentence = self.blind_search.as_ref().map(|search| format!("{}\n\n", search.verdict.sentence));
        let mut table = sentence.unwrap_or_default();
        let _ = write!(table, "{:width$}  {:>12}  {:>10}", "parameter", "best", "sd");
        if self.truth.is_some() {
            let _ = write!(table, "  {:>12}", "injected");
        }
        table.push('\n');
        for name in &self.names {
            let (best, sd) = (self.optimum.parameters[name], self.optimum.sd[name]);
            let _ = write!(table, "{name:width$}  {best:>12.6}  {sd:>10.6}");
            if let Some(truth) = self.truth.as_ref().and_then(|truth| truth.get(name)) {
                let _ = write!(table, "  {truth:>12.6}");
            }
            table.push('\n');
        }
        let maximum = match (self.well_defined, self.converged) {
            (true, true) => "a well-defined maximum",
            (true, false) => "the search ran out of steps; the values may be improved from there",
            (false, _) => "no well-defined maximum: on the edge of a prior, or the data leave some direction open",
        };
        let _ = writeln!(table, "{maximum}; ln P = {:.3}, spottedness {:.5}", self.optimum.log_prob, self.spottedness);
        let remarks = self.blind_search.iter().flat_map(|search| &search.remarks).map(|remark| remark.text.clone());
        for note in remarks.chain(self.reference.warning()) {
            let _ = writeln!(table, "note: {note}");
        }
        table
    }
}

impl StartRecord {
    fn of(attempt: &Attempt) -> Self {
        let end = attempt.end.as_ref().ok();
        StartRecord {
            start: attempt.start.clone(),
            end: end.map(|o| o.theta.clone()),
            log_prob: end.map(|o| o.evaluation.log_prob),
            converged: end.is_some_and(|o| o.converged),
            evaluations: end.map_or(0, |o| o.evaluations),
        }
    }
}
