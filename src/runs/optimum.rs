//! The results of `optimise`: `optimum.json`, and the same as a table.

use crate::data::io::atomic::{WriteError, write_json};
use crate::data::io::provenance::Provenance;
use crate::data::io::saved::{Saved, as_many, square};
use crate::data::scene::Scene;
use crate::inference::search::{Attempt, Found};
use crate::model::{
    Elements, Estimate, FreeParameter, OrbitQuantities, OrbitQuantity, Parameter, Quoted, definition, in_earths,
    quoted_definition,
};
use crate::numerics::text::listed;
use crate::runs::blind_search::{BlindSearch, SearchSummary};
use crate::runs::origin::{OptimumRecord, provenance};
use crate::sampling::optimise::Optimum;
use crate::surface::record::SurfaceRecord;
use nalgebra::DVector;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Name of the file.
pub const FILE: &str = "optimum.json";

/// The content of `optimum.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct OptimumFile {
    /// Names of the free parameters, in the order of the matrices.
    pub names: Vec<String>,
    /// Best value and standard deviation of each, and the log-probability there.
    #[serde(flatten)]
    pub optimum: OptimumRecord,
    /// Other values of the evaluation there, by name.
    #[serde(flatten, deserialize_with = "numbers_alone")]
    pub numbers: BTreeMap<String, f64>,
    /// Factors on the standard deviations of some parameters, where those of the curvature are too small.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub widened: BTreeMap<String, f64>,
    /// Whether the curvature is positive definite: otherwise the standard deviations are meaningless.
    pub well_defined: bool,
    /// Whether the search met its tolerance.
    pub converged: bool,
    /// Covariance of the parameters from the curvature, widened like the standard deviations.
    pub covariance: Vec<Vec<f64>>,
    /// Minus the Hessian of the log-probability in sampling coordinates, where K and phi (if both are free) are K cos
    /// and K sin of the orbital phase at mid-time.
    pub internal_curvature: Vec<Vec<f64>>,
    /// The blind search behind the verdict; absent where no orbit was searched for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blind_search: Option<SearchSummary>,
    /// Commonly quoted quantities of the orbit, with standard deviations from the same covariance.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub derived: BTreeMap<String, Estimate>,
    /// Injected values, for simulated data.
    pub truth: Option<BTreeMap<String, f64>>,
    /// The same for commonly quoted quantities of the orbit, times nearest to those found.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub derived_truth: BTreeMap<String, f64>,
    /// The reference image.
    pub reference: SurfaceRecord,
    /// Starts and ends of the climbs, by regularised likelihood.
    pub starts: Vec<StartRecord>,
    /// Number of profiles.
    pub profiles: usize,
    /// First and last time of the data (d).
    pub time_span_d: Option<[f64; 2]>,
    /// Config, data and program.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl Saved for OptimumFile {
    fn check(&self) -> Result<(), String> {
        let (names, n) = (&self.names, self.names.len());
        for (key, values) in [("parameters", &self.optimum.parameters), ("sd", &self.optimum.sd)] {
            if let Some(name) = names.iter().find(|name| !values.contains_key(*name)) {
                return Err(format!("{key}: missing {name}"));
            }
        }
        if let Some(name) = names.iter().find(|name| Parameter::from_name(name).is_none()) {
            return Err(format!("names: unknown parameter {name}"));
        }
        square("covariance", &self.covariance, n)?;
        square("internal_curvature", &self.internal_curvature, n)?;
        let ends =
            |one: &'_ StartRecord| std::iter::once(one.start.len()).chain(one.end.as_ref().map(Vec::len)).collect();
        let ends: Vec<Vec<usize>> = self.starts.iter().map(ends).collect();
        ends.into_iter().flatten().try_for_each(|found| as_many("starts", found, n, "names"))
    }
}

/// One climb.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StartRecord {
    /// Its start.
    pub start: Vec<f64>,
    /// Its end; null if it failed.
    pub end: Option<Vec<f64>>,
    /// The regularised log-probability there.
    pub log_prob: Option<f64>,
    /// Whether the climb met its tolerance.
    pub converged: bool,
    /// Its number of evaluations.
    pub evaluations: usize,
}

/// The numeric ones among the keys that no other field claims.
fn numbers_alone<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<String, f64>, D::Error> {
    let all = BTreeMap::<String, serde_json::Value>::deserialize(deserializer)?;
    Ok(all.into_iter().filter_map(|(name, value)| Some((name, value.as_f64()?))).collect())
}

