//! The cost of chain and likelihood grid: reconstructions, and model applications, which hardly depend on the machine.

use super::{Compared, Pair};
use crate::sampling::chain::Summary;
use crate::sampling::landscape::Paraboloid;
use crate::sampling::log_density::Status;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Error bars to either side of the chain's median that a grid covers along a missing axis.
const REACH: f64 = 3.0;

/// Both costs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// The chain.
    pub chain: ChainCost,
    /// The likelihood grid.
    pub landscape: LandscapeCost,
}

/// The cost of the chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainCost {
    /// Reconstructions, including the start.
    pub reconstructions: usize,
    /// Number of failed ones.
    pub failed: usize,
    /// Median number of model applications per reconstruction.
    #[serde(alias = "passes_median")]
    pub model_applications_median: f64,
    /// Their total number.
    #[serde(alias = "passes")]
    pub model_applications: u64,
    /// Seconds, including the preceding search; null where they are not recorded.
    pub seconds: Option<f64>,
    /// Effective draws of the parameter that has fewest; null where unknown.
    pub effective_draws: Option<f64>,
}

/// The cost of the likelihood grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LandscapeCost {
    /// Nodes.
    pub reconstructions: usize,
    /// Nodes with an unreachable target chi2.
    pub unreachable: usize,
    /// Number of failed ones.
    pub failed: usize,
    /// Median number of model applications per node.
    #[serde(alias = "passes_median")]
    pub model_applications_median: u32,
    /// Their total number.
    #[serde(alias = "passes")]
    pub model_applications: u64,
    /// Seconds, including the preceding search; null where they are not recorded.
    pub seconds: Option<f64>,
    /// Nodes in the fit of the paraboloid; null without one.
    pub paraboloid_nodes: Option<usize>,
}

impl Cost {
    /// The cost of chain and likelihood grid.
    pub(super) fn of(pair: &Pair, summary: &Summary, paraboloid: Option<&Paraboloid>) -> Self {
        let (chain, landscape) = (&pair.chain, &pair.landscape);
        let [chain_seconds, landscape_seconds] = pair.efforts.map(|effort| Some(effort?.seconds));
        let ess = summary.parameters.values().map(|one| one.ess);
        Cost {
            chain: ChainCost {
                reconstructions: summary.evaluations,
                failed: summary.failures,
                model_applications_median: summary.model_applications_median,
                model_applications: chain.records().iter().map(|record| u64::from(record.model_applications)).sum(),
                seconds: chain_seconds,
                effective_draws: ess.reduce(|a, b| Some(a?.min(b?))).flatten(),
            },
            landscape: LandscapeCost {
                reconstructions: landscape.nodes().len(),
                unreachable: landscape.count(|status| status == Status::Unreachable),
                failed: landscape.count(Status::is_failure),
                model_applications_median: landscape.model_applications_median(),
                model_applications: landscape
                    .nodes()
                    .iter()
                    .map(|node| u64::from(node.evaluation.model_applications))
                    .sum(),
                seconds: landscape_seconds,
                paraboloid_nodes: paraboloid.map(|paraboloid| paraboloid.nodes),
            },
        }
    }
}

/// Nodes of a grid that includes the missing axes: with the geometric-mean number per error bar of the other axes, out
/// to [`REACH`] error bars. `None` if none is missing.
pub(super) fn nodes_needed(pair: &Pair, parameters: &BTreeMap<String, Compared>) -> Option<f64> {
    let spacings: Vec<f64> = parameters.values().filter_map(|one| one.spacing).collect();
    let missing = parameters.len() - spacings.len();
    let spacing = (spacings.iter().map(|spacing| spacing.ln()).sum::<f64>() / spacings.len() as f64).exp();
    let along_one = (2.0 * REACH / spacing).ceil() + 1.0;
    (missing > 0).then(|| pair.header.grid.len() as f64 * along_one.powi(missing as i32))
}
