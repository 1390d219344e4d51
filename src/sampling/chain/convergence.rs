//! Convergence of a chain: R-hat and effective sample size between independent ensembles, and the burn-in.
//!
//! - **R-hat** (Gelman & Rubin 1992; Vehtari et al. 2021): each ensemble is cut into an early and a late half, each
//!   half being one group with all its walkers pooled. Values are replaced by the normal scores of their ranks, and
//!   `R-hat = sqrt(((N - 1)/N W + B) / W)` with N draws per group, W the mean variance within groups and B the variance
//!   of the group means. The larger of the values' own and that of their distances from the median (folded) is taken.
//! - **ESS** = V / Var(grand mean), V the variance of all draws pooled. Walkers of one ensemble are not independent, so
//!   Var(grand mean) comes from the series of ensemble means: `C(0) tau / (E n)`, C the autocovariance *around the
//!   grand mean* averaged over ensembles, tau its integrated time (at least 1). It is at least the value from the
//!   scatter between ensemble means: `B_E / (E q)`, with q such that chance alone exceeds it once in a hundred times.
//! - **Periodic** parameters are assessed by cosine and sine, and the worse of the two counts.
//! - **Burn-in**: the smaller of half the chain and 5 times the largest autocorrelation time of its second half.

use crate::sampling::chain::autocorrelation::{autocorrelation_time, integrated_time, mean};
use crate::sampling::chain::{Chain, ChainError, Series};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The kind of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// Any number.
    Linear,
    /// Periodic with period 1 (cycles).
    Periodic,
    /// An amplitude: not negative, with 0 for no signal.
    Amplitude,
}

/// Goals for every parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goals {
    /// Largest R-hat.
    pub rhat: f64,
    /// Smallest ESS.
    pub ess: f64,
}

/// Convergence of one parameter. `None` where the chain is too short, or the parameter does not vary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diagnostic {
    /// R-hat between ensembles.
    pub rhat: Option<f64>,
    /// Effective sample size.
    pub ess: Option<f64>,
    /// Integrated autocorrelation time of the walkers (steps).
    pub tau: Option<f64>,
}

impl Diagnostic {
    /// The convergence of one quantity.
    pub fn of(series: Series, kind: ParameterKind) -> Self {
        diagnose(&facets(series, kind))
    }

    /// Whether the goals are reached.
    pub fn reached(&self, goals: &Goals) -> bool {
        self.rhat.is_some_and(|rhat| rhat <= goals.rhat) && self.ess.is_some_and(|ess| ess >= goals.ess)
    }
}

/// Convergence of a whole chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Convergence {
    /// Steps left out at the beginning.
    pub discarded: usize,
    /// Steps kept.
    pub kept: usize,
    /// One per parameter, in the order of the names.
    pub diagnostics: Vec<Diagnostic>,
    /// Walkers (ensemble, walker) that no longer move.
    pub stuck: Vec<(usize, usize)>,
    /// Number of independent ensembles.
    pub ensembles: usize,
}

impl Convergence {
    /// Assesses a chain. The result depends only on the chain, not on the number of threads.
    ///
    /// # Errors
    /// [`ChainError::Kinds`] when `kinds` does not match the parameters, [`ChainError::Empty`].
    pub fn of(chain: &Chain, kinds: &[ParameterKind]) -> Result<Self, ChainError> {
        if kinds.len() != chain.names().len() {
            return Err(ChainError::Kinds { expected: chain.names().len(), found: kinds.len() });
        }
        if chain.steps() == 0 {
            return Err(ChainError::Empty);
        }
        let half = chain.steps() / 2;
        let times: Vec<f64> = kinds
            .par_iter()
            .enumerate()
            .map(|(parameter, kind)| {
                let facets = facets(chain.series(parameter, half), *kind);
                worst(facets.iter().map(|series| autocorrelation_time(series).map(|time| time.tau)), f64::max)
                    .unwrap_or(f64::INFINITY)
            })
            .collect();
        let longest = times.into_iter().fold(0.0, f64::max);
        let discarded = half.min((5.0 * longest).ceil() as usize);
        let diagnostics = kinds
            .par_iter()
            .enumerate()
            .map(|(parameter, kind)| diagnose(&facets(chain.series(parameter, discarded), *kind)))
            .collect();
        let kept = chain.steps() - discarded;
        let ensembles = chain.shape().ensembles;
        Ok(Convergence { discarded, kept, diagnostics, stuck: stuck(chain, discarded), ensembles })
    }

    /// Length of the kept steps in longest autocorrelation times; 0 where one is unknown.
    pub fn kept_times(&self) -> f64 {
        let longest = worst(self.diagnostics.iter().map(|one| one.tau), f64::max);
        longest.map_or(0.0, |tau| self.kept as f64 / tau.max(1.0))
    }

    /// Whether every parameter has reached the goals and no walker is stuck. A single ensemble never has: there is no
    /// independent one to compare it with.
    pub fn reached(&self, goals: &Goals) -> bool {
        self.ensembles > 1 && self.stuck.is_empty() && self.diagnostics.iter().all(|one| one.reached(goals))
    }
}