impl OptimumFile {
    /// The file for the result `found` of a search in `scene`.
    pub fn new(scene: &Scene, found: &Found) -> Self {
        let reference = found.posterior.record();
        let free = scene.space.free();
        let factor = |f: &FreeParameter| Some((f.parameter.name().to_owned(), reference.widening(f.parameter)?));
        let by = free.iter().map(|f| reference.widening(f.parameter).unwrap_or(1.0));
        let by = DVector::from_iterator(free.len(), by);
        let mut optimum = found.optimum.clone();
        optimum.written_covariance.component_mul_assign(&(&by * by.transpose()));
        let optimum = &optimum;
        let (derived, derived_truth) = derived(scene, optimum);
        let prot = scene.imager.star.rotation_period_d;
        let porb_over_prot = scene.space.values_at(&optimum.theta)[Parameter::PorbOverProt];
        let names = found.posterior.number_names();
        let rows = |m: &nalgebra::DMatrix<f64>| m.row_iter().map(|row| row.iter().copied().collect()).collect();
        OptimumFile {
            names: scene.space.names().to_vec(),
            optimum: OptimumRecord::of(scene.space.names(), optimum),
            widened: free.iter().filter_map(factor).collect(),
            numbers: names.iter().map(|name| (*name).to_owned()).zip(optimum.evaluation.numbers.clone()).collect(),
            well_defined: optimum.well_defined,
            converged: optimum.converged,
            covariance: rows(&optimum.written_covariance),
            internal_curvature: rows(&optimum.curvature),
            blind_search: BlindSearch::summary_of(scene, found.detection.as_deref())
                .map(|search| search.beside(porb_over_prot, prot)),
            derived,
            truth: scene.named_truth(),
            derived_truth,
            reference,
            starts: found.attempts.iter().map(StartRecord::of).collect(),
            profiles: scene.observations.profiles.len(),
            time_span_d: scene.observations.time_span_d(),
            provenance: provenance(scene, found),
        }
    }

    /// Writes `optimum.json` into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        write_json(&folder.join(FILE), self)
    }

    /// Warnings on the best values.
    pub fn warnings(&self) -> Vec<String> {
        let remarks = self.blind_search.iter().flat_map(|search| &search.remarks).map(|remark| remark.text.clone());
        let held = self.provenance.measured.held_regions(&self.names);
        remarks.chain(self.reference.warnings(&self.names)).chain(held).collect()
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
        table += &self.derived_table();
        let maximum = match (self.well_defined, self.converged) {
            (true, true) => "Well-defined maximum",
            (true, false) => "Step limit reached: the maximum may be improved from here",
            (false, _) => "No well-defined maximum: at a prior boundary, or a degenerate direction",
        };
        let _ = writeln!(table, "{maximum}; ln P = {:.3}{}", self.optimum.log_prob, listed(&self.numbers));
        for note in self.warnings() {
            let _ = writeln!(table, "note: {note}");
        }
        table
    }

    /// Commonly quoted quantities of the orbit, and descriptions of names.
    fn derived_table(&self) -> String {
        let of = Quoted::all().map(Quoted::name);
        let rows: Vec<(&str, &Estimate)> = of.filter_map(|name| Some((name, self.derived.get(name)?))).collect();
        let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        let mut text = String::new();
        for (name, Estimate { value, sd }) in &rows {
            let _ = write!(text, "{name:width$}  {value:>14.6}  {sd:>10.6}");
            if let Some(truth) = self.derived_truth.get(*name) {
                let _ = write!(text, "  {truth:>14.6}");
            }
            text.push('\n');
        }
        let sampled = self.names.iter().map(|name| (name.as_str(), definition(name)));
        for (name, meaning) in sampled.chain(rows.iter().map(|(name, _)| (*name, quoted_definition(name)))) {
            if let Some(meaning) = meaning {
                let _ = writeln!(text, "{name}: {meaning}");
            }
        }
        let mass = self.derived.get(OrbitQuantity::MinimumMass.name());
        if let Some(earths) = mass.and_then(|mass| in_earths(mass.value)) {
            let _ = writeln!(text, "{earths}");
        }
        text
    }
}

/// Commonly quoted quantities of the orbit at the optimum, and their injected values.
fn derived(scene: &Scene, optimum: &Optimum) -> (BTreeMap<String, Estimate>, BTreeMap<String, f64>) {
    let settings = &scene.settings;
    let quantities = OrbitQuantities::new(&settings.star, settings.mass_msun, scene.observations.time_span_d());
    let free: Vec<Parameter> = scene.space.free().iter().map(|one| one.parameter).collect();
    let place = |p: Parameter| free.iter().position(|one| *one == p);
    let values = scene.space.values_at(&optimum.theta);
    let covariance =
        |p: Parameter, q: Parameter| place(p).zip(place(q)).map_or(0.0, |(i, j)| optimum.written_covariance[(i, j)]);
    let circle = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi];
    let covariance = circle.map(|p| circle.map(|q| covariance(p, q)));
    let is_circle = free.iter().filter(|p| p.is_orbital()).all(|p| circle.contains(p));
    let (mut derived, mut truth) = (BTreeMap::new(), BTreeMap::new());
    for quoted in quantities.of_free(&free) {
        let orbit = values.motion().first;
        let found = match is_circle && values.get(Parameter::SqrtECosOmega).is_none() {
            true => quantities.estimate(quoted.quantity, &orbit.orbit, &covariance),
            false => {
                let place = (scene.space.free(), &optimum.theta[..]);
                quantities.estimate_at(quoted, place, &values, &optimum.written_covariance)
            }
        };
        let Some(found) = found else { continue };
        derived.insert(quoted.name().to_owned(), found);
        let elements = &Elements::PLANETS[quoted.planet];
        let injected = scene.truth.filter(|truth| truth.get(elements.k).is_some_and(|k| k != 0.0));
        let injected = injected.map(|truth| elements.orbit(&truth));
        let injected = injected.and_then(|orbit| quantities.value(quoted.quantity, &orbit, Some(found.value)));
        truth.extend(injected.map(|value| (quoted.name().to_owned(), value)));
    }
    (derived, truth)
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
