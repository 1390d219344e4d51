//! What chain and landscape took: reconstructions, and model applications, which hardly depend on the machine.

use super::{Compared, Pair};
use crate::sampling::chain::Summary;
use crate::sampling::landscape::Paraboloid;
use crate::sampling::log_density::Status;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Error bars to either side of the chain's median that a grid covers along an axis that is missing.
const REACH: f64 = 3.0;

/// What both took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// The chain.
    pub chain: ChainCost,
    /// The landscape.
    pub landscape: LandscapeCost,
}

/// What the chain took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainCost {
    /// Reconstructions, the start included.
    pub reconstructions: usize,
    /// How many of them failed.
    pub failed: usize,
    /// Median number of model applications that one took.
    #[serde(alias = "passes_median")]
    pub model_applications_median: f64,
    /// Those of all together.
    #[serde(alias = "passes")]
    pub model_applications: u64,
    /// Seconds, the search before it included; null where they are not recorded.
    pub seconds: Option<f64>,
    /// Effective draws of the parameter that has fewest; null where unknown.
    pub effective_draws: Option<f64>,
}

/// What the landscape took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LandscapeCost {
    /// Nodes.
    pub reconstructions: usize,
    /// Beyond the reach of the target chi2.
    pub unreachable: usize,
    /// How many failed.
    pub failed: usize,
    /// Median number of model applications that one took.
    #[serde(alias = "passes_median")]
    pub model_applications_median: u32,
    /// Those of all together.
    #[serde(alias = "passes")]
    pub model_applications: u64,
    /// Seconds, the search before it included; null where they are not recorded.
    pub seconds: Option<f64>,
    /// Nodes that the paraboloid was fitted to; null without one.
    pub paraboloid_nodes: Option<usize>,
}

impl Cost {
    /// What chain and landscape took.
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

/// Nodes of a grid that also has the axes that are missing: as many to an error bar as there are on the others in the
/// geometric mean, out to [`REACH`] error bars. `None` if none is missing.
pub(super) fn nodes_needed(pair: &Pair, parameters: &BTreeMap<String, Compared>) -> Option<f64> {
    let spacings: Vec<f64> = parameters.values().filter_map(|one| one.spacing).collect();
    let missing = parameters.len() - spacings.len();
    let spacing = (spacings.iter().map(|spacing| spacing.ln()).sum::<f64>() / spacings.len() as f64).exp();
    let along_one = (2.0 * REACH / spacing).ceil() + 1.0;
    (missing > 0).then(|| pair.header.grid.len() as f64 * along_one.powi(missing as i32))
}
