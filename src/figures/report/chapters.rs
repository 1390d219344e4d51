//! The text on each kind of result, from its file.

use super::chapter::{Chapter, NOTHING, Tone, number, pairs, parameters, table, tone};
use super::{injection, maps, planned, run, verdicts};
use crate::data::io::map::{FIT, MAP};
use crate::data::io::paraboloid::ParaboloidFile;
use crate::data::io::truth::{self, Truth, TruthFile};
use crate::figures::plot::PlotError;
use crate::figures::plot::symbols::{PERIOD_DIGITS, Shown, decimals, label, symbol};
use crate::model::{Estimate, OrbitQuantity, Parameter, Quoted, definition, quoted_definition};
use crate::planets::speeds::Speeds;
use crate::planets::verdict::{extrapolated, probability};
use crate::runs::blind_search::{self, PeakRecord, PeriodogramFile};
use crate::runs::comparison::{self, AgainstChain, Comparison, Interval};
use crate::runs::grid_scan::{self, Header, PARABOLOID};
use crate::runs::optimum::{self, OptimumFile};
use crate::runs::{limits, manifest, origin, plan};
use crate::sampling::landscape::Axis;
use std::collections::BTreeMap;
use std::path::Path;

/// The chapter of the result identified by `file`.
pub(super) fn of(folder: &Path, file: &'static str) -> Result<Chapter, PlotError> {
    Ok(match file {
        manifest::FILE => run::chapter(folder)?,
        MAP => maps::chapter(&origin::read(folder, FIT)?),
        blind_search::FILE => search(&origin::read(folder, file)?),
        grid_scan::HEADER => {
            let present = folder.join(PARABOLOID).is_file();
            let paraboloid = if present { Some(origin::read(folder, PARABOLOID)?) } else { None };
            landscape(&origin::read(folder, file)?, paraboloid.as_ref())
        }
        optimum::FILE => best(&origin::read(folder, file)?),
        comparison::FILE => compared(&origin::read(folder, file)?),
        limits::JSON => injection::limits(&origin::read(folder, file)?),
        plan::JSON => planned::chapter(&origin::read(folder, file)?),
        truth::FILE => match origin::read(folder, file)? {
            TruthFile::Injected(truth) => injection::injection(&truth),
            TruthFile::Simulated(truth) => simulation(&truth),
        },
        // only figures
        _ => Chapter::default(),
    })
}

/// Decimals for an uncertainty, if there is one.
fn digits_of(sigma: Option<f64>, otherwise: usize) -> usize {
    sigma.filter(|x| x.is_finite()).map_or(otherwise, decimals)
}

fn simulation(truth: &Truth) -> Chapter {
    let snr = truth.snr.map_or_else(|| "no noise".into(), |snr| format!("{snr}"));
    let rows = [("spot coverage", number(truth.spottedness, 4)), ("signal-to-noise ratio of a bin", snr)];
    let parameters = parameters(&truth.parameters, None, |_| true);
    Chapter {
        heading: "Simulation".into(),
        tables: vec![("Simulated data.".into(), pairs(&rows)), ("Injected parameters.".into(), parameters)],
        ..Chapter::default()
    }
}

