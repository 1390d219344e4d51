//! Commands with the objective `marginal-likelihood`: a star with spots evolving over its twelve profiles.

use super::desk::{Desk, dimcmc, says, text, two_spots};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

/// A chain of orbit and field that takes some seconds.
fn changing(steps: usize) -> Value {
    let mut config = two_spots(json!({ "ensembles": 2, "walkers": 10, "steps": steps, "seed": 3, "ess": 1e6 }));
    let simulate = &mut config["observations"]["simulate"];
    simulate.as_object_mut().unwrap().remove("spots");
    simulate["random_spots"] = json!({ "number": 6, "lifetime_d": 8, "seed": 2 });
    simulate["snr"] = json!(500);
    config["observations"]["velocity_jitter_kms"] = json!(0);
    config["imaging"] = json!({ "pixels": 200, "objective": "marginal-likelihood" });
    config["grid"] = json!({ "axes": { "k_kms": [0.0, 0.4, 5], "phi": [0.8, 1.2, 5] } });
    config
}

#[test]
fn a_chain_has_the_same_bytes_by_any_number_of_threads() {
    let desk = Desk::new(changing(2));
    for (threads, out) in [("1", "one"), ("2", "two")] {
        desk.succeed(&["sample", CONFIG, "--out", out, "--threads", threads]);
    }
    let whole = desk.read("one/chain.jsonl");
    assert_eq!(whole, desk.read("two/chain.jsonl"));
    let first: Value = serde_json::from_str(whole.lines().next().unwrap()).unwrap();
    for name in ["k_kms", "phi", "spot_amplitude", "spot_slope", "spot_lifetime_d", "ln_evidence"] {
        assert!(first[name].is_number(), "{name} in {first}");
    }
    let manifest = desk.json("one/manifest.json");
    assert!(manifest["reference"]["ln_evidence"].is_number());
    assert_eq!(manifest["priors"]["spot_lifetime_d"]["prior"], "log-uniform");
    desk.succeed(&["export", "one", "--format", "csv", "--out", "chain.csv"]);
    assert!(desk.read("chain.csv").lines().next().unwrap().contains("spot_lifetime_d"));
    desk.succeed(&["report", "one"]);
}

#[test]
fn an_export_of_a_fast_star_says_what_its_draws_lack() {
    let mut config = changing(1);
    config["star"]["vsini_kms"] = json!(50);
    config["observations"]["simulate"]["velocity_kms"] = json!({ "min": -63.0, "max": 63.0, "step": 7.0 });
    config["sampler"]["walkers"] = json!(12);
    config["parameters"]["inclination_deg"] = json!({ "prior": "isotropic" });
    let desk = Desk::new(config);
    says(&desk.succeed(&["sample", CONFIG, "--out", "run"]), &["inclination_deg are multiplied by 1.6"]);
    let note = "larger than the scatter of the draws: 1.6 times for inclination_deg";
    says(&desk.succeed(&["export", "run", "--format", "zarr"]), &[note]);
    says(&desk.read("run/chain.zarr/posterior/inclination_deg/zarr.json"), &["\"sigma_factor\": 1.6"]);
    assert!(!desk.read("run/chain.zarr/posterior/k_kms/zarr.json").contains("sigma_factor"));
    desk.succeed(&["export", "run", "--format", "emcee"]);
    let file = std::fs::read(desk.path("run/chain.h5")).unwrap();
    let held = br#"{"inclination_deg":1.6}"#;
    assert!(file.windows(held.len()).any(|window| window == held));
}