/// The series by which a parameter is assessed.
fn facets(series: Series, kind: ParameterKind) -> Vec<Series> {
    if kind != ParameterKind::Periodic {
        return vec![series];
    }
    let apply = |f: fn(f64) -> f64| -> Series {
        let walker = |x: &Vec<f64>| x.iter().map(|x| f(TAU * x)).collect();
        series.iter().map(|walkers| walkers.iter().map(walker).collect()).collect()
    };
    vec![apply(f64::cos), apply(f64::sin)]
}

fn diagnose(facets: &[Series]) -> Diagnostic {
    Diagnostic {
        rhat: worst(facets.iter().map(rhat), f64::max),
        ess: worst(facets.iter().map(effective_sample_size), f64::min),
        tau: worst(facets.iter().map(|series| autocorrelation_time(series).map(|time| time.tau)), f64::max),
    }
}

/// The worse of several; `None` when one of them is unknown.
fn worst(mut values: impl Iterator<Item = Option<f64>>, worse: fn(f64, f64) -> f64) -> Option<f64> {
    let first = values.next()??;
    values.try_fold(first, |so_far, value| Some(worse(so_far, value?)))
}

/// Rank-normalised split R-hat between ensembles, the larger of plain and folded. `None` under 4 steps or without
/// spread.
pub fn rhat(series: &Series) -> Option<f64> {
    let steps = series.first()?.first()?.len();
    if steps < 4 {
        return None;
    }
    let groups: Vec<Vec<f64>> = [0..steps / 2, steps - steps / 2..steps]
        .into_iter()
        .flat_map(|range| {
            series.iter().map(move |walkers| walkers.iter().flat_map(|x| x[range.clone()].iter().copied()).collect())
        })
        .collect();
    let (scores, median) = normal_scores(&groups);
    let folded: Vec<Vec<f64>> = groups.iter().map(|group| group.iter().map(|x| (x - median).abs()).collect()).collect();
    let plain = group_rhat(&scores)?;
    // A quantity of two values only has no spread when folded.
    Some(group_rhat(&normal_scores(&folded).0).map_or(plain, |folded| plain.max(folded)))
}

/// R-hat of groups of equal size.
fn group_rhat(groups: &[Vec<f64>]) -> Option<f64> {
    let count = groups.first()?.len() as f64;
    let means: Vec<f64> = groups.iter().map(|group| mean(group.iter())).collect();
    let within =
        mean(groups.iter().zip(&means).map(|(group, centre)| variance(group, *centre)).collect::<Vec<_>>().iter());
    let between = variance(&means, mean(means.iter()));
    (within > 0.0).then(|| (((count - 1.0) / count * within + between) / within).sqrt())
}

/// Sample variance around a centre.
fn variance(values: &[f64], centre: f64) -> f64 {
    values.iter().map(|x| (x - centre).powi(2)).sum::<f64>() / (values.len() as f64 - 1.0)
}

/// Normal scores of the ranks of all values (equal values share their mean rank), and the median (Vehtari et al. 2021,
/// equation 14).
fn normal_scores(groups: &[Vec<f64>]) -> (Vec<Vec<f64>>, f64) {
    let size = groups[0].len();
    let values: Vec<f64> = groups.concat();
    let mut order: Vec<u32> = (0..values.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| values[a as usize].total_cmp(&values[b as usize]));
    let mut scores = vec![0.0; values.len()];
    for ties in order.chunk_by(|&a, &b| values[a as usize] == values[b as usize]) {
        // Ranks are counted along `order`; the chunk's offset in it gives the first.
        let first = (ties.as_ptr() as usize - order.as_ptr() as usize) / size_of::<u32>();
        let rank = first as f64 + 0.5 * (ties.len() as f64 + 1.0);
        let score = normal_quantile((rank - 0.375) / (values.len() as f64 + 0.25));
        ties.iter().for_each(|&index| scores[index as usize] = score);
    }
    let median = values[order[values.len() / 2] as usize];
    (scores.chunks(size).map(<[f64]>::to_vec).collect(), median)
}

/// Quantile of the standard normal distribution to 4.5e-4 (Abramowitz & Stegun 26.2.23): enough for a score.
fn normal_quantile(p: f64) -> f64 {
    let t = (-2.0 * p.min(1.0 - p).ln()).sqrt();
    let above = t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
    if p < 0.5 { -above } else { above }
}

