//! The text on a run.

use super::chapter::{Chapter, NOTHING, Table, Tone, number};
use super::verdicts;
use crate::figures::plot::symbols::{PERIOD_DIGITS, Shown, decimals, label, symbol};
use crate::figures::plot::{PlotError, Sampled};
use crate::planets::modes::PeriodMode;
use crate::planets::verdict::speed;
use crate::runs::manifest::{Manifest, RunSummary};
use crate::sampling::chain::{ParameterSummary, Summary};
use std::path::Path;

/// The chapter of the run in `folder`.
pub(super) fn chapter(folder: &Path) -> Result<Chapter, PlotError> {
    let sampled = Sampled::read(folder)?;
    let (manifest, summary) = (&sampled.manifest, &sampled.summary);
    let mut notes = measured(manifest);
    notes.extend(summary.remarks.iter().filter(|line| line.starts_with(BAYES)).cloned());
    notes.extend(upper_limits(summary));
    let truth = sampled.truth.as_ref();
    let mut head = ["parameter", "median", "68 % interval", "95 % interval", "95 % HDI"].map(String::from).to_vec();
    if truth.is_some() {
        head.insert(1, "injected".into());
    }
    let row = |name: &String| {
        let one = &summary.parameters[name];
        let mut row = cells(name, one);
        if let Some(truth) = truth {
            row.insert(1, injected(name, one, truth.get(name)));
        }
        row
    };
    let parameters = Table { head: head.clone(), rows: summary.names.iter().map(row).collect() };
    let derived = summary.derived_names.iter().filter_map(|name| {
        let one = summary.derived.get(name)?;
        let mut row = cells(name, one);
        if let Some(truth) = truth {
            row.insert(1, injected(name, one, truth.get(name)));
        }
        Some(row)
    });
    let derived = Table { head, rows: derived.collect() };
    notes.extend(meanings(summary));
    let chain = Table {
        head: ["steps", "burn-in", "ensembles × walkers", "evaluations", "failed", "accepted"]
            .map(String::from)
            .to_vec(),
        rows: vec![vec![
            summary.steps.to_string(),
            summary.discarded_steps.to_string(),
            format!("{} × {}", manifest.ensembles, manifest.walkers),
            summary.evaluations.to_string(),
            summary.failures.to_string(),
            format!("{:.0} %", 100.0 * summary.acceptance_fraction),
        ]],
    };
    Ok(Chapter {
        heading: "Posterior".into(),
        verdicts: summary.verdict.as_ref().map(verdicts::of).into_iter().chain([convergence(summary)]).collect(),
        warnings: warnings(manifest, summary),
        notes,
        tables: [
            ("Sampled parameters.", parameters),
            ("Modes of the period.", period_modes(manifest, summary)),
            ("Derived quantities.", derived),
        ]
        .into_iter()
        .filter(|(_, table)| !table.rows.is_empty())
        .map(|(caption, table)| (caption.to_owned(), table))
        .collect(),
        diagnostics: vec![
            ("Convergence of each parameter.".to_owned(), convergence_of(summary)),
            ("The chain.".to_owned(), chain),
        ],
    })
}

fn cells(name: &str, one: &ParameterSummary) -> Vec<String> {
    let shown = Shown::of(name, None, one.ci95[1]);
    let digits = decimals(shown.factor * one.sd);
    let interval = |ends: [f64; 2]| {
        let [low, high] = ends.map(|end| shown.factor * end);
        format!("{low:.digits$} to {high:.digits$}")
    };
    vec![
        shown.label(),
        if one.unconstrained { "unconstrained".into() } else { format!("{:.digits$}", shown.factor * one.median) },
        interval(one.ci68),
        interval(one.ci95),
        interval(one.hdi95),
    ]
}

/// An injected value with the digits of the others in its row.
fn injected(name: &str, one: &ParameterSummary, value: Option<&f64>) -> String {
    let shown = Shown::of(name, None, one.ci95[1]);
    number(value.map(|value| shown.factor * value), decimals(shown.factor * one.sd))
}

