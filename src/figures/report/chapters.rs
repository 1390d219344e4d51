//! What is said of each kind of result, from its file.

use super::{Chapter, NOTHING, Table, Tone, injection, is_empty, run, verdicts};
use crate::figures::plot::PlotError;
use crate::figures::plot::symbols::{PERIOD_DIGITS, decimals, label, symbol};
use crate::planets::verdict::probability;
use crate::posterior::objective::{OrbitQuantity, Parameter, definition};
use crate::runs::grid_scan::PARABOLOID;
use crate::runs::manifest;
use crate::runs::origin;
use serde_json::Value;
use std::path::Path;

/// The chapter of the result that is known by `file`, and the file that has its config.
pub(super) fn of(folder: &Path, file: &'static str) -> Result<(Chapter, Value), PlotError> {
    let whole: Value = origin::read(folder, file)?;
    Ok(match file {
        manifest::FILE => (run::chapter(folder)?, whole),
        "map.json" => {
            let fit = if folder.join("fit.json").is_file() { origin::read(folder, "fit.json")? } else { whole };
            (map(&fit), fit)
        }
        "periodogram.json" => (periodogram(&whole), whole),
        "landscape.json" => {
            let present = folder.join(PARABOLOID).is_file();
            let paraboloid = if present { origin::read(folder, PARABOLOID)? } else { Value::Null };
            (landscape(&whole, &paraboloid), whole)
        }
        "optimum.json" => (optimum(&whole), whole),
        "comparison.json" => (comparison(&whole), whole),
        "limits.json" => (injection::limits(&whole), whole),
        _ if whole.get("injected").is_some() => (injection::injection(&whole), whole),
        _ => (simulation(&whole), whole),
    })
}

/// A number of a file with so many decimals; a dash where there is none.
pub(super) fn number(file: &Value, pointer: &str, digits: usize) -> String {
    file.pointer(pointer).and_then(Value::as_f64).map_or_else(|| NOTHING.into(), |x| format!("{x:.digits$}"))
}

pub(super) fn texts(file: &Value, key: &str) -> Vec<String> {
    let list = file.get(key).and_then(Value::as_array);
    list.into_iter().flatten().filter_map(|text| text.as_str().map(str::to_owned)).collect()
}

/// A table of names and values, those without one left out.
pub(super) fn pairs(rows: &[(&str, String)]) -> Table {
    let told = rows.iter().filter(|(_, value)| !is_empty(value));
    Table { head: Vec::new(), rows: told.map(|(name, value)| vec![(*name).to_owned(), value.clone()]).collect() }
}

fn table(head: &[&str], rows: Vec<Vec<String>>) -> Table {
    Table { head: head.iter().map(|text| (*text).to_owned()).collect(), rows }
}

fn map(fit: &Value) -> Chapter {
    let converged = fit.get("status").and_then(Value::as_str) == Some("converged");
    let sentence = match converged {
        true => "The map reaches the target chi2 and is the one of greatest entropy that does.",
        false => {
            "The reconstruction stopped short of the target chi2: this map is not the one of greatest entropy there."
        }
    };
    let spottedness = match fit.get("darkness") {
        None => ("spot coverage", number(fit, "/spottedness", 4)),
        Some(_) => ("brightness minus 1, rms (mean of dark, of bright parts)", deviation(fit)),
    };
    let rows = [
        ("chi2 per datum", number(fit, "/chi2_per_datum", 4)),
        ("data in profiles", format!("{} in {}", number(fit, "/data", 0), number(fit, "/profiles", 0))),
        spottedness,
        ("entropy", number(fit, "/entropy", 4)),
        ("scatter of the radial velocities (km/s)", number(fit, "/observed_rv_rms_kms", 4)),
        ("the same with the model taken out (km/s)", number(fit, "/filtered_rv_rms_kms", 4)),
        ("photon noise of a radial velocity (km/s)", number(fit, "/photon_rv_error_kms", 4)),
        ("residuals, rms", number(fit, "/residual_rms", 6)),
        ("pixels", number(fit, "/pixels", 0)),
    ];
    Chapter {
        heading: "Map".into(),
        verdicts: vec![(tone(converged), sentence.into())],
        warnings: fit.get("checks").map(|checks| texts(checks, "warnings")).unwrap_or_default(),
        tables: vec![("The fit.".into(), pairs(&rows)), ("Parameters of star and orbit.".into(), parameters(fit))],
        ..Chapter::default()
    }
}

