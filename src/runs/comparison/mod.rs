//! A chain compared with a likelihood grid of the same data: the same posterior by two methods, and the paraboloid of
//! Petit et al. (`docs/method.md` section 6).
//!
//! The likelihood grid has no prior: it is multiplied by the run's before marginalisation. Differences are in units of
//! the chain's error bar, half its 68 % interval. A sampled parameter without an axis is fixed in the grid, which is
//! then conditional.

mod cost;
mod draws;
mod notes;
pub mod pair;
mod table;

pub use cost::{ChainCost, Cost, LandscapeCost};
pub use draws::Distance;
pub use pair::{Pair, PairError};

use crate::data::io::saved::Saved;
use crate::model::Parameter;
use crate::numerics::json::number_or_null;
use crate::sampling::chain::statistics::wrap;
use crate::sampling::chain::{ChainError, Summary};
use crate::sampling::landscape::{Marginal, Paraboloid, Rule, Undefined, paraboloid};
use crate::surface::UnresolvedSpots;
use draws::Draws;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the file.
pub const FILE: &str = "comparison.json";

/// The content of `comparison.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Names of the sampled parameters, in order.
    pub names: Vec<String>,
    /// The comparison for each.
    pub parameters: BTreeMap<String, Compared>,
    /// Sampled parameters that are fixed in the likelihood grid, which is conditional on them; the chain is marginal.
    pub fixed_in_landscape: Vec<String>,
    /// Number of nodes of a grid over all sampled parameters, at the same spacing per error bar and out to three of
    /// them along the missing axes; null if none is.
    pub nodes_needed: Option<f64>,
    /// Fraction of the chain's draws outside the grid.
    pub outside: f64,
    /// Why there is no paraboloid; null where there is one.
    pub paraboloid_refused: Option<String>,
    /// Whether the chain has converged.
    pub converged: bool,
    /// The cost of each.
    pub cost: Cost,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// Versions of the program for the chain and the likelihood grid.
    pub versions: [String; 2],
    /// Notes on the comparison.
    pub notes: Vec<String>,
}

impl Saved for Comparison {
    fn check(&self) -> Result<(), String> {
        match self.names.iter().find(|name| !self.parameters.contains_key(*name)) {
            Some(name) => Err(format!("parameters: missing {name}")),
            None => Ok(()),
        }
    }
}

/// One sampled parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// Whether it has period 1: differences are the shorter way round.
    pub periodic: bool,
    /// Injected value, for simulated data.
    pub truth: Option<f64>,
    /// The chain's median and 68 % interval.
    pub chain: Interval,
    /// The paraboloid's vertex and error bar.
    pub paraboloid: Option<AgainstChain>,
    /// Median and 68 % interval of the likelihood grid under the run's prior.
    pub landscape: Option<AgainstChain>,
    /// The largest difference between the distributions.
    pub distribution: Option<Distance>,
    /// Its value where the likelihood grid has it fixed.
    pub fixed_at: Option<f64>,
    /// Fraction of the chain's draws beyond the ends of the axis.
    pub outside: f64,
    /// Spacing of the axis, in error bars of the chain.
    pub spacing: Option<f64>,
}

/// A value with its 68 % interval; that of a periodic parameter may leave [0, 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The value.
    pub value: f64,
    /// The interval.
    pub ci68: [f64; 2],
}

/// Another estimate, compared with the chain's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgainstChain {
    /// The estimate.
    #[serde(flatten)]
    pub interval: Interval,
    /// Minus the chain's, in error bars of the chain.
    #[serde(deserialize_with = "number_or_null")]
    pub difference: f64,
    /// Width of its interval over that of the chain's.
    #[serde(deserialize_with = "number_or_null")]
    pub width_ratio: f64,
}

impl Interval {
    fn half_width(&self) -> f64 {
        0.5 * (self.ci68[1] - self.ci68[0])
    }

    /// `value` minus this one, in error bars.
    fn difference(&self, value: f64, periodic: bool) -> f64 {
        let apart = value - self.value;
        (if periodic { apart - apart.round() } else { apart }) / self.half_width()
    }

