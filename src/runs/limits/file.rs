//! The files of detection limits: `limits.csv`, one line per period and semi-amplitude, and `limits.json`; and a table.

use super::cells::{Cell, Limit, Orbits};
use super::full::{Agreement, Comparison};
use super::shortcut::Shortcut;
use crate::data::io::atomic::{WriteError, write, write_json, write_set};
use crate::data::io::csv::Table;
use crate::data::io::provenance::Provenance;
use crate::data::io::saved::Saved;
use crate::numerics::quantile::middle;
use crate::numerics::text::aligned;
use crate::planets::periodogram::Search;
use crate::planets::speeds::{Speeds, with_unit};
use crate::planets::verdict::{CANDIDATE_FAP, decimals, false_alarm, probability, speed, usual_draws};
use crate::star::Orbit;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Names of the files.
pub const CSV: &str = "limits.csv";
/// See [`CSV`].
pub const JSON: &str = "limits.json";

/// Largest number of periods shown in the table.
const SHOWN: usize = 12;

/// The content of `limits.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LimitsFile {
    /// False-alarm probability of a detection.
    pub false_alarm_probability: f64,
    /// Its Delta ln L.
    pub level: f64,
    /// The orbit that was removed from the profiles first, its K negative.
    pub removed: Option<Orbit>,
    /// The search of the original profiles, that of `periodogram`.
    pub before: BeforeRecord,
    /// The same without the removed orbit; null where none was removed.
    #[serde(default)]
    pub after: Option<BeforeRecord>,
    /// Injected semi-amplitudes (km/s).
    pub k_kms: Vec<f64>,
    /// Number of phases.
    pub phases: usize,
    /// Limits at the injected periods.
    pub limits: Vec<Limit>,
    /// Agreement with the full pipeline; null where it was not run.
    pub agreement: Option<Agreement>,
    /// Orbits that were tried by both methods.
    pub comparisons: Vec<Comparison>,
    /// Possible problems.
    pub warnings: Vec<String>,
    /// Config, data and program.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl Saved for LimitsFile {
    fn check(&self) -> Result<(), String> {
        match () {
            () if self.limits.is_empty() => Err("limits: empty, one period at least is due".into()),
            () if self.k_kms.is_empty() || self.k_kms.iter().any(|k| *k <= 0.0) => {
                Err("k_kms: must be above 0, one at least".into())
            }
            () if self.phases == 0 => Err("phases: must be above 0".into()),
            () => Ok(()),
        }
    }
}

/// The highest peak.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct BeforeRecord {
    /// Its period (d).
    pub period_d: f64,
    /// Its height.
    pub delta_ln_l: f64,
    /// Its false-alarm probability.
    pub false_alarm_probability: f64,
    /// Number of simulations behind it.
    #[serde(default = "usual_draws")]
    pub draws: usize,
}

impl LimitsFile {
    /// From the `limits` that were found.
    pub fn new(
        shortcut: &Shortcut,
        orbits: &Orbits,
        limits: Vec<Limit>,
        comparisons: Vec<Comparison>,
        rotation_period_d: f64,
        provenance: Provenance,
    ) -> Self {
        let of = |search: &Search| {
            let best = search.best();
            BeforeRecord {
                draws: search.false_alarm.maxima.len(),
                period_d: rotation_period_d * best.porb_over_prot,
                delta_ln_l: best.orbit.delta_ln_l,
                false_alarm_probability: search.false_alarm.probability(best.orbit.delta_ln_l).value(),
            }
        };
        let mut file = LimitsFile {
            false_alarm_probability: CANDIDATE_FAP,
            level: shortcut.level,
            removed: shortcut.removed,
            before: of(&shortcut.found.blind),
            after: shortcut.removed.map(|_| of(&shortcut.before)),
            k_kms: orbits.k_kms.clone(),
            phases: orbits.phases,
            limits,
            agreement: (!comparisons.is_empty()).then(|| Agreement::of(&comparisons)),
            comparisons,
            warnings: Vec::new(),
            provenance,
        };
        file.warnings = file.doubts(shortcut);
        file
    }

    fn doubts(&self, shortcut: &Shortcut) -> Vec<String> {
        let mut doubts = Vec::new();
        match &shortcut.found.change {
            Some(Ok(change)) if change.is_changing() => {
                doubts.push(format!("Limits invalid: {}", change.sentence()));
            }
            Some(Err(error)) => doubts.push(format!("Spot evolution could not be tested: {error}")),
            _ => {}
        }
        if self.removed.is_none() && self.before.false_alarm_probability < CANDIDATE_FAP {
            doubts.push(format!(
                "The profiles contain a candidate at {:.4} d, which counts as recovered near its period: omit \
                --with-best to subtract it",
                self.before.period_d
            ));
        }
        if let Some(after) = self.after.filter(|after| after.false_alarm_probability < CANDIDATE_FAP) {
            doubts.push(format!(
                "A second candidate at {:.4} d (FAP {}) remains and counts as recovered near its period",
                after.period_d,
                probability(after.false_alarm_probability)
            ));
        }
        if !shortcut.found.planet_free.on_target {
            doubts.push("No map reaches the target chi2 without fitting noise: set sigma_scale to \"auto\"".into());
        }
        if let Some(Agreement { orbits, agree, by_shortcut, by_full }) =
            self.agreement.filter(|a| a.by_shortcut.abs_diff(a.by_full) as f64 > (a.orbits as f64).sqrt())
        {
            doubts.push(format!(
                "Linearised: {by_shortcut}, full pipeline: {by_full} of {orbits} orbits recovered ({agree} agree): \
                trust the full pipeline"
            ));
        }
        doubts
    }