fn tone(good: bool) -> Tone {
    if good { Tone::Good } else { Tone::Doubt }
}

/// How far the brightness is from that of the photosphere.
fn deviation(fit: &Value) -> String {
    let [rms, dark, bright] = ["/spottedness", "/darkness", "/brightness_excess"].map(|key| number(fit, key, 4));
    format!("{rms} ({dark}, {bright})")
}

/// The parameters of a file, and the injected ones where it has them.
fn parameters(file: &Value) -> Table {
    let Some(all) = file.get("parameters").and_then(Value::as_object) else { return Table::default() };
    let truth = file.get("truth").filter(|truth| truth.is_object());
    let row = |name: &String| {
        let mut row = vec![label(name), number(file, &format!("/parameters/{name}"), 4)];
        row.extend(truth.map(|truth| number(truth, &format!("/{name}"), 4)));
        row
    };
    let head: &[&str] = if truth.is_some() { &["parameter", "value", "injected"] } else { &["parameter", "value"] };
    let known = Parameter::ALL.map(Parameter::name).map(str::to_owned);
    table(head, known.iter().filter(|name| all.contains_key(*name)).map(row).collect())
}

fn simulation(truth: &Value) -> Chapter {
    let snr = truth.get("snr").and_then(Value::as_f64).map_or_else(|| "no noise".into(), |snr| format!("{snr}"));
    let rows = [("spot coverage", number(truth, "/spottedness", 4)), ("signal-to-noise ratio of a bin", snr)];
    Chapter {
        heading: "Simulation".into(),
        tables: vec![("Simulated data.".into(), pairs(&rows)), ("Injected parameters.".into(), parameters(truth))],
        ..Chapter::default()
    }
}

fn periodogram(file: &Value) -> Chapter {
    let peaks = file.get("peaks").and_then(Value::as_array).cloned().unwrap_or_default();
    let best = |key: &str, sigma: &str| {
        let digits = file.pointer(&format!("/best/{sigma}")).and_then(Value::as_f64).map_or(3, decimals);
        vec![
            number(file, &format!("/best/{key}"), digits),
            number(file, &format!("/best/{sigma}"), digits),
            number(file, &format!("/truth/{key}"), digits),
        ]
    };
    let rows = [("k_kms", "sigma_k_kms"), ("porb_over_prot", "sigma_porb_over_prot"), ("phi", "sigma_phi")];
    let mut orbit: Vec<Vec<String>> =
        rows.into_iter().map(|(key, sigma)| [vec![label(key)], best(key, sigma)].concat()).collect();
    orbit.insert(1, [vec!["*P*_{orb} (d)".into()], best("period_d", "sigma_period_d")].concat());
    let quantities = ["t_max_rv_d", "t_conjunction_d", "msini_mjup"];
    orbit.extend(
        quantities.into_iter().filter(|name| file.pointer(&format!("/best/{name}")).is_some_and(Value::is_number)).map(
            |name| {
                let mut cells = best(name, &format!("sigma_{name}"));
                let digits = file.pointer(&format!("/best/sigma_{name}")).and_then(Value::as_f64).map_or(3, decimals);
                cells[2] = number(file, &format!("/derived_truth/{name}"), digits);
                [vec![label(name)], cells].concat()
            },
        ),
    );
    let peak = |peak: &Value| {
        let chance = peak.get("false_alarm_probability").and_then(Value::as_f64);
        let chance = chance.map_or_else(|| NOTHING.into(), probability);
        vec![
            number(peak, "/period_d", PERIOD_DIGITS),
            number(peak, "/k_kms", 3),
            number(peak, "/sigma_k_kms", 3),
            number(peak, "/delta_ln_l", 2),
            chance,
            alias(peak).unwrap_or_else(|| NOTHING.into()),
            peak.get("rotation").and_then(Value::as_str).unwrap_or(NOTHING).to_owned(),
        ]
    };
    let told = |name: &&str| file.pointer(&format!("/best/{name}")).is_some_and(Value::is_number);
    let meaning = |name: &str| Some(format!("{}: {}.", symbol(name).0, definition(name)?));
    let mut notes: Vec<String> = ["phi"].into_iter().chain(quantities).filter(told).filter_map(meaning).collect();
    notes.extend(file.pointer("/co_rotation/statement").and_then(Value::as_str).map(str::to_owned));
    let head = ["period (d)", "*K* (km/s)", "*σ*_{K}", "Δ ln *L*", "false alarm", "alias", "period of the star"];
    Chapter {
        heading: "Search for a planet".into(),
        verdicts: verdicts::at(file, "/verdict").into_iter().collect(),
        warnings: texts(file, "warnings"),
        notes,
        tables: vec![
            ("The best orbit.".into(), table(&["parameter", "best", "error", "injected"], orbit)),
            ("Peaks of the periodogram.".into(), table(&head, peaks.iter().map(peak).collect())),
        ],
    }
}

