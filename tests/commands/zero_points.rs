//! RV jitter: its effect on the information, its measurement, and its report.

use crate::desk::{Desk, dimcmc, says, star, text};
use dimcmc::internals::data::config::Config;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::model::Parameter;
use dimcmc::internals::surface::calibration::jitter::ZeroPoints;
use dimcmc::internals::surface::expansion::Expansion;
use dimcmc::internals::surface::imaging::Imager;
use dimcmc::internals::surface::static_map::Reference;
use nalgebra::DMatrix;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::Path;

/// An RV offset and the velocity of a profile enter alike, so that the covariance of the velocities is that without
/// jitter plus its variance: here on the demo's star, projected on orbits, and for every profile by itself.
#[test]
fn zero_points_add_their_variance_to_that_of_the_velocities() {
    const SD_KMS: f64 = 0.1;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    json["observations"]["simulate"]["pixels"] = 5000.into();
    json["imaging"]["pixels"] = 800.into();
    let scene = Scene::new(&Config::at(json.clone(), &path)).unwrap();
    let mut values = scene.settings.values;
    values.set(Parameter::K, 0.0);
    let information = |imager: &Imager| {
        let reference = Reference::at_lambda(imager, values, 1.0).unwrap();
        Expansion::of(imager, &reference, &[]).information
    };
    let plain = information(&scene.imager);
    let n = plain.nrows();
    let covariance = plain.cholesky().unwrap().inverse() + DMatrix::identity(n, n) * SD_KMS.powi(2);
    let wanted = covariance.cholesky().unwrap().inverse();
    let zero_points = ZeroPoints::new(&scene.imager, values, 0.97, SD_KMS).unwrap();
    let got = information(&zero_points.counted_in(scene.imager.clone()));
    let cycles = scene.imager.cycles();
    for period in [0.4, 0.7, 1.0, 1.7, 3.0] {
        let wave = DMatrix::from_fn(n, 1, |k, _| (TAU * cycles[k] / period).cos());
        let along = |matrix: &DMatrix<f64>| wave.dot(&(matrix * &wave));
        let ratio = along(&got) / along(&wanted);
        println!("{period}: {ratio}");
        // the maps are not quite the same
        assert!((ratio - 1.0).abs() < 0.05, "{period}: {ratio}");
    }
    for k in 0..n {
        let ratio = got[(k, k)] / wanted[(k, k)];
        assert!((ratio - 1.0).abs() < 0.1, "profile {k}: {ratio}");
    }
}

/// A spotted star with a wide continuum whose velocities jitter by 0.1 km/s, simulated into `data`, and its config with
/// "fitted".
fn jittering(seed: u64, k_kms: f64) -> Desk {
    let mut star = star();
    star["rotation_period_d"] = json!(0.5);
    let cycles: Vec<f64> =
        (0..24).map(|k| 2.0 * f64::from(k / 6) + 0.11 * f64::from(k % 6) + 0.013 * f64::from(k * k % 7)).collect();
    let desk = Desk::new(json!({
        "star": star,
        "planet": { "k_kms": 0.0, "porb_over_prot": 1.37, "phi": 0.2 },
        "observations": { "simulate": {
            "spots": [[40, 30, 14, 0.8], [200, 60, 20, 0.8], [300, 10, 10, 0.9]],
            "cycles": cycles, "velocity_kms": { "min": -50.4, "max": 50.4, "step": 1.8 }, "snr": 1000, "pixels": 2000,
            "seed": seed, "velocity_jitter_kms": 0.1, "truth": { "k_kms": k_kms }
        } },
        "imaging": { "pixels": 500, "chi2_target": 0.97, "objective": "spottedness" }
    }));
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    desk
}

