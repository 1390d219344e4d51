//! The objectives by name (`docs/method.md` section 3), and settings of unresolved spots.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a reconstruction is judged by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectiveKind {
    /// Spottedness at the target chi2 (coverage by spots; rms of brightness minus 1 of bright and dark images), turned
    /// into a log-probability by the trade-off curve.
    Spottedness,
    /// Entropy at the target chi2, turned into a log-probability in the same way.
    Entropy,
    /// `max_s [alpha S - chi2/2]` at the alpha of the reference solution; spelt `regularized-likelihood` too.
    #[serde(alias = "regularized-likelihood")]
    RegularisedLikelihood,
    /// The likelihood marginalised over evolving maps, which are a Gaussian process (GP).
    #[default]
    MarginalLikelihood,
}

impl ObjectiveKind {
    /// The name used in configs and tables.
    pub fn name(self) -> &'static str {
        match self {
            ObjectiveKind::Spottedness => "spottedness",
            ObjectiveKind::Entropy => "entropy",
            ObjectiveKind::RegularisedLikelihood => "regularised-likelihood",
            ObjectiveKind::MarginalLikelihood => "marginal-likelihood",
        }
    }
}

/// How spots count that a map does not resolve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum UnresolvedSpots {
    /// As the entropy has them (the paper's method): small and independent. Intervals are too narrow where spots have
    /// edges, above all near Porb = Prot.
    Entropy,
    /// As noise of fitted size, marginalised over as a jitter is.
    #[default]
    Fitted,
}
