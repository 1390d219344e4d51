//! `merge` as users run it: the draws of all runs and no others, and refusals of what does not belong together.

use crate::desk::{Desk, says, tiny};
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
    // three times the draws; both numbers are estimates, good to some tens of per cent
    assert!(all > 1.8 * a, "{a} {all}");

    // whatever takes a run takes it
    desk.succeed(&["analyse", "all"]);
    desk.succeed(&["export", "all", "--format", "csv"]);
    desk.succeed(&["plot", "all"]);
    // a merged run can be merged with another one
    sample(&desk, "d", "6");
    desk.succeed(&["merge", "all", "d", "--out", "more"]);
    assert_eq!(desk.json("more/manifest.json")["merged_seeds"], json!([3, 4, 5, 6]));
    // it has no random numbers of its own to go on with
    desk.set("/sampler/ensembles", json!(6));
    says(&desk.refusal(&["sample", CONFIG, "--out", "all", "--resume"]), &["all: several runs joined"]);
}

#[test]
fn what_does_not_belong_together_is_not_merged() {
    let desk = Desk::new(tiny(40));
    sample(&desk, "a", "1");
    sample(&desk, "b", "2");
    let merge = |other: &str| desk.refusal(&["merge", "a", other, "--out", "all"]);
    says(&desk.refusal(&["merge", "a", "--out", "all"]), &["two or more"]);
    says(&merge("a"), &["a and a", "seed 1", "the same chain"]);
    desk.succeed(&["merge", "a", "b", "--out", "joined"]);
    says(&desk.refusal(&["merge", "joined", "b", "--out", "all"]), &["joined and b", "seed 2"]);
    says(&desk.refusal(&["merge", "a", "b", "--out", "joined"]), &["--out joined", "not empty", "--force"]);
    says(&merge("absent"), &["absent: no manifest.json"]);

    let mut other = tiny(40);
    other["parameters"]["k_kms"]["max"] = json!(0.9);
    desk.write("prior.json", &other.to_string());
    desk.succeed(&["sample", "prior.json", "--out", "prior", "--seed", "5"]);
    says(&merge("prior"), &["a and prior", "parameters.k_kms.max (1.0 and 0.9) of the config is not the same"]);

    desk.succeed(&["sample", CONFIG, "--out", "c", "--seed", "6"]);
    for (key, from, to, what) in [
        ("data", "\"data_sha256\": \"", "\"data_sha256\": \"0", "observations are not the same"),
        ("version", "\"version\": \"", "\"version\": \"9", "versions"),
        ("lambda", "\"lambda\": ", "\"lambda\": 1", "references are not the same"),
    ] {
        std::fs::create_dir(desk.path(key)).unwrap();
        std::fs::copy(desk.path("c/chain.jsonl"), desk.path(&format!("{key}/chain.jsonl"))).unwrap();
        let manifest = desk.read("c/manifest.json");
        assert!(manifest.contains(from), "{from}");
        desk.write(&format!("{key}/manifest.json"), &manifest.replacen(from, to, 1));
        says(&merge(key), &[what]);
    }
}
