//! Tests of the chapters of a report.

use super::*;
use crate::model::ParameterValues;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

/// A file whose content is in `parts`, except its provenance.
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
    // only known ones among the commonly quoted quantities
    assert_eq!(chapter.tables[0].1.rows.len(), 5);
    // no column for spots, one for aliases
    let peaks = chapter.tables[1].1.without_empty_columns();
    assert_eq!(peaks.head, ["period (d)", "*K* (m/s)", "*σ*_{K} (m/s)", "Δ ln *L*", "FAP", "alias"]);
    assert_eq!(peaks.rows[1], ["1.33", "100", "10", "20.00", "< 1e-3", "of peak 1 by sampling at 1.003/d"]);
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
