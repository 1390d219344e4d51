//! What is said of each kind of result, from its file.

use super::chapter::{Chapter, NOTHING, Tone, number, pairs, parameters, table, tone};
use super::{injection, maps, planned, run, verdicts};
use crate::data::io::map::{FIT, MAP};
use crate::data::io::paraboloid::ParaboloidFile;
use crate::data::io::truth::{self, Truth, TruthFile};
use crate::figures::plot::PlotError;
use crate::figures::plot::symbols::{PERIOD_DIGITS, Shown, Speeds, decimals, label, symbol};
use crate::model::{Estimate, OrbitQuantity, Parameter, Quoted, definition, quoted_definition};
use crate::planets::verdict::{SIMULATED_FAP, probability};
use crate::runs::blind_search::{self, PeakRecord, PeriodogramFile};
use crate::runs::comparison::{self, AgainstChain, Comparison, Interval};
use crate::runs::grid_scan::{self, Header, PARABOLOID};
use crate::runs::optimum::{self, OptimumFile};
use crate::runs::{limits, manifest, origin, plan};
use crate::sampling::landscape::Axis;
use std::collections::BTreeMap;
use std::path::Path;

/// The chapter of the result that is known by `file`.
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
        // figures and no more
        _ => Chapter::default(),
    })
}

/// Decimals that show an error, where there is one.
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
    notes.push(file.co_rotation.statement.clone());
    notes.extend(file.evidence.as_ref().map(|evidence| evidence.sentence.clone()));
    let unit = Speeds::of(&file.peaks.iter().map(|peak| peak.orbit.k_kms).collect::<Vec<_>>());
    let peak = |peak: &PeakRecord| {
        let alias = peak.alias.as_ref().map(|alias| format!("of 1 at {:.3}/d", alias.window_frequency_per_d));
        vec![
            number(peak.orbit.period_d, digits_of(peak.orbit.sigma_period_d, PERIOD_DIGITS)),
            number(unit.factor * peak.orbit.k_kms, digits_of(Some(unit.factor * peak.orbit.sigma_k_kms), 3)),
            number(unit.factor * peak.orbit.sigma_k_kms, digits_of(Some(unit.factor * peak.orbit.sigma_k_kms), 3)),
            number(peak.orbit.delta_ln_l, 2),
            match peak.false_alarm_probability {
                p if p < SIMULATED_FAP => format!("< {SIMULATED_FAP:e}"),
                p => probability(p),
            },
            alias.unwrap_or_else(|| NOTHING.into()),
            peak.rotation.clone().unwrap_or_else(|| NOTHING.into()),
        ]
    };
    let beside = file.other_known().iter().map(|planet| &planet.verdict);
    let k = format!("*K* ({})", unit.name);
    let head = ["period (d)", &k, "*σ*_{K}", "Δ ln *L*", "FAP", "alias", "rotation"];
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

