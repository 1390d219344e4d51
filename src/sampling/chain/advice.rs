//! Advice on a chain that has not converged or looks wrong.
//!
//! Steps still needed are an estimate: ESS grows with the number of steps, and `R-hat^2 - 1` falls with it.

use crate::sampling::chain::{Chain, Convergence, Diagnostic, Goals};

/// Fraction of failed evaluations from which they are reported.
const MANY_FAILURES: f64 = 0.05;
/// Largest advised extension, in present lengths of the chain: beyond, the estimate is unreliable.
const MOST: f64 = 10.0;

/// Advice, most important first; empty for a converged chain without significant failures.
pub fn advice(chain: &Chain, convergence: &Convergence, goals: &Goals) -> Vec<String> {
    let mut advice = Vec::new();
    if chain.shape().ensembles < 2 {
        advice.push(
            "convergence needs several ensembles (R-hat compares two halves only): set `sampler.ensembles` \
            to 2 or more"
                .to_owned(),
        );
    }
    advice.extend(steps_needed(chain.names(), convergence, goals));
    if !convergence.stuck.is_empty() {
        let which = convergence.stuck.iter().take(5).map(|(e, w)| format!("ensemble {e} walker {w}"));
        let which = which.collect::<Vec<_>>().join(", ");
        let count = convergence.stuck.len();
        advice.push(format!(
            "{count} stuck walker(s), not moved since half of the steps kept: {which}; look at their log_prob, and \
            restart closer to the optimum if they are in a minor mode"
        ));
    }
    let (failures, evaluations) = (chain.failures(), chain.evaluations());
    if failures as f64 > MANY_FAILURES * evaluations as f64 {
        let share = 100.0 * failures as f64 / evaluations as f64;
        advice.push(format!(
            "{failures} of {evaluations} evaluations failed ({share:.1} %): the posterior may be truncated there; \
            narrow the priors or raise the chi2 target"
        ));
    }
    advice
}

/// One piece of advice on all unconverged parameters: each with its numbers, and the steps required.
fn steps_needed(names: &[String], convergence: &Convergence, goals: &Goals) -> Option<String> {
    let lacks = |(name, one): (&String, &Diagnostic)| {
        let (Some(rhat), Some(ess)) = (one.rhat, one.ess) else {
            return Some(format!("{name}: too few steps to tell, or it never moved"));
        };
        let rhat = (rhat > goals.rhat).then(|| format!("R-hat {rhat:.3} > {}", goals.rhat));
        let ess = (ess < goals.ess).then(|| format!("ESS {ess:.0} < {}", goals.ess));
        let lacks: Vec<String> = rhat.into_iter().chain(ess).collect();
        (!lacks.is_empty()).then(|| format!("{name}: {}", lacks.join(", ")))
    };
    let lacking: Vec<String> = names.iter().zip(&convergence.diagnostics).filter_map(lacks).collect();
    if lacking.is_empty() {
        return None;
    }
    let growth = growth_needed(convergence, goals).unwrap_or(2.0);
    let more = round_up(convergence.kept as f64 * (growth - 1.0).min(MOST));
    let bound = if growth - 1.0 > MOST { "at least" } else { "about" };
    Some(format!("{}: run `--extend {more}` ({bound} {more} steps more needed)", lacking.join("; ")))
}

/// Factor by which the chain must still grow for every parameter to reach the goals; `None` if unknown yet.
pub fn growth_needed(convergence: &Convergence, goals: &Goals) -> Option<f64> {
    convergence.diagnostics.iter().map(|one| growth(one, goals)).try_fold(1.0, |most: f64, one| Some(most.max(one?)))
}

/// The same for one parameter.
fn growth(one: &Diagnostic, goals: &Goals) -> Option<f64> {
    let (rhat, ess) = (one.rhat?, one.ess?);
    Some(((rhat * rhat - 1.0) / (goals.rhat * goals.rhat - 1.0)).max(goals.ess / ess).max(1.0))
}

/// Up to a multiple of 50, the interval at which goals are checked.
fn round_up(steps: f64) -> usize {
    ((steps / 50.0).ceil() as usize).max(1) * 50
}