fn search(file: &PeriodogramFile) -> Chapter {
    let best = &file.best;
    let injected = |parameter: Parameter| file.truth.as_ref().and_then(|truth| truth.get(parameter));
    let row = |name: &str, value: f64, sigma: Option<f64>, truth: Option<f64>| {
        let shown = Shown::of(name, None, value);
        let [sigma, truth] = [sigma, truth].map(|x| x.map(|x| shown.factor * x));
        let digits = digits_of(sigma, 3);
        vec![shown.label(), number(shown.factor * value, digits), number(sigma, digits), number(truth, digits)]
    };
    let mut orbit = vec![
        row("k_kms", best.k_kms, Some(best.sigma_k_kms), injected(Parameter::K)),
        row("porb_over_prot", best.porb_over_prot, best.sigma_porb_over_prot, injected(Parameter::PorbOverProt)),
        row("phi", best.phi, best.sigma_phi, injected(Parameter::Phi)),
    ];
    let period = row("", best.period_d, best.sigma_period_d, None);
    orbit.insert(1, [vec!["*P*_{orb} (d)".into()], period[1..].to_vec()].concat());
    let told = OrbitQuantity::ALL.into_iter().filter_map(|quantity| Some((quantity, best.quantities.of(quantity)?)));
    let mut notes: Vec<String> = note("phi", definition("phi")).into_iter().collect();
    for (quantity, (value, sigma)) in told {
        orbit.push(row(quantity.name(), value, sigma, file.derived_truth.get(quantity.name()).copied()));
        notes.extend(note(quantity.name(), quantity.definition()));
    }
    notes.extend(file.significance());
    notes.push(file.co_rotation.statement.clone());
    notes.extend(file.evidence.as_ref().map(|evidence| evidence.sentence.clone()));
    let unit = Speeds::of(&file.peaks.iter().map(|peak| peak.orbit.k_kms).collect::<Vec<_>>());
    let peak = |peak: &PeakRecord| {
        let alias =
            peak.alias.as_ref().map(|alias| format!("of peak 1 by sampling at {:.3}/d", alias.window_frequency_per_d));
        vec![
            number(peak.orbit.period_d, digits_of(peak.orbit.sigma_period_d, PERIOD_DIGITS)),
            number(unit.factor * peak.orbit.k_kms, digits_of(Some(unit.factor * peak.orbit.sigma_k_kms), 3)),
            number(unit.factor * peak.orbit.sigma_k_kms, digits_of(Some(unit.factor * peak.orbit.sigma_k_kms), 3)),
            number(peak.orbit.delta_ln_l, 2),
            extrapolated(peak.false_alarm_probability, file.false_alarm.draws)
                .map_or_else(|| probability(peak.false_alarm_probability), |limit| format!("< {limit}")),
            alias.unwrap_or_else(|| NOTHING.into()),
            peak.rotation.clone().unwrap_or_else(|| NOTHING.into()),
        ]
    };
    let beside = file.other_known().iter().map(|planet| &planet.verdict);
    let [k, sigma] = ["*K*", "*σ*_{K}"].map(|symbol| format!("{symbol} ({})", unit.name));
    let head = ["period (d)", &k, &sigma, "Δ ln *L*", "FAP", "alias", "rotation"];
    Chapter {
        heading: "Search for a planet".into(),
        verdicts: std::iter::once(&file.verdict).chain(beside).chain(&file.blind).map(verdicts::of).collect(),
        warnings: file.warnings.clone(),
        notes,
        tables: vec![
            (
                if file.first_known().is_some() { "The known planet." } else { "The best orbit." }.into(),
                table(&["parameter", "best", "uncertainty", "injected"], orbit),
            ),
            ("Peaks of the periodogram.".into(), table(&head, file.peaks.iter().map(peak).collect())),
        ],
        diagnostics: Vec::new(),
    }
}

/// The description of a name, if it needs one.
fn note(name: &str, meaning: Option<&str>) -> Option<String> {
    Some(format!("{}: {}.", symbol(name).0, meaning?))
}

fn landscape(header: &Header, file: Option<&ParaboloidFile>) -> Chapter {
    let axes = &header.grid.axes;
    let truth = header.origin.truth.as_ref();
    let found = file.and_then(|file| file.paraboloid.as_ref());
    let estimate = |axis: &Axis| found.and_then(|found| found.parameters.get(&axis.name));
    let row = |axis: &Axis| {
        let estimate = estimate(axis);
        let digits = digits_of(estimate.map(|one| one.error), 4);
        vec![
            label(&axis.name),
            format!("{} to {}", number(axis.min, 4), number(axis.max, 4)),
            axis.nodes.to_string(),
            number(estimate.map(|one| one.vertex), digits),
            number(estimate.map(|one| one.error), digits),
            number(truth.and_then(|truth| truth.get(&axis.name)).copied(), digits),
        ]
    };
    // an axis that covers all phases has the length of a cycle
    let length = |axis: &Axis| if axis.max > axis.min { axis.max - axis.min } else { axis.max - axis.min + 1.0 };
    let unbounded = axes.iter().find(|axis| estimate(axis).is_some_and(|one| one.error > 0.5 * length(axis)));
    let verdict = match (file.map(|file| &file.refused), unbounded) {
        (None, _) => (Tone::Doubt, "The likelihood grid is not finished, or has no paraboloid.".to_owned()),
        (Some(Some(why)), _) => (Tone::Doubt, format!("There is no paraboloid: {why}.")),
        (_, Some(axis)) => (
            Tone::Doubt,
            format!(
                "A paraboloid fits around the highest node, but the error bar of {} is more than half its axis: the \
                 nodes do not bound it.",
                label(&axis.name)
            ),
        ),
        _ => (
            Tone::Good,
            "The highest node lies within the likelihood grid, and a paraboloid fits around it.".to_owned(),
        ),
    };
    let fit = found.map(|found| {
        pairs(&[
            ("nodes that it was fitted to", found.nodes.to_string()),
            ("residuals, rms (chi2)", number(found.rms_chi2, 3)),
            ("nodes reach above the lowest chi2 by", number(found.delta_chi2, 2)),
        ])
    });
    let head = ["parameter", "axis", "nodes", "vertex", "error", "injected"];
    Chapter {
        heading: "Landscape".into(),
        verdicts: vec![verdict],
        tables: vec![
            ("Axes and paraboloid.".into(), table(&head, axes.iter().map(row).collect())),
            ("Fit of the paraboloid.".into(), fit.unwrap_or_default()),
        ],
        ..Chapter::default()
    }
}

