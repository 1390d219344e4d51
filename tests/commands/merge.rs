//! `merge` as users run it: the draws of all runs and no others, and refusals of mismatched runs.

use crate::desk::{Desk, says, tiny};
use crate::shared;
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

fn sample(desk: &Desk, out: &str, seed: &str) {
    desk.succeed(&["sample", CONFIG, "--out", out, "--seed", seed]);
}

/// Lines of a chain with the ensembles numbered from `first`, up to a step.
fn renumbered(chain: &str, first: usize, steps: usize) -> Vec<String> {
    let lines = chain.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let lines = lines.filter(|line| line["step"].as_u64().unwrap() <= steps as u64);
    let renumber = |mut line: Value| {
        line["ensemble"] = json!(line["ensemble"].as_u64().unwrap() as usize + first);
        line.to_string()
    };
    lines.map(renumber).collect()
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn the_whole_is_its_parts() {
    let desk = Desk::new(tiny(40));
    // the seed of the config, given or not
    sample(&desk, "a", "3");
    desk.succeed(&["sample", CONFIG, "--out", "same"]);
    assert_eq!(desk.read("a/chain.jsonl"), desk.read("same/chain.jsonl"));
    sample(&desk, "b", "4");
    assert_ne!(desk.read("a/chain.jsonl"), desk.read("b/chain.jsonl"));
    desk.succeed(&["sample", CONFIG, "--out", "b", "--seed", "4", "--extend", "10"]);
    sample(&desk, "c", "5");

    let table = desk.succeed(&["merge", "a", "b", "c", "--out", "all"]);
    says(&table, &["k_kms", "40 steps", "note: b: its last 10 steps are left out"]);
    let mut parts: Vec<String> = ["a", "b", "c"]
        .iter()
        .enumerate()
        .flat_map(|(k, run)| renumbered(&desk.read(&format!("{run}/chain.jsonl")), 2 * k, 40))
        .collect();
    let mut whole = renumbered(&desk.read("all/chain.jsonl"), 0, 40);
    assert_eq!(whole.len(), 3 * 12 * 41);
    parts.sort();
    whole.sort();
    assert_eq!(parts, whole);
    let manifest = desk.json("all/manifest.json");
    assert_eq!((&manifest["ensembles"], &manifest["merged_seeds"]), (&json!(6), &json!([3, 4, 5])));
    let summary = desk.json("all/summary.json");
    let [a, all] = [&desk.json("a/summary.json"), &summary].map(|s| s["parameters"]["k_kms"]["ess"].as_f64().unwrap());
    // three times the draws; both numbers are estimates, accurate to some tens of per cent
    assert!(all > 1.8 * a, "{a} {all}");

    // every command that accepts a run accepts it
    desk.succeed(&["analyse", "all"]);
    desk.succeed(&["export", "all", "--format", "csv"]);
    desk.succeed(&["plot", "all"]);
    // a merged run can be merged with another one
    sample(&desk, "d", "6");
    desk.succeed(&["merge", "all", "d", "--out", "more"]);
    assert_eq!(desk.json("more/manifest.json")["merged_seeds"], json!([3, 4, 5, 6]));
    // it has no stream of random numbers to be resumed with
    desk.set("/sampler/ensembles", json!(6));
    says(&desk.refusal(&["sample", CONFIG, "--out", "all", "--resume"]), &["all: a merged run"]);
}

#[test]
fn what_does_not_belong_together_is_not_merged() {
    let desk = shared::desk();
    let merge = |other: &str| desk.refusal(&["merge", "sample", other, "--out", "all"]);
    says(&desk.refusal(&["merge", "sample", "--out", "all"]), &["two or more"]);
    says(&merge("sample"), &["sample and sample", "seed 3", "the same chain"]);
    let joined = desk.succeed(&["merge", "sample", "seed_4", "--out", "joined"]);
    says(&joined, &["spot_lifetime_d"]);
    says(&desk.refusal(&["merge", "joined", "seed_4", "--out", "all"]), &["joined and seed_4", "seed 4"]);
    desk.refusal(&["merge", "sample", "seed_4", "--out", "joined"]);
    merge("absent");

    type Change = fn(&mut Value);
    let cases: [(&str, Change, &str); 4] = [
        (
            "prior",
            |m| m["config"]["parameters"]["k_kms"]["max"] = json!(0.9),
            "parameters.k_kms.max (1.0 and 0.9) of the config is not the same",
        ),
        ("data", |m| m["data_sha256"] = json!("0"), "observations are not the same"),
        ("version", |m| m["version"] = json!("9.0"), "versions"),
        ("reference", |m| m["reference"]["ln_evidence"] = json!(7.0), "references are not the same"),
    ];
    for (key, change, what) in cases {
        std::fs::create_dir(desk.path(key)).unwrap();
        std::fs::copy(desk.path("seed_4/chain.jsonl"), desk.path(&format!("{key}/chain.jsonl"))).unwrap();
        let mut manifest = desk.json("seed_4/manifest.json");
        change(&mut manifest);
        desk.write(&format!("{key}/manifest.json"), &manifest.to_string());
        says(&merge(key), &[&format!("sample and {key}"), what]);
    }
}
