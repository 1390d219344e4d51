//! `dimcmc periodogram` as users run it: files, names, refusals, and a fit from outside that gives the same orbit.

use crate::desk::{Desk, dimcmc, says, text};
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

/// The demo on few pixels.
fn demo() -> Desk {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json");
    let mut config: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    config.as_object_mut().unwrap().remove("$schema");
    config["imaging"]["pixels"] = json!(300);
    // the same pixels, so that few of them are enough
    config["observations"]["simulate"]["pixels"] = json!(300);
    Desk::new(config)
}

/// Names and columns of a CSV file.
fn columns(csv: &str) -> (Vec<&str>, Vec<Vec<f64>>) {
    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    let columns = (0..names.len()).map(|k| rows.iter().map(|row| row[k]).collect()).collect();
    (names, columns)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

#[test]
fn the_planet_of_the_demo_is_found() {
    let desk = demo();
    let table = desk.succeed(&["periodogram", "config.json", "--out", "a", "--eccentric", "--planets", "2"]);
    says(&table, &["k_kms", "truth", "FAP", "delta_ln_l", "eccentric orbit", "second planet"]);
    says(&table, &["At P = P_rot", "a: rv.csv, covariance.csv, periodogram.csv, periodogram_2.csv, periodogram.json"]);
    says(&table, &["t_conjunction_d: ", "(planet in front) nearest to the middle of the data"]);

    let found = desk.json("a/periodogram.json");
    let best = &found["best"];
    for (name, sigma) in [("k_kms", "sigma_k_kms"), ("porb_over_prot", "sigma_porb_over_prot"), ("phi", "sigma_phi")] {
        let off = (number(&best[name]) - number(&found["truth"][name])) / number(&best[sigma]);
        assert!(off.abs() < 3.0, "{name}: {off} sigma");
    }
    assert!((number(&best["period_d"]) / number(&best["porb_over_prot"]) - 3.0).abs() < 1e-12);
    assert!(number(&found["false_alarm"]["probability"]) < 1e-6);
    assert_eq!(found["false_alarm"]["used"], "extreme value");
    assert!(number(&found["second"]["false_alarm"]["probability"]) > 1e-3);
    assert_eq!(found["expansion"]["closed"], true);
    assert!(number(&found["co_rotation"]["sigma_k_over_median"]) > 1.5);
    assert!(number(&found["keplerian"][0]["gain_over_circle"]) >= 0.0);
    assert_eq!(found["config"]["imaging"]["pixels"], 300);

    let rv = desk.read("a/rv.csv");
    let (names, rv) = columns(&rv);
    let moments = ["first_moment_kms", "first_moment_sigma_kms", "filtered_kms"];
    assert_eq!(names, [&["time_d", "cycle", "rv_kms", "rv_sigma_kms"][..], &moments].concat());
    let covariance = desk.read("a/covariance.csv");
    let rows = covariance.lines().flat_map(|line| line.split(',').map(|x| x.parse().unwrap()));
    let covariance = DMatrix::<f64>::from_row_iterator(rv[0].len(), rv[0].len(), rows);
    for (k, sigma) in rv[3].iter().enumerate() {
        assert!((covariance[(k, k)].sqrt() - sigma).abs() < 1e-12);
    }

    // generalised least squares from the files alone
    let period_d = number(&best["period_d"]);
    let x = DMatrix::from_fn(rv[0].len(), 2, |k, c| {
        let angle = std::f64::consts::TAU * rv[0][k] / period_d;
        if c == 0 { angle.cos() } else { angle.sin() }
    });
    let weights = covariance.cholesky().unwrap();
    let velocities = DVector::from_column_slice(&rv[2]);
    let ab = (x.tr_mul(&weights.solve(&x))).cholesky().unwrap().solve(&x.tr_mul(&weights.solve(&velocities)));
    assert!((ab.norm() - number(&best["k_kms"])).abs() < 1e-6, "{} {}", ab.norm(), best["k_kms"]);
    let phi = (ab[1].atan2(ab[0]) / std::f64::consts::TAU).rem_euclid(1.0);
    assert!((phi - number(&best["phi"])).abs() < 1e-5);
    python_fits_the_same(&desk, number(&best["k_kms"]));

    for file in ["a/periodogram.csv", "a/periodogram_2.csv"] {
        let csv = desk.read(file);
        let (names, table) = columns(&csv);
        let first = ["period_d", "porb_over_prot", "frequency_per_d", "delta_ln_l", "k_kms", "sigma_k_kms", "phi"];
        let rest = ["sigma_phi", "k_upper95_kms", "window", "k_limit_kms", "k_limit95_kms"];
        let more = if file.contains("_2") { &[][..] } else { &["regularised_delta_ln_l"] };
        assert_eq!(names, [&first[..], &rest, more].concat());
        // 3 days to the rotation, and twice the time base of 2.94 rotations
        assert!((table[0][0] - 2.0 * 2.94 * 3.0).abs() < 1e-9);
        let inverse = |(period, frequency): (&f64, &f64)| (period * frequency - 1.0).abs() < 1e-12;
        assert!(table[0].iter().zip(&table[2]).all(inverse));
        let bounded = (0..table[0].len()).filter(|k| table[3][*k].is_finite());
        for k in bounded {
            assert!(table[3][k] >= 0.0 && table[8][k] > table[4][k], "{file} {k}");
            assert!((0.0..1.0).contains(&table[6][k]) && table[10][k] < table[11][k], "{file} {k}");
        }
    }
}

/// The example of the guide, where there is a Python that can run it.
fn python_fits_the_same(desk: &Desk, k_kms: f64) {
    let numpy = Command::new("python3").args(["-c", "import numpy"]).output();
    if !numpy.is_ok_and(|output| output.status.success()) {
        println!("skipped: there is no python3 with numpy");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/gls_fit.py");
    let output = Command::new("python3").arg(script).arg(desk.path("a")).output().unwrap();
    let line = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let found: f64 = line.strip_prefix("K = ").unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((found - k_kms).abs() < 1e-6, "{line}");
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn threads_do_not_change_a_byte() {
    let desk = demo();
    for (threads, out) in [("1", "a"), ("2", "b")] {
        let options = ["--draws", "1000", "--eccentric", "--marginalise"];
        desk.succeed(&[&["periodogram", "config.json", "--out", out, "--threads", threads][..], &options].concat());
    }
    for file in ["rv.csv", "covariance.csv", "periodogram.csv", "periodogram.json"] {
        assert_eq!(desk.read(&format!("a/{file}")), desk.read(&format!("b/{file}")), "{file}");
    }
}

#[test]
fn options_that_make_no_sense_are_refused_by_name() {
    let desk = demo();
    for (options, part) in [
        (&["--min-period-d", "nan"][..], "--min-period-d: must be a positive number, not NaN"),
        (&["--min-period-d", "0"], "--min-period-d"),
        (&["--max-period-d", "-2"], "--max-period-d"),
        (&["--max-period-d", "inf"], "--max-period-d"),
        (&["--max-period-d", "0.01"], "--max-period-d: the shortest period (0.36"),
        (&["--min-period-d", "5", "--max-period-d", "4"], "--min-period-d: the shortest period (5 d)"),
        (&["--min-period-d", "1e-9"], "--min-period-d"),
        (&["--oversampling", "1e7"], "--oversampling"),
        (&["--oversampling", "0"], "--oversampling"),
    ] {
        // a value may begin with a minus
        let options: Vec<String> = options.chunks(2).map(|pair| format!("{}={}", pair[0], pair[1])).collect();
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        says(&desk.refusal(&[&["periodogram", "config.json", "--out", "x"], &options[..]].concat()), &[part]);
    }
    for (option, value) in [("--planets", "3"), ("--planets", "0"), ("--draws", "10")] {
        let output = dimcmc(&["periodogram", "config.json", "--out", "x", option, value], &desk.path(""));
        assert_eq!(output.status.code(), Some(2));
        says(&text(&output.stderr), &["error: ", option]);
    }
    desk.set("/observations/simulate/cycles", json!([0.0, 0.4]));
    says(&desk.refusal(&["periodogram", "config.json", "--out", "x"]), &["config.json: observations", "three"]);
}

/// A target that no map without the planet reaches is not fatal: the planet may explain the misfit.
#[test]
fn a_massive_planet_is_found_in_spite_of_the_target() {
    let mut desk = demo();
    desk.config["parameters"] = json!({});
    desk.config.as_object_mut().unwrap().remove("grid");
    desk.set("/planet", json!({ "k_kms": 2.0, "porb_over_prot": 1.7, "phi": 0.5 }));
    desk.succeed(&["periodogram", "config.json", "--out", "a"]);
    let best = &desk.json("a/periodogram.json")["best"];
    let off = (number(&best["k_kms"]) - 2.0) / number(&best["sigma_k_kms"]);
    assert!(off.abs() < 4.0, "{off} sigma");
}

/// A simulated star with evolving spots, made by another program (`tests/data/evolving`).
fn changing(objective: Value) -> Desk {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/evolving/slow-planet");
    let mut config: Value = serde_json::from_slice(&std::fs::read(folder.join("config.json")).unwrap()).unwrap();
    config["observations"]["path"] = json!(folder.join("observations.txt"));
    config["imaging"]["objective"] = objective;
    config["imaging"]["pixels"] = json!(400);
    Desk::new(config)
}

#[test]
fn a_star_that_changes_is_not_judged_by_one_map() {
    let desk = changing(json!("spottedness"));
    let table = desk.succeed(&["periodogram", "config.json", "--out", "a"]);
    says(&table, &["No verdict: significant spot evolution", "marginal-likelihood"]);
    let found = desk.json("a/periodogram.json");
    assert_eq!(found["verdict"]["finding"], "not-judged");
    assert!(found["verdict"]["false_alarm_probability"].is_null());
    assert!(number(&found["change"]["ln_evidence_gain"]) > 20.0);
    let table = desk.succeed(&["limits", "config.json", "--out", "b", "--periods", "3", "--phases", "2"]);
    says(&table, &["Limits invalid: significant spot evolution"]);
}

#[test]
fn all_maps_of_a_star_that_changes_are_integrated_over() {
    let desk = changing(json!("marginal-likelihood"));
    let table = desk.succeed(&["periodogram", "config.json", "--out", "a"]);
    says(&table, &["spots (marginalised): amplitude"]);
    let found = desk.json("a/periodogram.json");
    let (best, field) = (&found["best"], &found["field"]);
    // what was simulated: K of 0.1 km/s at 1.7 rotations
    assert!((number(&best["k_kms"]) - 0.1).abs() < 3.0 * number(&best["sigma_k_kms"]), "{best}");
    assert!((number(&best["porb_over_prot"]) - 1.7).abs() < 0.2, "{best}");
    assert!((5.0..200.0).contains(&number(&field["spot_lifetime_d"])), "{field}");
    assert!(found["change"].is_null() && found["robustness"]["targets"].as_array().unwrap().is_empty());

    // priors that exclude this orbit, and allow any K
    let mut elsewhere = desk.config.clone();
    elsewhere["planet"] = json!({ "k_kms": 0.1, "porb_over_prot": 0.5, "phi": 0.2 });
    elsewhere["parameters"]["k_kms"] = json!({ "prior": "uniform", "min": 0, "max": 150 });
    elsewhere["parameters"]["porb_over_prot"] = json!({ "prior": "uniform", "min": 0.3, "max": 0.9 });
    desk.write("elsewhere.json", &elsewhere.to_string());
    let table = desk.succeed(&["periodogram", "elsewhere.json", "--out", "b"]);
    says(&table, &["lies outside the period prior and may alias into it", "The prior of K is far wider than σ_K"]);
    let other = desk.json("b/periodogram.json");
    assert_eq!(other["best"], *best, "the search is the same");
    assert_eq!(other["verdict"]["finding"], "no-planet-needed");
    let of_verdict = number(&other["verdict"]["signal"]["period_d"]);
    assert!(of_verdict < 0.6 * number(&best["period_d"]), "the highest peak within the priors: {of_verdict}");
}