#[test]
fn a_landscape_is_that_of_the_chain_with_the_field_held() {
    let desk = Desk::new(changing(1));
    let table = desk.succeed(&["grid", CONFIG, "--out", "grid"]);
    says(&table, &["ln_evidence"]);
    desk.succeed(&["sample", CONFIG, "--out", "run"]);
    let said = desk.succeed(&["compare", "run", "grid", "--out", "comparison"]);
    says(&said, &["spot_amplitude, spot_slope, spot_lifetime_d fixed in the grid, sampled in the chain"]);
    assert!(!said.contains("unresolved spots"), "{said}");
    // for comparison the paper's method with the same star and profiles
    let mut mapped = changing(1);
    mapped["imaging"] = json!({ "pixels": 200, "chi2_target": 1.6, "objective": "spottedness" });
    mapped["grid"] = json!({ "axes": { "k_kms": [0.1, 0.3, 3], "phi": [0.9, 1.1, 3] } });
    desk.write("mapped.json", &mapped.to_string());
    desk.succeed(&["grid", "mapped.json", "--out", "mapped"]);
    let said = desk.succeed(&["compare", "run", "mapped", "--out", "both"]);
    says(&said, &["objectives differ (chain: marginal-likelihood, grid: spottedness)"]);
    desk.succeed(&["optimise", CONFIG, "--out", "best"]);
    let optimum = desk.json("best/optimum.json");
    let (k, sd) = (optimum["parameters"]["k_kms"].as_f64().unwrap(), optimum["sd"]["k_kms"].as_f64().unwrap());
    assert!((k - 0.2).abs() < 3.0 * sd, "{k} +- {sd}");
}

/// Older programs took spottedness.
#[test]
fn a_config_without_an_objective_has_this_one_and_is_told_so() {
    let mut config = changing(1);
    config["imaging"] = json!({ "pixels": 200, "spot_lifetime_d": 8 });
    let desk = Desk::new(config);
    for args in [["map", CONFIG, "--out", "map"], ["sample", CONFIG, "--out", "run"]] {
        let output = dimcmc(&args, &desk.path(""));
        assert_eq!(output.status.code(), Some(0));
        let note = "note: config.json: imaging.objective is not given: it is \"marginal-likelihood\"; older versions \
                    took \"spottedness\"; name one of them\n";
        assert_eq!(text(&output.stderr), note, "{args:?}");
    }
    assert!(desk.json("map/map.json")["field"].is_object());
    assert_eq!(desk.json("run/manifest.json")["config"]["imaging"]["objective"], "marginal-likelihood");
    // keys of one map
    desk.set("/imaging/chi2_target", json!(1.05));
    let output = dimcmc(&["map", CONFIG, "--out", "again"], &desk.path(""));
    says(&text(&output.stderr), &["took \"spottedness\", which chi2_target is for; name one of them"]);
}

#[test]
fn what_has_no_meaning_is_refused() {
    let refused = |edit: &dyn Fn(&mut Value), parts: &[&str]| {
        let mut config = changing(4);
        edit(&mut config);
        says(&Desk::new(config).refusal(&["sample", CONFIG, "--out", "run"]), parts);
    };
    let prior = json!({ "prior": "log-uniform", "min": 1.0, "max": 100.0 });
    refused(
        &|config| {
            config["imaging"] = json!({ "pixels": 200, "objective": "spottedness" });
            config["parameters"]["spot_lifetime_d"] = prior.clone();
        },
        &["parameters.spot_lifetime_d", "marginal-likelihood"],
    );
    refused(
        &|config| {
            config["imaging"]["spot_lifetime_d"] = json!("static");
            config["parameters"]["spot_lifetime_d"] = prior.clone();
        },
        &["imaging.spot_lifetime_d", "static"],
    );
    refused(&|config| config["imaging"]["spot_break_degree"] = json!(31), &["imaging.spot_break_degree", "0 to 30"]);
    refused(
        &|config| config["imaging"] = json!({ "pixels": 200, "spot_break_degree": 7, "objective": "spottedness" }),
        &["imaging.spot_break_degree", "marginal-likelihood"],
    );
    // configs of older programs, which implied one map
    let cure = "set \"spottedness\"";
    refused(
        &|config| {
            config["imaging"] = json!({ "chi2_target": "auto" });
            config["observations"]["velocity_jitter_kms"] = json!("fitted");
        },
        &["imaging.chi2_target", cure],
    );
    refused(&|config| config["imaging"] = json!({ "season_gap_d": 30 }), &["imaging.season_gap_d", cure]);
    refused(&|config| config["imaging"]["spot_amplitude"] = json!("static"), &["imaging.spot_amplitude"]);
    refused(&|config| config["imaging"]["spot_amplitude"] = json!(7), &["imaging.spot_amplitude", "0.01 to 1.5"]);
    refused(
        &|config| {
            config["imaging"]["spot_lifetime_d"] = json!(500);
            config["parameters"]["spot_lifetime_d"] = prior.clone();
        },
        &["imaging.spot_lifetime_d", "500", "outside its prior"],
    );
}
