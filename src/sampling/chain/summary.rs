//! The summary of a chain: each parameter (`parameter`), costs and failures of the chain.
//!
//! Statistics are of the steps kept after the burn-in (`convergence`); `evaluations`, `failures`,
//! `model_applications_median` and `best` are of the whole chain, the start included.
//!
//! The chain does not know which parameters are constrained: a caller that knows the priors fills it in.

use crate::numerics::quantile::quantile;
use crate::sampling::chain::autocorrelation::mean;
use crate::sampling::chain::parameter::{ParameterSummary, parameter_summary};
use crate::sampling::chain::{Chain, ChainError, Convergence, Derived, Goals, MoveSummary, ParameterKind};
use crate::sampling::chain::{Settled, advice, derived, moves, table};
use crate::sampling::log_density::Status;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The position of the highest log-probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// Its log-probability.
    pub log_prob: f64,
    /// The parameters.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, f64>,
}

/// Summary of a chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Names of the parameters, in order.
    pub names: Vec<String>,
    /// Summary of each parameter, by name.
    pub parameters: BTreeMap<String, ParameterSummary>,
    /// Names of the derived quantities, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub derived_names: Vec<String>,
    /// Summary of each of them, by name, from its values at the draws.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub derived: BTreeMap<String, ParameterSummary>,
    /// Descriptions of parameters and derived quantities, where their names are not enough.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub definitions: BTreeMap<String, String>,
    /// Acceptance fraction over the kept steps.
    pub acceptance_fraction: f64,
    /// Efficiency of each kind of move; empty for a chain that does not name its moves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moves: Vec<MoveSummary>,
    /// Effective samples per evaluation over the kept steps, for the parameter where it is least; null where unknown.
    #[serde(default)]
    pub ess_per_evaluation: Option<f64>,
    /// Whether every parameter has reached the goals and no walker is stuck.
    pub converged: bool,
    /// Number of the last step (0 is the start).
    pub steps: usize,
    /// Steps left out at the beginning.
    pub discarded_steps: usize,
    /// Number of evaluations, the start included.
    pub evaluations: usize,
    /// Number of failed ones.
    pub failures: usize,
    /// Median number of model applications per evaluation.
    #[serde(alias = "passes_median")]
    pub model_applications_median: f64,
    /// The position of the highest log-probability.
    pub best: Best,
    /// Advice, where the chain has not converged or something looks wrong.
    pub advice: Vec<String>,
}

/// Summarises a chain; `kinds` has one entry per parameter.
///
/// # Errors
/// [`ChainError::Empty`] or [`ChainError::Kinds`].
pub fn summarise(chain: &Chain, kinds: &[ParameterKind], goals: &Goals) -> Result<Summary, ChainError> {
    let convergence = Convergence::of(chain, kinds)?;
    let best = chain.best().ok_or(ChainError::Empty)?;
    let names = chain.names().to_vec();
    let discarded = convergence.discarded;
    let parameters: Vec<ParameterSummary> = (0..names.len())
        .into_par_iter()
        .map(|i| {
            let values = chain.series(i, discarded).into_iter().flatten().flatten().collect();
            parameter_summary(values, kinds[i], &convergence.diagnostics[i])
        })
        .collect();
    let accepted = chain.series_of(discarded.max(1), |record| if record.accepted { 1.0 } else { 0.0 });
    let kept = chain.records().iter().skip(discarded * chain.shape().size());
    let evaluated = kept.filter(|record| record.proposed != Status::OutsidePrior).count();
    let least = parameters.iter().map(|one| one.ess).try_fold(f64::INFINITY, |least, ess| Some(least.min(ess?)));
    let sd: Vec<f64> = parameters.iter().map(|one| one.sd).collect();
    Ok(Summary {
        moves: moves::summarise_moves(chain, discarded, kinds, &sd),
        derived_names: Vec::new(),
        derived: BTreeMap::new(),
        definitions: BTreeMap::new(),
        ess_per_evaluation: least.map(|ess| ess / evaluated.max(1) as f64),
        parameters: names.iter().cloned().zip(parameters).collect(),
        acceptance_fraction: mean(accepted.iter().flatten().flatten()),
        converged: convergence.reached(goals),
        steps: chain.steps() - 1,
        discarded_steps: discarded,
        evaluations: chain.evaluations(),
        failures: chain.failures(),
        model_applications_median: model_applications_median(chain),
        best: Best { log_prob: best.log_prob, parameters: names.iter().cloned().zip(best.theta.clone()).collect() },
        advice: advice::advice(chain, &convergence, goals),
        names,
    })
}

/// The table.
impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(table(self, None).trim_end())
    }
}

impl Summary {
    /// Adds the summaries of derived quantities from `chain`, the chain of this summary.
    pub fn derive(&mut self, chain: &Chain, quantities: Vec<Derived>) -> Vec<Settled> {
        let has_limit = |name: &str| self.parameters.get(name).is_some_and(|one| one.upper95.is_some());
        let settled = derived::settle(chain, self.discarded_steps, quantities, &has_limit);
        for Settled { quantity: Derived { name, definition, .. }, summary, .. } in &settled {
            self.derived_names.push(name.clone());
            self.derived.insert(name.clone(), summary.clone());
            self.definitions.extend(definition.clone().map(|text| (name.clone(), text)));
        }
        settled
    }
}

/// The median over the evaluations; 0 when there are none.
fn model_applications_median(chain: &Chain) -> f64 {
    let evaluated = chain.records().iter().filter(|record| record.proposed != Status::OutsidePrior);
    let mut counts: Vec<f64> = evaluated.map(|record| f64::from(record.model_applications)).collect();
    counts.sort_unstable_by(f64::total_cmp);
    if counts.is_empty() { 0.0 } else { quantile(&counts, 0.5) }
}