/// Effective sample size of the mean (see the head of this file). `None` under 4 steps or without spread.
pub fn effective_sample_size(series: &Series) -> Option<f64> {
    let steps = series.first()?.first()?.len();
    let (ensembles, walkers) = (series.len() as f64, series[0].len() as f64);
    let grand = mean(series.iter().flatten().flatten());
    let draws = ensembles * walkers * steps as f64;
    let total = series.iter().flatten().flatten().map(|x| (x - grand).powi(2)).sum::<f64>() / (draws - 1.0);
    let means: Vec<Vec<f64>> = series
        .iter()
        .map(|ensemble| {
            (0..steps).map(|t| ensemble.iter().map(|walker| walker[t] - grand).sum::<f64>() / walkers).collect()
        })
        .collect();
    let time = integrated_time(&means)?;
    let mut of_mean = time.variance * time.tau.max(1.0) / (ensembles * steps as f64);
    if series.len() > 1 {
        let centres: Vec<f64> = means.iter().map(|one| mean(one.iter())).collect();
        let between = variance(&centres, mean(centres.iter()));
        of_mean = of_mean.max(between / (ensembles * chance(ensembles - 1.0)));
    }
    Some((total / of_mean).min(draws))
}

/// What chi2 / degrees of freedom exceeds once in a hundred times (Wilson & Hilferty 1931).
fn chance(degrees: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    (1.0 - spread + 2.326 * spread.sqrt()).powi(3)
}

/// Walkers without a single acceptance in the second half of what is kept, where the average walker had 20 or more.
fn stuck(chain: &Chain, discarded: usize) -> Vec<(usize, usize)> {
    let from = discarded + (chain.steps() - discarded) / 2;
    let accepted = chain.series_of(from.max(1), |record| if record.accepted { 1.0 } else { 0.0 });
    let counts: Vec<Vec<f64>> = accepted.iter().map(|e| e.iter().map(|w| w.iter().sum()).collect()).collect();
    if mean(counts.iter().flatten()) < 20.0 {
        return Vec::new();
    }
    let indexed =
        counts.iter().enumerate().flat_map(|(e, walkers)| walkers.iter().enumerate().map(move |(w, n)| (e, w, n)));
    indexed.filter(|(_, _, n)| **n == 0.0).map(|(e, w, _)| (e, w)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chain::autocorrelation::tests::ar1;

    #[test]
    fn independent_draws_count_in_full() {
        let found = effective_sample_size(&ar1(0.0, [4, 16, 1000], 11)).unwrap();
        // The variance of a mean from 4 x 1000 values, and the window's noise: some 5 %; between ensembles 1 in 100.
        assert!((found / 64_000.0 - 1.0).abs() < 0.15, "{found}");
    }

    #[test]
    fn correlated_draws_count_by_their_time() {
        // AR(1) of 0.9: tau = 19.
        let found = effective_sample_size(&ar1(0.9, [4, 16, 4000], 12)).unwrap();
        let truth = 4.0 * 16.0 * 4000.0 / 19.0;
        assert!((found / truth - 1.0).abs() < 0.25, "{found} against {truth}");
    }

    #[test]
    fn walkers_that_move_together_count_once() {
        let mut series = ar1(0.0, [4, 1, 2000], 13);
        for ensemble in &mut series {
            *ensemble = vec![ensemble[0].clone(); 20];
        }
        let found = effective_sample_size(&series).unwrap();
        assert!((found / 8000.0 - 1.0).abs() < 0.15, "{found}");
    }

    #[test]
    fn a_displaced_ensemble_is_flagged() {
        let mut series = ar1(0.5, [4, 16, 1000], 14);
        let (good, many) = (rhat(&series).unwrap(), effective_sample_size(&series).unwrap());
        assert!(good < 1.005, "{good}");
        series[2].iter_mut().flatten().for_each(|x| *x += 1.0);
        let (bad, few) = (rhat(&series).unwrap(), effective_sample_size(&series).unwrap());
        assert!(bad > 1.05 && few < 0.01 * many, "R-hat {bad}, ESS {few} after {many}");
    }

    #[test]
    fn a_small_displacement_costs_what_the_scatter_says() {
        // Too small for the window to see; Var(grand mean) >= B_E / (E q) = (0.13^2 / 4) / (4 x 3.8), so ESS <= 3600 or
        // so.
        let mut series = ar1(0.0, [4, 16, 1000], 17);
        series[3].iter_mut().flatten().for_each(|x| *x += 0.13);
        let found = effective_sample_size(&series).unwrap();
        assert!((2000.0..6000.0).contains(&found), "{found}");
    }

    #[test]
    fn a_wider_ensemble_and_a_drift_are_flagged() {
        let mut wide = ar1(0.5, [4, 16, 1000], 15);
        wide[1].iter_mut().flatten().for_each(|x| *x *= 3.0);
        assert!(rhat(&wide).unwrap() > 1.03);
        let mut drift = ar1(0.5, [4, 16, 1000], 16);
        drift.iter_mut().flatten().for_each(|x| x.iter_mut().enumerate().for_each(|(t, x)| *x += 2e-3 * t as f64));
        assert!(rhat(&drift).unwrap() > 1.03);
    }

    #[test]
    fn normal_quantiles() {
        for (p, z) in [(0.5, 0.0), (0.841345, 1.0), (0.022750, -2.0), (0.99865, 3.0)] {
            assert!((normal_quantile(p) - z).abs() < 5e-4, "{p}");
        }
        assert!((chance(3.0) - 11.345 / 3.0).abs() < 0.05);
    }
}