fn observed(jitter: Value, sigma_scale: Value) -> Value {
    json!({
        "path": "data/observations.txt", "velocity_range_kms": [-30, 30], "sigma_scale": sigma_scale,
        "velocity_jitter_kms": jitter
    })
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

#[test]
fn scatter_and_errors_come_out_right_beside_each_other() {
    let desk = jittering(3, 0.0);
    desk.set("/observations", observed(json!("fitted"), json!("auto")));
    let table = desk.succeed(&["map", "config.json", "--out", "map"]);
    says(&table, &["RV jitter", "no planet", "RV offsets", "n/a (degenerate with the fitted RV offsets)"]);
    let fit = desk.json("map/fit.json");
    let (jitter, errors) = (&fit["measured"]["velocity_jitter"], &fit["measured"]["errors"]);
    let (value, error) = (number(&jitter["value_kms"]), number(&jitter["without_planet"]["error_kms"]));
    // 24 profiles
    assert!((value - 0.1).abs() < 2.0 * error && error < 0.03, "{jitter}");
    // some 24 x 33 bins, and as many of continuum
    assert!((number(&errors["sigma_scale"]) - 1.0).abs() < 0.08, "{errors}");
    // every profile's own
    let (found, truth) = (numbers(&fit["zero_points_kms"]), numbers(&desk.json("data/truth.json")["zero_points_kms"]));
    let left: f64 = found.iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = truth.iter().map(|v| v * v).sum();
    println!("{} of the zero points are left", (left / size).sqrt());
    assert!(left < 0.25 * size, "{found:?} {truth:?}");
    // the same number written down gives the same map, and is another config
    desk.set("/observations", observed(json!(value), errors["sigma_scale"].clone()));
    desk.succeed(&["map", "config.json", "--out", "by_hand"]);
    let by_hand = desk.json("by_hand/fit.json");
    assert_eq!(fit["spottedness"], by_hand["spottedness"]);
    assert_ne!(fit["config_sha256"], by_hand["config_sha256"]);
    assert!(by_hand.get("measured").is_none());
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn zero_points_are_no_planet_and_a_planet_is_no_zero_point() {
    let search = |desk: &Desk, jitter: Value| {
        desk.set("/observations", observed(jitter, json!(1.0)));
        let table = desk.succeed(&["periodogram", "config.json", "--out", "p", "--force", "--draws", "2000"]);
        (desk.json("p/periodogram.json"), table)
    };
    let probability = |result: &Value| number(&result["false_alarm"]["probability"]);
    let quiet = jittering(3, 0.0);
    let (blind, _) = search(&quiet, json!(0.0));
    let (fitted, table) = search(&quiet, json!("fitted"));
    println!("{} {}", probability(&blind), probability(&fitted));
    assert!(probability(&fitted) > 0.05, "{}", fitted["false_alarm"]);
    assert!(probability(&blind) < probability(&fitted));
    says(&table, &["RV jitter: ", "ln B = "]);
    // ten standard errors
    let planet = jittering(3, 0.3);
    let (found, _) = search(&planet, json!("fitted"));
    let best = &found["best"];
    println!("{} {best}", probability(&found));
    assert!(probability(&found) < 0.01, "{}", found["false_alarm"]);
    let (k, sigma) = (number(&best["k_kms"]), number(&best["sigma_k_kms"]));
    assert!((k - 0.3).abs() < 2.5 * sigma && sigma < 0.05, "{best}");
    assert_eq!(found["measured"]["velocity_jitter"]["beside_orbit"]["counts"], true);
}

/// Invalid values are refused by key, and a run is not resumed with another RV jitter.
#[test]
fn the_key_is_checked() {
    let desk = Desk::new(crate::desk::tiny(2));
    let fails = |args: &[&str], what: &[&str]| {
        let output = dimcmc(args, &desk.path(""));
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
        says(&text(&output.stderr), what);
    };
    for wrong in [json!(-0.1), json!(1e3), json!("auto")] {
        desk.set("/observations/velocity_jitter_kms", wrong);
        fails(&["map", "config.json", "--out", "m"], &["observations.velocity_jitter_kms"]);
    }
    for (key, wrong) in [("velocity_jitter_kms", -1.0), ("correlated_bins", 0.5)] {
        desk.set(&format!("/observations/simulate/{key}"), json!(wrong));
        fails(&["map", "config.json", "--out", "m"], &[&format!("observations.simulate.{key}")]);
    }
    let mut config = desk.config.clone();
    config["observations"]["velocity_jitter_kms"] = json!("fitted");
    config["imaging"]["chi2_target"] = json!("auto");
    desk.write("config.json", &config.to_string());
    fails(&["map", "config.json", "--out", "m"], &["imaging.chi2_target", "velocity_jitter_kms"]);
    desk.set("/observations/velocity_jitter_kms", json!(0.05));
    desk.succeed(&["sample", "config.json", "--out", "run"]);
    desk.set("/observations/velocity_jitter_kms", json!(0.06));
    fails(&["sample", "config.json", "--out", "run", "--resume"], &["observations.velocity_jitter_kms"]);
}