    /// Writes both files into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, cells: &[Cell], rotation_period_d: f64, folder: &Path) -> Result<(), WriteError> {
        let mut table = Table::new(&["period_d", "porb_over_prot", "k_kms", "phases", "detected", "recovered"]);
        for cell in cells {
            let period_d = rotation_period_d * cell.porb_over_prot;
            let counts = [cell.phases, cell.detected, cell.recovered].map(|n| n as f64);
            table.row(&[&[period_d, cell.porb_over_prot, cell.k_kms][..], &counts].concat());
        }
        let table = table.into_bytes();
        write_set(folder, &|stage| {
            write(&stage.join(CSV), &table)?;
            write_json(&stage.join(JSON), self)
        })
    }

    /// The unit of K in a table of the limits.
    pub fn unit(&self) -> Speeds {
        Speeds::of(&self.limits.iter().flat_map(|limit| [limit.k50_kms, limit.k95_kms]).flatten().collect::<Vec<_>>())
    }

    /// The rotation period, the unit of periods (d).
    pub fn rotation_period_d(&self) -> f64 {
        self.limits.first().map_or(f64::NAN, |limit| limit.period_d / limit.porb_over_prot)
    }

    /// Median limits over the periods.
    pub fn sentence(&self) -> String {
        let (least, most) = (self.k_kms.first().copied(), self.k_kms.last().copied());
        let typical = |of: fn(&Limit) -> Option<f64>| {
            let k = middle(self.limits.iter().map(|limit| of(limit).unwrap_or(f64::INFINITY)).collect());
            match k.is_finite() {
                true if least.is_some_and(|least| k <= least) => format!("K < {}", with_unit(k)),
                true => format!("K = {}", with_unit(k)),
                false => format!("K > {}", with_unit(most.unwrap_or(f64::NAN))),
            }
        };
        format!(
            "Detection limits: {} at 50 %, {} at 95 % of the phases (medians over {} periods).",
            typical(|limit| limit.k50_kms),
            typical(|limit| limit.k95_kms),
            self.limits.len()
        )
    }

    /// The period (d) with the highest limit at 95 % of the phases, and that limit.
    fn worst(&self) -> Option<(f64, String)> {
        let k95 = |limit: &Limit| limit.k95_kms.unwrap_or(f64::INFINITY);
        let worst = self.limits.iter().max_by(|a, b| k95(a).total_cmp(&k95(b)))?;
        let k = match worst.k95_kms {
            Some(k_kms) => format!("= {}", with_unit(k_kms)),
            None => format!("> {}", with_unit(*self.k_kms.last()?)),
        };
        Some((worst.period_d, k))
    }

    /// A table of some of the periods, and possible problems.
    pub fn table(&self) -> String {
        let unit = self.unit();
        let [k50, k95] = [50, 95].map(|share| format!("K {share} % ({})", unit.name));
        let mut rows = vec![["period_d", "porb_over_prot", &k50, &k95].map(str::to_owned).to_vec()];
        let step = self.limits.len().div_ceil(SHOWN).max(1);
        for limit in self.limits.iter().step_by(step) {
            let Limit { period_d, porb_over_prot, k50_kms, k95_kms } = *limit;
            let k = [k50_kms, k95_kms].map(|k| unit.cell(k));
            rows.push([vec![format!("{period_d:.4}"), format!("{porb_over_prot:.4}")], k.to_vec()].concat());
        }
        let mut text = self.sentence() + "\n" + &aligned(&rows);
        let shown = match step {
            1 => String::new(),
            _ => format!("; {} of {} periods, all are in {CSV}", self.limits.len().div_ceil(step), self.limits.len()),
        };
        text += &format!(
            "K recovered (FAP < {} %, right period) at 50 and 95 % of {} phases{shown}\n",
            100.0 * self.false_alarm_probability,
            self.phases
        );
        if let Some((period_d, k)) = self.worst() {
            text += &format!("Highest limit: K 95 % {k} at P = {period_d:.3} d\n");
        }
        if let Some(orbit) = self.removed {
            let BeforeRecord { false_alarm_probability, draws, .. } = self.before;
            let period_d = orbit.porb_over_prot * self.rotation_period_d();
            let digits = decimals(0.01 * period_d);
            text += &format!(
                "Subtracted: P = {period_d:.digits$} d, K = {} (highest peak: {})\n",
                speed(-orbit.k_kms, 0.1 * orbit.k_kms.abs()),
                false_alarm(false_alarm_probability, draws)
            );
        }
        if let Some(Agreement { orbits, agree, by_shortcut, by_full }) = self.agreement {
            text += &format!(
                "full pipeline: {by_full} of {orbits} orbits near the limit recovered; linearised: {by_shortcut}; \
                {agree} agree\n"
            );
        }
        for warning in &self.warnings {
            text += &format!("warning: {warning}\n");
        }
        text
    }
}