/// How a peak is an alias of the highest.
fn alias(peak: &Value) -> Option<String> {
    let frequency = peak.pointer("/alias/window_frequency_per_d")?.as_f64()?;
    Some(format!("of the first, by {frequency:.3}/d"))
}

fn landscape(header: &Value, paraboloid: &Value) -> Chapter {
    let axes = header.pointer("/grid/axes").and_then(Value::as_array).cloned().unwrap_or_default();
    let name = |axis: &Value| axis.get("name").and_then(Value::as_str).unwrap_or_default().to_owned();
    let row = |axis: &Value| {
        let name = name(axis);
        let error = paraboloid.pointer(&format!("/parameters/{name}/error")).and_then(Value::as_f64);
        let digits = error.map_or(4, decimals);
        let range = format!("{} to {}", number(axis, "/min", 4), number(axis, "/max", 4));
        let vertex = number(paraboloid, &format!("/parameters/{name}/vertex"), digits);
        let truth = number(header, &format!("/truth/{name}"), digits);
        let error = number(paraboloid, &format!("/parameters/{name}/error"), digits);
        vec![label(&name), range, number(axis, "/nodes", 0), vertex, error, truth]
    };
    let refused = paraboloid.get("refused").and_then(Value::as_str);
    let verdict = match (paraboloid, refused) {
        (Value::Null, _) => (Tone::Doubt, "The landscape is not finished, or has no paraboloid.".to_owned()),
        (_, Some(why)) => (Tone::Doubt, format!("There is no paraboloid: {why}.")),
        _ => match unbounded(&axes, paraboloid) {
            Some(name) => (
                Tone::Doubt,
                format!(
                    "A paraboloid fits around the highest node, but the error bar of {} is more than half its axis: \
                    the nodes \
                     do not bound it.",
                    label(&name)
                ),
            ),
            None => {
                (Tone::Good, "The highest node lies within the landscape and a paraboloid fits around it.".to_owned())
            }
        },
    };
    let fit = [
        ("nodes that it was fitted to", number(paraboloid, "/nodes", 0)),
        ("residuals, rms (chi2)", number(paraboloid, "/rms_chi2", 3)),
        ("nodes reach above the lowest chi2 by", number(paraboloid, "/delta_chi2", 2)),
    ];
    let fitted = if paraboloid.get("nodes").is_some() { pairs(&fit) } else { Table::default() };
    let head = ["parameter", "axis", "nodes", "vertex", "error", "injected"];
    Chapter {
        heading: "Landscape".into(),
        verdicts: vec![verdict],
        tables: vec![
            ("Axes and paraboloid.".into(), table(&head, axes.iter().map(row).collect())),
            ("Fit of the paraboloid.".into(), fitted),
        ],
        ..Chapter::default()
    }
}

/// The first axis that is shorter than two error bars.
fn unbounded(axes: &[Value], paraboloid: &Value) -> Option<String> {
    let is_short = |axis: &&Value| {
        let end = |key: &str| axis.get(key).and_then(Value::as_f64);
        let name = axis.get("name").and_then(Value::as_str).unwrap_or_default();
        let error = paraboloid.pointer(&format!("/parameters/{name}/error")).and_then(Value::as_f64);
        // an axis of a phase that goes once around is as long as that
        let length = end("max").zip(end("min")).map(|(max, min)| if max > min { max - min } else { max - min + 1.0 });
        error.zip(length).is_some_and(|(error, length)| error > 0.5 * length)
    };
    axes.iter().find(is_short).and_then(|axis| axis.get("name")?.as_str().map(str::to_owned))
}