fn best(file: &OptimumFile) -> Chapter {
    let row = |name: &str, value: Option<f64>, sd: Option<f64>, truth: Option<f64>| {
        let shown = Shown::of(name, None, value.unwrap_or(f64::NAN));
        let [value, sd, truth] = [value, sd, truth].map(|x| x.map(|x| shown.factor * x));
        let digits = digits_of(sd, 4);
        vec![shown.label(), number(value, digits), number(sd, digits), number(truth, digits)]
    };
    let of = |name: &String| {
        let get = |values: &BTreeMap<String, f64>| values.get(name).copied();
        row(name, get(&file.optimum.parameters), get(&file.optimum.sd), file.truth.as_ref().and_then(get))
    };
    let mut rows: Vec<Vec<String>> = file.names.iter().map(of).collect();
    let mut notes: Vec<String> = file.names.iter().filter_map(|name| note(name, definition(name))).collect();
    for name in Quoted::all().map(Quoted::name).filter(|name| !file.names.iter().any(|free| free == name)) {
        if let Some(Estimate { value, sd }) = file.derived.get(name) {
            rows.push(row(name, Some(*value), Some(*sd), file.derived_truth.get(name).copied()));
            notes.extend(note(name, quoted_definition(name)));
        }
    }
    let sentence = match (file.well_defined, file.converged) {
        (true, true) => "A well-defined maximum.",
        (true, false) => "The search ran out of steps; the values may be improved from there.",
        (false, _) => "No well-defined maximum: at a prior boundary, or a degenerate direction.",
    };
    let search = file.blind_search.as_ref();
    let mut verdicts: Vec<(Tone, String)> = search.map(|search| verdicts::of(&search.verdict)).into_iter().collect();
    verdicts.push((tone(file.well_defined && file.converged), sentence.into()));
    Chapter {
        heading: "Optimum".into(),
        verdicts,
        warnings: file.warnings(),
        notes,
        tables: vec![(
            "The best parameters, with uncertainties from the curvature.".into(),
            table(&["parameter", "best", "uncertainty", "injected"], rows),
        )],
        ..Chapter::default()
    }
}

fn compared(file: &Comparison) -> Chapter {
    let dash = || NOTHING.to_owned();
    let mut rows = Vec::new();
    for (name, one) in file.names.iter().filter_map(|name| file.parameters.get_key_value(name)) {
        let digits = decimals(0.5 * (one.chain.ci68[1] - one.chain.ci68[0]));
        let mut row = |by: &str, Interval { value, ci68: [low, high] }: Interval, against: Option<&AgainstChain>| {
            rows.push(vec![
                label(name),
                by.into(),
                number(value, digits),
                format!("{} to {}", number(low, digits), number(high, digits)),
                number(against.map(|one| one.difference), 2),
                number(against.map(|one| one.width_ratio), 2),
            ]);
        };
        row("chain", one.chain, None);
        for (by, estimate) in [("paraboloid", &one.paraboloid), ("landscape", &one.landscape)] {
            if let Some(against) = estimate {
                row(by, against.interval, Some(against));
            }
        }
        if let Some(truth) = one.truth {
            rows.push(vec![label(name), "injected".into(), number(truth, digits), dash(), dash(), dash()]);
        }
    }
    let sentence = match file.converged {
        true => "The chain has converged.",
        false => "The chain has not converged: the comparison is of its draws so far.",
    };
    Chapter {
        heading: "Chain and likelihood grid".into(),
        verdicts: vec![(tone(file.converged), sentence.into())],
        warnings: file.notes.clone(),
        tables: vec![(
            "Estimates; differences and widths in error bars of the chain.".into(),
            table(&["parameter", "by", "value", "68 % interval", "difference", "width"], rows),
        )],
        ..Chapter::default()
    }
}

#[cfg(test)]
mod tests;
