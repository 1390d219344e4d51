//! Efficiency of each kind of move: acceptance, and effective samples per reconstruction.
//!
//! In a mix, only the correlation over the single step of a move can be attributed to it. Moves are assessed as if the
//! chain were AR(1) with that correlation: `rho = 1 - <jump^2> / (2 variance)`, and `(1 - rho) / (1 + rho)` effective
//! samples per step, for the parameter where that is least.

use crate::sampling::chain::{Chain, MoveKind, ParameterKind, Record};
use crate::sampling::log_density::Status;
use serde::{Deserialize, Serialize};

/// One kind of move in the kept steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MoveSummary {
    /// The kind.
    #[serde(rename = "move")]
    pub kind: MoveKind,
    /// Proposals made.
    pub proposals: usize,
    /// Accepted fraction of them.
    pub acceptance_fraction: f64,
    /// Effective samples per reconstruction, as if all moves were of this kind; null where nothing varies.
    pub ess_per_evaluation: Option<f64>,
}

/// All kinds that made a proposal after step `discarded`; `sd` has the standard deviation of each parameter.
pub(super) fn summarise_moves(
    chain: &Chain,
    discarded: usize,
    kinds: &[ParameterKind],
    sd: &[f64],
) -> Vec<MoveSummary> {
    let size = chain.shape().size();
    let records = chain.records();
    let first = discarded.max(1) * size;
    let of = |kind: MoveKind| {
        let made: Vec<(&Record, &Record)> = (first..records.len())
            .filter(|&i| records[i].by == Some(kind))
            .map(|i| (&records[i - size], &records[i]))
            .collect();
        let count = made.len() as f64;
        let evaluations = made.iter().filter(|(_, now)| now.proposed != Status::OutsidePrior).count();
        let efficiency = (0..sd.len()).filter(|&p| sd[p] > 0.0).map(|p| {
            let jump = |(before, now): &(&Record, &Record)| {
                let jump = now.theta[p] - before.theta[p];
                if kinds[p] == ParameterKind::Periodic { jump - jump.round() } else { jump }
            };
            let rho = 1.0 - made.iter().map(|pair| jump(pair).powi(2)).sum::<f64>() / (count * 2.0 * sd[p] * sd[p]);
            ((1.0 - rho) / (1.0 + rho)).clamp(0.0, 1.0)
        });
        let efficiency = efficiency.reduce(f64::min).filter(|_| evaluations > 0);
        (!made.is_empty()).then(|| MoveSummary {
            kind,
            proposals: made.len(),
            acceptance_fraction: made.iter().filter(|(_, now)| now.accepted).count() as f64 / count,
            ess_per_evaluation: efficiency.map(|efficiency| efficiency * count / evaluations as f64),
        })
    };
    MoveKind::ALL.into_iter().filter_map(of).collect()
}