fn optimum(file: &Value) -> Chapter {
    let names = texts(file, "names");
    let row = |name: &String| {
        let digits = file.pointer(&format!("/sd/{name}")).and_then(Value::as_f64).map_or(4, decimals);
        let value = |section: &str| number(file, &format!("/{section}/{name}"), digits);
        vec![label(name), value("parameters"), value("sd"), value("truth")]
    };
    let derived = OrbitQuantity::ALL.map(OrbitQuantity::name);
    let derived = derived.into_iter().filter(|name| file.pointer(&format!("/derived/{name}")).is_some());
    let derived_row = |name: &str| {
        let sd = format!("/derived/{name}/sd");
        let digits = file.pointer(&sd).and_then(Value::as_f64).map_or(4, decimals);
        let value = |pointer: &str| number(file, pointer, digits);
        let [best, truth] = [format!("/derived/{name}/value"), format!("/derived_truth/{name}")];
        vec![label(name), value(&best), value(&sd), value(&truth)]
    };
    let rows = names.iter().map(row).chain(derived.clone().map(derived_row)).collect();
    let shown = names.iter().map(String::as_str).chain(derived);
    let notes = shown.filter_map(|name| Some(format!("{}: {}.", symbol(name).0, definition(name)?))).collect();
    let is = |key: &str| file.get(key).and_then(Value::as_bool).unwrap_or(false);
    let (defined, converged) = (is("well_defined"), is("converged"));
    let sentence = match (defined, converged) {
        (true, true) => "A well-defined maximum.",
        (true, false) => "The search ran out of steps; the values may be improved from there.",
        (false, _) => "No well-defined maximum: on the edge of a prior, or the data leave some direction open.",
    };
    let mut verdicts: Vec<(Tone, String)> = verdicts::at(file, "/blind_search/verdict").into_iter().collect();
    verdicts.push((tone(defined && converged), sentence.into()));
    let remarks = file.pointer("/blind_search/remarks").and_then(Value::as_array).into_iter().flatten();
    let remarks = remarks.filter_map(|remark| remark.get("text")?.as_str().map(str::to_owned));
    let reference = file
        .get("reference")
        .and_then(|record| serde_json::from_value::<origin::ReferenceRecord>(record.clone()).ok()?.warning());
    Chapter {
        heading: "Optimum".into(),
        verdicts,
        warnings: remarks.chain(reference).collect(),
        notes,
        tables: vec![(
            "The best parameters, with errors from the curvature.".into(),
            table(&["parameter", "best", "error", "injected"], rows),
        )],
    }
}