/// What a name means, where it has to be said.
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
    // an axis of a phase that goes once around is as long as that
    let length = |axis: &Axis| if axis.max > axis.min { axis.max - axis.min } else { axis.max - axis.min + 1.0 };
    let unbounded = axes.iter().find(|axis| estimate(axis).is_some_and(|one| one.error > 0.5 * length(axis)));
    let verdict = match (file.map(|file| &file.refused), unbounded) {
        (None, _) => (Tone::Doubt, "The landscape is not finished, or has no paraboloid.".to_owned()),
        (Some(Some(why)), _) => (Tone::Doubt, format!("There is no paraboloid: {why}.")),
        (_, Some(axis)) => (
            Tone::Doubt,
            format!(
                "A paraboloid fits around the highest node, but the error bar of {} is more than half its axis: the \
                 nodes do not bound it.",
                label(&axis.name)
            ),
        ),
        _ => (Tone::Good, "The highest node lies within the landscape and a paraboloid fits around it.".to_owned()),
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
        heading: "Chain against landscape".into(),
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
mod tests {
    use super::*;
    use crate::model::ParameterValues;
    use serde::de::DeserializeOwned;
    use serde_json::{Value, json};

    /// A file of which all is in `parts`, but for where it came from.
    fn file<T: DeserializeOwned>(parts: &[&Value]) -> T {
        let provenance = json!({ "version": "1", "data_sha256": "", "config_sha256": "", "config": {} });
        let all = parts.iter().copied().chain([&provenance]).flat_map(|part| part.as_object().unwrap().clone());
        serde_json::from_value(Value::Object(all.collect())).unwrap()
    }

    fn verdict(finding: &str) -> Value {
        json!({
            "finding": finding, "sentence": "Said once.", "false_alarm_probability": 1e-5, "signal": null, "against": []
        })
    }

    fn periodogram(finding: &str, warnings: &[&str]) -> Chapter {
        let peak = |period: f64, alias: Value| {
            json!({
                "k_kms": 0.1, "sigma_k_kms": 0.01, "period_d": period, "sigma_period_d": 0.1, "porb_over_prot": 2.0,
                "sigma_porb_over_prot": 0.1, "phi": 0.5, "sigma_phi": 0.02, "delta_ln_l": 20.0, "on_edge": false,
                "t_max_rv_d": null, "sigma_t_max_rv_d": null, "t_conjunction_d": 3.2, "sigma_t_conjunction_d": 0.1,
                "false_alarm_probability": 1e-5, "alias": alias, "rotation": null
            })
        };
        let alias = json!({ "window_frequency_per_d": 1.003, "window": 0.7, "relation": "difference of frequencies" });
        let level = |p: f64| json!({ "false_alarm_probability": p, "delta_ln_l": 5.0 });
        let levels = [0.1, 0.01, 0.001].map(level);
        let alarm = json!({
            "delta_ln_l": 20.0, "probability": 1e-5, "by_draws": 0.0, "by_extreme_value": 1e-5, "used": "extreme value",
            "draws": 1000, "w": 3.0, "independent_periods": 9.0,
            "levels": levels
        });
        let none = json!({ "k_kms": null, "sigma_k_kms": null, "phi": null, "delta_ln_l": null });
        let target = |target: f64| {
            let mut one = none.clone();
            (one["chi2_target"], one["reached"]) = (target.into(), true.into());
            one
        };
        let targets = [0.9, 1.0, 1.1].map(target);
        search(&file(&[
            &json!({ "verdict": verdict(finding), "warnings": warnings, "truth": null, "false_alarm": alarm }),
            &json!({ "best": peak(4.0, Value::Null), "peaks": [peak(4.0, Value::Null), peak(1.33, alias)] }),
            &json!({ "keplerian": null, "second": null, "offset": null }),
            &json!({ "search": {
                "periods": 100, "min_period_d": 1.0, "max_period_d": 9.0, "time_base_d": 9.0, "seed": 1
            } }),
            &json!({ "expansion": {
                "marginalised": [], "unresolved_spots": [1.0, 1.0], "regularised_delta_ln_l": 9.0, "rounds": 1,
                "closed": true, "data": 900, "chi2_target": 0.97, "chi2_per_datum_planet_free": 0.97,
                "chi2_per_datum": 0.97
            } }),
            &json!({ "co_rotation": { "sigma_k_over_median": null, "statement": "" } }),
            &json!({ "robustness": { "targets": targets, "without_night": [] } }),
        ]))
    }

    #[test]
    fn a_search_is_headed_by_its_own_verdict_and_nothing_is_green_beside_a_warning() {
        let tone = |finding: &str, warnings: &[&str]| {
            let chapter = periodogram(finding, warnings);
            let (tone, sentence) = chapter.shown_verdicts().next().unwrap();
            assert_eq!(sentence, "Said once.");
            tone
        };
        assert_eq!(tone("detection", &[]), Tone::Good);
        assert_eq!(tone("detection", &["one night decides"]), Tone::Neutral);
        assert_eq!(tone("candidate", &[]), Tone::Doubt);
        assert_eq!(tone("no-planet-needed", &[]), Tone::Neutral);
        let chapter = periodogram("detection", &[]);
        // of what is usually quoted, only what is known
        assert_eq!(chapter.tables[0].1.rows.len(), 5);
        // spots are nowhere, aliases are
        let peaks = chapter.tables[1].1.without_empty_columns();
        assert_eq!(peaks.head, ["period (d)", "*K* (m/s)", "*σ*_{K}", "Δ ln *L*", "FAP", "alias"]);
        assert_eq!(peaks.rows[1], ["1.33", "100", "10", "20.00", "< 1e-4", "of 1 at 1.003/d"]);
    }

    #[test]
    fn what_a_map_warns_of_is_told_and_it_does_not_converge() {
        let chapter = |status: &str| {
            let parameters = ParameterValues::of_eight([0.1, 1.7, 0.5, 2.1, 0.0, 40.0, 30.0, 0.0]);
            maps::chapter(&file(&[
                &json!({ "status": status, "chi2": 9.0, "chi2_per_datum": 0.97, "chi2_target": 9.0, "lambda": 1.0 }),
                &json!({ "alpha": 1.0, "entropy": -1.0, "spottedness": 0.1, "test": 0.0, "model_applications": 9 }),
                &json!({ "newton_steps": 3, "profiles": 2, "data": 9, "pixels": 100, "equivalent_width_kms": 5.0 }),
                &json!({ "contrast": 0.3, "parameters": parameters, "truth": null, "trade_off": [] }),
                &json!({ "observed_rv_rms_kms": 0.1, "filtered_rv_rms_kms": 0.1, "photon_rv_error_kms": 0.1 }),
                &json!({ "residual_rms": 1e-3, "residual_rms_core": 1e-3, "sigma_rms": 1e-3 }),
                &json!({ "checks": {
                    "profiles": [], "chi2_per_datum_core": 1.0, "chi2_per_datum_outside": 1.0, "core_excess_sigma": 0.0,
                    "neighbour_correlation": 0.5, "sigma_neighbour_correlation": 0.1,
                    "warnings": ["neighbours are correlated"]
                } }),
            ]))
        };
        let short = chapter("stopped-short");
        assert_eq!(short.warnings, ["neighbours are correlated"]);
        let (tone, sentence) = short.shown_verdicts().next().unwrap();
        assert_eq!(tone, Tone::Doubt);
        assert!(sentence.contains("stopped short of the target χ²") && !sentence.contains("converge"), "{sentence}");
        assert_eq!(chapter("converged").shown_verdicts().next().unwrap().0, Tone::Neutral);
    }

    #[test]
    fn an_optimum_is_headed_by_the_blind_search() {
        let remarks = json!([{ "against": null, "text": "few profiles" }]);
        let search = json!({ "verdict": verdict("no-planet-needed"), "remarks": remarks, "rotation": null });
        let reference = json!({
            "parameters": {}, "chi2_target": 9.0, "chi2": 9.0, "lambda": 1.0, "entropy": 0.0, "spottedness": 0.1,
            "chi2_reach": 1.0, "data": 9
        });
        let chapter = best(&file(&[
            &json!({ "names": [], "parameters": {}, "sd": {}, "log_prob": 0.0, "chi2": 9.0, "spottedness": 0.1 }),
            &json!({ "well_defined": true, "converged": true, "covariance": [], "internal_curvature": [] }),
            &json!({ "blind_search": search, "truth": null, "reference": reference, "starts": [] }),
            &json!({ "profiles": 2, "time_span_d": [0.0, 1.0] }),
        ]));
        let said: Vec<(Tone, &str)> = chapter.shown_verdicts().collect();
        assert_eq!(said, [(Tone::Neutral, "Said once."), (Tone::Neutral, "A well-defined maximum.")]);
        assert_eq!(chapter.warnings, ["few profiles"]);
    }
}
