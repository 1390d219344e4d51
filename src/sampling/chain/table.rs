//! The summary as text, aligned, one line per parameter, and a last line on convergence.

use crate::numerics::text::aligned;
use crate::sampling::chain::{MoveSummary, ParameterSummary, Summary};
use std::collections::BTreeMap;

/// The table. With `truth` (injected values by name) there is a column for it.
pub fn table(summary: &Summary, truth: Option<&BTreeMap<String, f64>>) -> String {
    parameters(summary, truth) + &rest(summary, truth)
}

/// Its first part: the parameters, and which of them are not constrained.
pub fn parameters(summary: &Summary, truth: Option<&BTreeMap<String, f64>>) -> String {
    let mut head = vec!["parameter", "median", "- 68%", "+ 68%", "95% interval", "95% HDI", "R-hat", "ESS", "tau"];
    if truth.is_some() {
        head.insert(1, "truth");
    }
    let mut rows: Vec<Vec<String>> = vec![head.into_iter().map(str::to_owned).collect()];
    for name in &summary.names {
        let Some(one) = summary.parameters.get(name) else { continue };
        let mut row = cells(name, one);
        if let Some(truth) = truth {
            let text = truth.get(name).map_or_else(|| "-".to_owned(), |value| number(*value, decimals(one)));
            row.insert(1, text);
        }
        rows.push(row);
    }
    let mut text = aligned(&rows);
    for (name, one) in summary.parameters.iter().filter(|(_, one)| one.unconstrained) {
        let [low, high] = one.ci95;
        let digits = decimals(one);
        text +=
            &format!("{name} is unconstrained: the posterior equals the prior, {low:.digits$} to {high:.digits$}\n");
    }
    text
}

/// The part after the parameters: limits, derived quantities, and convergence.
pub fn rest(summary: &Summary, truth: Option<&BTreeMap<String, f64>>) -> String {
    let mut text = String::new();
    for name in &summary.names {
        if let Some((one, upper)) = summary.parameters.get(name).and_then(|one| Some((one, one.upper95?))) {
            text += &format!("{name} is consistent with zero: < {} (95 % upper limit)\n", number(upper, decimals(one)));
        }
    }
    text + &derived(summary, truth) + &convergence(summary) + "\n"
}

/// How the sampler went: acceptance, cost of an evaluation, and each move.
pub fn diagnostics(summary: &Summary) -> String {
    format!(
        "acceptance {:.2}, {:.0} model applications per evaluation, highest ln posterior {:.3}\n",
        summary.acceptance_fraction, summary.model_applications_median, summary.best.log_prob
    ) + &moves(summary)
}

/// Derived quantities and descriptions of names; `truth` contains them as well.
fn derived(summary: &Summary, truth: Option<&BTreeMap<String, f64>>) -> String {
    let mut head = vec!["derived", "median", "- 68%", "+ 68%", "95% interval", "95% HDI"];
    if truth.is_some() {
        head.insert(1, "truth");
    }
    let mut rows: Vec<Vec<String>> = vec![head.iter().map(|&text| text.to_owned()).collect()];
    let mut limits = String::new();
    for (name, one) in summary.derived_names.iter().filter_map(|name| summary.derived.get_key_value(name)) {
        let mut row = cells(name, one);
        if let Some(truth) = truth {
            let text = truth.get(name).map_or_else(|| "-".to_owned(), |value| number(*value, decimals(one)));
            row.insert(1, text);
        }
        row.truncate(head.len());
        rows.push(row);
        if let Some(upper) = one.upper95 {
            limits +=
                &format!("{name} is consistent with zero: < {} (95 % upper limit)\n", number(upper, decimals(one)));
        }
    }
    let table = if rows.len() > 1 { aligned(&rows) } else { String::new() };
    let names = summary.names.iter().chain(&summary.derived_names);
    let meanings = names.filter_map(|name| summary.definitions.get_key_value(name));
    table + &limits + &meanings.map(|(name, meaning)| format!("{name}: {meaning}\n")).collect::<String>()
}

/// A line on the moves, where the chain names them.
fn moves(summary: &Summary) -> String {
    if summary.moves.is_empty() {
        return String::new();
    }
    let share = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.2}"));
    let one = |m: &MoveSummary| {
        let (name, efficiency) = (m.kind.name(), share(m.ess_per_evaluation));
        format!("{name} {:.2} (efficiency {efficiency}) of {}", m.acceptance_fraction, m.proposals)
    };
    let each: Vec<String> = summary.moves.iter().map(one).collect();
    format!("{} effective samples per evaluation; accepted: {}\n", share(summary.ess_per_evaluation), each.join(", "))
}

/// A line on the length of the chain, and a last one on what it is good for.
fn convergence(summary: &Summary) -> String {
    let Summary { steps, discarded_steps, evaluations, failures, .. } = summary;
    let failed = if *failures > 0 { format!(", {failures} of them failed") } else { String::new() };
    let length = format!("{steps} steps ({discarded_steps} discarded), {evaluations} evaluations{failed}\n");
    let advice = summary.advice.join("; ");
    length
        + &match (summary.converged, advice.is_empty()) {
            (true, true) => "Chain converged".to_owned(),
            (true, false) => format!("Chain converged, but {advice}"),
            (false, _) => format!("Not converged: do not quote intervals. {advice}"),
        }
}

fn cells(name: &str, one: &ParameterSummary) -> Vec<String> {
    let digits = decimals(one);
    let interval = |[low, high]: [f64; 2]| format!("[{}, {}]", number(low, digits), number(high, digits));
    let optional =
        |value: Option<f64>, digits: usize| value.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$}"));
    let median = if one.unconstrained { "-".to_owned() } else { number(one.median, digits) };
    let side = |width: f64| if one.unconstrained { "-".to_owned() } else { number(width, digits) };
    // Differences from the median of the interval: a periodic one may be in another cycle than a wrapped estimate.
    vec![
        name.to_owned(),
        median,
        side(one.median - one.ci68[0]),
        side(one.ci68[1] - one.median),
        interval(one.ci95),
        interval(one.hdi95),
        optional(one.rhat, 3),
        optional(one.ess, 0),
        optional(one.tau, 1),
    ]
}

/// Decimals that show two digits of the standard deviation.
fn decimals(one: &ParameterSummary) -> usize {
    if one.sd > 0.0 && one.sd.is_finite() { (1.0 - one.sd.log10().floor()).clamp(0.0, 12.0) as usize } else { 6 }
}

fn number(value: f64, digits: usize) -> String {
    format!("{value:.digits$}")
}