fn comparison(file: &Value) -> Chapter {
    let mut rows = Vec::new();
    for name in texts(file, "names") {
        let at = |rest: &str| format!("/parameters/{name}/{rest}");
        let get = |rest: &str| file.pointer(&at(rest)).and_then(Value::as_f64);
        let half = get("chain/ci68/1").zip(get("chain/ci68/0")).map(|(high, low)| 0.5 * (high - low));
        let digits = half.map_or(4, decimals);
        for by in ["chain", "paraboloid", "landscape"] {
            if get(&format!("{by}/value")).is_some() {
                let value = |rest: &str, digits| number(file, &at(&format!("{by}/{rest}")), digits);
                let interval = format!("{} to {}", value("ci68/0", digits), value("ci68/1", digits));
                rows.push(vec![
                    label(&name),
                    by.into(),
                    value("value", digits),
                    interval,
                    value("difference", 2),
                    value("width_ratio", 2),
                ]);
            }
        }
        if get("truth").is_some() {
            let dash = || NOTHING.to_owned();
            rows.push(vec![
                label(&name),
                "injected".into(),
                number(file, &at("truth"), digits),
                dash(),
                dash(),
                dash(),
            ]);
        }
    }
    let converged = file.get("converged").and_then(Value::as_bool).unwrap_or(false);
    let sentence = if converged {
        "The chain has converged."
    } else {
        "The chain has not converged: the comparison is of its draws so far."
    };
    Chapter {
        heading: "Chain against landscape".into(),
        verdicts: vec![(tone(converged), sentence.into())],
        warnings: texts(file, "notes"),
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
    use serde_json::json;

    #[test]
    fn a_search_is_headed_by_its_own_verdict_and_nothing_is_green_beside_a_warning() {
        let search = |finding: &str, warnings: &[&str]| {
            let alias = json!({ "window_frequency_per_d": 1.003, "window": 0.7 });
            let peak = |period: f64, alias: Value| {
                json!({
                    "period_d": period, "delta_ln_l": 20.0, "false_alarm_probability": 1e-5, "alias": alias
                })
            };
            let sentence = "Said once.";
            periodogram(&json!({
                "verdict": {
                    "finding": finding, "sentence": sentence, "false_alarm_probability": 1e-5, "signal": null,
                    "against": []
                },
                "peaks": [peak(4.0, Value::Null), peak(1.33, alias)], "warnings": warnings
            }))
        };
        let tone = |finding: &str, warnings: &[&str]| {
            let chapter = search(finding, warnings);
            let (tone, sentence) = chapter.shown_verdicts().next().unwrap();
            assert_eq!(sentence, "Said once.");
            tone
        };
        assert_eq!(tone("detection", &[]), Tone::Good);
        assert_eq!(tone("detection", &["one night decides"]), Tone::Neutral);
        assert_eq!(tone("candidate", &[]), Tone::Doubt);
        assert_eq!(tone("no-planet-needed", &[]), Tone::Neutral);
        let chapter = search("detection", &[]);
        // errors and spots are nowhere, aliases are
        let peaks = chapter.tables[1].1.without_empty_columns();
        assert_eq!(peaks.head, ["period (d)", "Δ ln *L*", "false alarm", "alias"]);
        assert_eq!(peaks.rows[1], ["1.3300", "20.00", "1.0e-5", "of the first, by 1.003/d"]);
    }

    #[test]
    fn what_a_map_warns_of_is_told_and_it_does_not_converge() {
        let fit = json!({ "status": "max-passes", "checks": { "warnings": ["neighbours are correlated"] } });
        let chapter = map(&fit);
        assert_eq!(chapter.warnings, ["neighbours are correlated"]);
        let (tone, sentence) = chapter.shown_verdicts().next().unwrap();
        assert_eq!(tone, Tone::Doubt);
        assert!(sentence.contains("stopped short of the target chi2") && !sentence.contains("converge"), "{sentence}");
        let fit = json!({ "status": "converged", "checks": { "warnings": ["neighbours are correlated"] } });
        assert_eq!(map(&fit).shown_verdicts().next().unwrap().0, Tone::Neutral);
    }

    #[test]
    fn an_optimum_is_headed_by_the_blind_search() {
        let verdict = json!({
            "finding": "no-planet-needed", "sentence": "No planet.", "false_alarm_probability": 0.7, "signal": null,
            "against": []
        });
        let remarks = json!([{ "text": "few profiles" }]);
        let chapter = optimum(&json!({
            "names": [], "well_defined": true, "converged": true,
            "blind_search": { "verdict": verdict, "remarks": remarks }
        }));
        let said: Vec<(Tone, &str)> = chapter.shown_verdicts().collect();
        assert_eq!(said, [(Tone::Neutral, "No planet."), (Tone::Neutral, "A well-defined maximum.")]);
        assert_eq!(chapter.warnings, ["few profiles"]);
    }

    #[test]
    fn a_landscape_shorter_than_its_error_bars_is_doubtful() {
        let good = |error: f64| {
            let header = json!({ "grid": { "axes": [{ "name": "k_kms", "min": 0.1, "max": 0.3, "nodes": 9 }] } });
            let estimate = json!({ "vertex": 0.2, "error": error });
            landscape(&header, &json!({ "parameters": { "k_kms": estimate }, "nodes": 9, "rms_chi2": 0.01 })).verdicts
                [0]
            .0
        };
        assert_eq!((good(0.09), good(0.11)), (Tone::Good, Tone::Doubt));
    }
}