/// The convergence of each parameter.
fn convergence_of(summary: &Summary) -> Table {
    let optional = |x: Option<f64>, digits: usize| x.map_or_else(|| NOTHING.into(), |x| format!("{x:.digits$}"));
    let row = |(name, one): (&String, &ParameterSummary)| {
        vec![label(name), optional(one.rhat, 3), optional(one.ess, 0), optional(one.tau, 1)]
    };
    let sampled = summary.names.iter().filter_map(|name| summary.parameters.get_key_value(name));
    let derived = summary.derived_names.iter().filter_map(|name| summary.derived.get_key_value(name));
    let head = ["parameter", "R-hat", "ESS", "τ (steps)"].map(String::from).to_vec();
    Table { head, rows: sampled.chain(derived).map(row).collect() }
}

/// Caveats from the blind search and the chain, and other warnings on the verdict.
fn warnings(manifest: &Manifest, summary: &RunSummary) -> Vec<String> {
    let measured = measured(manifest);
    let begun = manifest.warnings().into_iter().filter(|line| !measured.contains(line));
    let all = summary.remarks.iter().cloned().chain(begun).chain(manifest.co_rotation(summary));
    all.filter(|line| !line.starts_with(BAYES)).collect()
}

/// The beginning of the line with Bayes factors, which is no warning.
const BAYES: &str = "ln Bayes factor";

/// Quantities measured from the observations, one line each.
fn measured(manifest: &Manifest) -> Vec<String> {
    let lines = manifest.origin.measured.lines();
    lines.into_iter().map(|(label, text)| format!("{label}: {text}")).collect()
}

/// The modes of the period, where there are several or spots may mimic the only one.
fn period_modes(manifest: &Manifest, summary: &RunSummary) -> Table {
    if !summary.has_modes_to_show() {
        return Table::default();
    }
    let rotation_period = manifest.origin.config.pointer("/star/rotation_period_d").and_then(serde_json::Value::as_f64);
    let days = |p: f64, mode: &PeriodMode| {
        let digits = decimals(0.5 * p * (mode.ci68[1] - mode.ci68[0])).min(PERIOD_DIGITS);
        format!("{:.digits$}", p * mode.porb_over_prot)
    };
    let row = |mode: &PeriodMode| {
        let [low, high] = mode.ci68;
        let digits = decimals(0.5 * (high - low));
        vec![
            format!("{:.0} %", 100.0 * mode.weight),
            rotation_period.map_or_else(|| NOTHING.into(), |p| days(p, mode)),
            format!("{:.digits$}", mode.porb_over_prot),
            format!("{low:.digits$} to {high:.digits$}"),
            speed(mode.k_kms, 0.02 * mode.k_kms),
            mode.rotation.clone().unwrap_or_else(|| NOTHING.into()),
        ]
    };
    let head = ["share of the draws", "period (d)", "*P*_{orb}/*P*_{rot}", "68 % interval", "*K*", "rotation"];
    Table { head: head.map(String::from).to_vec(), rows: summary.period_modes.iter().map(row).collect() }
}

/// Whether the chain has converged, with the consequence.
fn convergence(summary: &Summary) -> (Tone, String) {
    if !summary.converged {
        let advice = summary.advice.join("; ");
        return (Tone::Doubt, format!("Not converged: do not quote intervals. {advice}."));
    }
    let all = || summary.parameters.values();
    let worst = all().filter_map(|one| one.rhat).fold(1.0, f64::max);
    let least = all().filter_map(|one| one.ess).fold(f64::INFINITY, f64::min);
    let remark = if summary.advice.is_empty() { String::new() } else { format!(" But {}.", summary.advice.join("; ")) };
    let sentence = format!("Converged: max R-hat = {worst:.3}, min ESS = {least:.0}.{remark}");
    (if summary.advice.is_empty() { Tone::Good } else { Tone::Neutral }, sentence)
}

/// Descriptions of parameters and quantities, where their names are not sufficient.
fn meanings(summary: &Summary) -> impl Iterator<Item = String> {
    let names = summary.names.iter().chain(&summary.derived_names);
    names.filter_map(|name| Some(format!("{}: {}.", symbol(name).0, summary.definitions.get(name)?)))
}

fn upper_limits(summary: &Summary) -> Vec<String> {
    let limit = |(name, one): (&String, &ParameterSummary)| {
        let shown = Shown::of(name, None, one.ci95[1]);
        let digits = decimals(shown.factor * one.sd);
        Some(format!("{} < {:.digits$} (95 % upper limit).", shown.label(), shown.factor * one.upper95?))
    };
    summary.parameters.iter().chain(&summary.derived).filter_map(limit).collect()
}