    fn against(self, chain: &Interval, periodic: bool) -> AgainstChain {
        let width_ratio = self.half_width() / chain.half_width();
        AgainstChain { difference: chain.difference(self.value, periodic), width_ratio, interval: self }
    }
}

impl Comparison {
    /// Compares; the paraboloid is that of the nodes selected by `rule`.
    ///
    /// # Errors
    /// A chain without steps.
    pub fn of(pair: &Pair, rule: Rule) -> Result<Self, ChainError> {
        let (summary, _) = pair.manifest.summarise(&pair.settings, &pair.chain)?;
        let found = paraboloid(&pair.landscape, rule);
        let draws = Draws::of(pair, &summary);
        let compared = |(i, name): (usize, &String)| (name.clone(), parameter(pair, &summary, &found, &draws, i));
        let parameters: BTreeMap<String, Compared> = summary.names.iter().enumerate().map(compared).collect();
        let fixed = |name: &&String| pair.axis(name).is_none();
        let mut comparison = Comparison {
            fixed_in_landscape: summary.names.iter().filter(fixed).cloned().collect(),
            nodes_needed: cost::nodes_needed(pair, &parameters),
            outside: draws.outside,
            paraboloid_refused: found.as_ref().err().map(Undefined::to_string),
            converged: summary.converged,
            cost: Cost::of(pair, &summary, found.as_ref().ok()),
            data_sha256: pair.header.origin.data_sha256.clone(),
            versions: [pair.manifest.origin.version.clone(), pair.header.origin.version.clone()],
            notes: Vec::new(),
            names: summary.names.clone(),
            parameters,
        };
        comparison.notes = notes::notes(&comparison, &summary);
        let imaging = &pair.settings.imaging;
        if imaging.objective.properties().has_target && imaging.unresolved_spots == UnresolvedSpots::Fitted {
            comparison.notes.push("the chain includes unresolved-spot noise, the likelihood grid does not".into());
        }
        if imaging.objective != pair.grid_objective {
            let (chain, landscape) = (imaging.objective.name(), pair.grid_objective.name());
            comparison.notes.push(format!("objectives differ (chain: {chain}, grid: {landscape}): so do the results"));
        }
        Ok(comparison)
    }
}

/// The sampled parameter with index `i`.
fn parameter(
    pair: &Pair,
    summary: &Summary,
    found: &Result<Paraboloid, Undefined>,
    draws: &Draws,
    i: usize,
) -> Compared {
    let name = &summary.names[i];
    let one = &summary.parameters[name];
    let chain = Interval { value: one.median, ci68: one.ci68 };
    let origin = &pair.manifest.origin;
    let truth = origin.truth.as_ref().and_then(|truth| truth.get(name).copied());
    let periodic = Parameter::from_name(name).is_some_and(Parameter::is_phase);
    let Some(k) = pair.axis(name) else {
        let fixed_at = pair.header.origin.reference.parameters().get(name).copied();
        return Compared {
            periodic,
            truth,
            chain,
            paraboloid: None,
            landscape: None,
            distribution: None,
            fixed_at,
            outside: 0.0,
            spacing: None,
        };
    };
    let axis = &pair.header.grid.axes[k];
    let vertex = found.as_ref().ok().and_then(|found| found.parameters.get(name));
    let vertex = vertex
        .map(|one| Interval { value: one.vertex, ci68: [one.vertex - one.error, one.vertex + one.error] })
        .map(|one| one.against(&chain, periodic));
    let marginal = draws.marginals[k].as_ref();
    Compared {
        periodic,
        truth,
        paraboloid: vertex,
        landscape: marginal.map(|marginal| interval(marginal, periodic).against(&chain, periodic)),
        distribution: draws.distance(k, one),
        fixed_at: None,
        outside: draws.outside_axis[k],
        spacing: Some(axis.spacing() / chain.half_width()),
        chain,
    }
}

/// Median and 68 % interval of a marginal of the likelihood grid.
fn interval(marginal: &Marginal, periodic: bool) -> Interval {
    let median = marginal.quantile(0.5);
    let value = if periodic { wrap(median) } else { median };
    Interval { value, ci68: [0.16, 0.84].map(|p| marginal.quantile(p) + value - median) }
}
