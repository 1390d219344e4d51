//! `compare` as users run it: chain, paraboloid and likelihood grid agree on one posterior, and mismatched results are
//! refused.

use crate::desk::{Desk, says, two_spots};
use crate::shared;
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

const FILE: &str = "comparison.json";

/// Error bars are 0.0097 (K) and 0.0083 (phi): the nodes have that spacing.
fn config() -> Value {
    let mut config = two_spots(json!({ "ensembles": 4, "walkers": 8, "steps": 400, "ess": 1000, "rhat": 1.02 }));
    config["grid"] = json!({ "axes": { "k_kms": [0.15, 0.25, 11], "phi": [-0.05, 0.04, 11] } });
    config
}

/// A desk with a run in `run` and a likelihood grid in `grid`.
fn both(config: Value) -> Desk {
    let desk = Desk::new(config);
    desk.succeed(&["sample", CONFIG, "--out", "run"]);
    desk.succeed(&["grid", CONFIG, "--out", "grid"]);
    desk
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// The likelihood grid of the config with this change.
fn other_grid(desk: &Desk, pointer: &str, value: Value) {
    desk.set(pointer, value);
    desk.succeed(&["grid", CONFIG, "--out", "other", "--force"]);
}

fn compared(desk: &Desk, grid: &str) -> (String, Value) {
    let table = desk.succeed(&["compare", "run", grid, "--out", "compared", "--force"]);
    (table, desk.json(&format!("compared/{FILE}")))
}

#[test]
fn chain_paraboloid_and_landscape_agree() {
    let desk = both(config());
    let table = desk.succeed(&["compare", "run", "grid", "--out", "a"]);
    says(&table, &["k_kms", "paraboloid", "landscape", "truth", "effective draws", "written: a: comparison.json"]);
    assert!(!table.contains("note:"), "{table}");
    let found = desk.json(&format!("a/{FILE}"));
    let summary = desk.json("run/summary.json");
    let paraboloid = desk.json("grid/paraboloid.json");
    assert_eq!((&found["names"], &found["converged"]), (&json!(["k_kms", "phi"]), &json!(true)));
    for (name, truth) in [("k_kms", 0.2), ("phi", 0.0)] {
        let one = &found["parameters"][name];
        assert_eq!(one["truth"], truth);
        let chain = &summary["parameters"][name];
        assert_eq!((&one["chain"]["value"], &one["chain"]["ci68"]), (&chain["median"], &chain["ci68"]));
        assert_eq!(one["paraboloid"]["value"], paraboloid["parameters"][name]["vertex"]);
        // a thousand effective draws place a median to 0.04 error bars and a width to 0.03; chi2 is no perfect parabola
        for (by, apart, wider) in [("paraboloid", 0.3, 0.15), ("landscape", 0.16, 0.12)] {
            let (difference, ratio) = (number(&one[by]["difference"]), number(&one[by]["width_ratio"]));
            assert!(difference.abs() < apart && (ratio - 1.0).abs() < wider, "{name} by {by}: {difference} {ratio}");
        }
        // twice the value that chance exceeds once in twenty times
        let distance = &one["distribution"];
        assert!(number(&distance["largest"]) < 2.0 * number(&distance["by_chance95"]), "{name}: {distance}");
        assert!((0.7..1.5).contains(&number(&one["spacing"])), "{name}: {}", one["spacing"]);
    }
    // the phase is on both sides of 0, and intervals stay in one piece
    let phi = &found["parameters"]["phi"]["landscape"];
    assert!(number(&phi["ci68"][0]) <= number(&phi["value"]) && number(&phi["value"]) <= number(&phi["ci68"][1]));
    let cost = &found["cost"];
    for who in ["chain", "landscape"] {
        assert!(cost[who]["seconds"].as_f64().unwrap() > 0.0, "{cost}");
    }
    assert_eq!(cost["chain"]["reconstructions"], summary["evaluations"]);
    assert_eq!((&cost["landscape"]["reconstructions"], &cost["landscape"]["failed"]), (&json!(121), &json!(0)));
    assert_eq!(cost["landscape"]["paraboloid_nodes"], paraboloid["nodes"]);
    assert!(found["nodes_needed"].is_null() && found["fixed_in_landscape"] == json!([]));

    // the same again, whatever the number of threads; nothing else is written, nothing overwritten
    desk.succeed(&["compare", "run", "grid", "--out", "b", "--threads", "1"]);
    assert!(desk.read(&format!("a/{FILE}")) == desk.read(&format!("b/{FILE}")));
    let before = desk.inventory();
    desk.refusal(&["compare", "run", "grid", "--out", "a"]);
    desk.succeed(&["compare", "run", "grid", "--out", "a", "--force"]);
    assert!(desk.inventory() == before);

    // the nodes of the paraboloid are those that were requested
    desk.succeed(&["grid", CONFIG, "--out", "grid", "--resume", "--fit-nodes", "15"]);
    assert_eq!(compared(&desk, "grid").1["cost"]["landscape"]["paraboloid_nodes"], 15);
}

#[test]
fn the_prior_of_the_run_counts() {
    let mut config = config();
    // away from the likelihood's 0.197 +- 0.0097 by two error bars, and half as wide
    config["parameters"]["k_kms"] = json!({ "prior": "normal", "mean": 0.21, "sd": 0.005, "min": 0.0, "max": 1.0 });
    let desk = both(config);
    let (_, found) = compared(&desk, "grid");
    let one = &found["parameters"]["k_kms"];
    let (landscape, paraboloid) = (&one["landscape"], &one["paraboloid"]);
    assert!(number(&landscape["difference"]).abs() < 0.16, "{one}");
    assert!((number(&landscape["width_ratio"]) - 1.0).abs() < 0.12, "{one}");
    assert!(number(&paraboloid["difference"]) < -1.0 && number(&paraboloid["width_ratio"]) > 1.5, "{one}");
}

#[test]
fn what_the_grid_leaves_out_is_said() {
    let desk = both(config());
    // one axis of two: the other is fixed where the config has it
    other_grid(&desk, "/grid/axes", json!({ "k_kms": [0.15, 0.25, 11] }));
    let (table, found) = compared(&desk, "other");
    says(&table, &["fixed at", "note: phi fixed in the grid, sampled in the chain", "as fine a grid over all 2"]);
    let phi = &found["parameters"]["phi"];
    assert_eq!((&phi["fixed_at"], &phi["landscape"], &phi["paraboloid"]), (&json!(0.0), &Value::Null, &Value::Null));
    assert_eq!(found["fixed_in_landscape"], json!(["phi"]));
    // 11 nodes times six error bars over the spacing of K, and an end
    let along = (6.0 / number(&found["parameters"]["k_kms"]["spacing"])).ceil() + 1.0;
    assert_eq!(number(&found["nodes_needed"]), 11.0 * along);

    // half of the posterior
    other_grid(&desk, "/grid/axes", json!({ "k_kms": [0.15, 0.197, 6], "phi": [-0.05, 0.04, 11] }));
    let (table, found) = compared(&desk, "other");
    says(&table, &["% of the draws lie outside the grid (", "paraboloid: no well-defined minimum: "]);
    assert!((0.2..0.8).contains(&number(&found["outside"])), "{}", found["outside"]);
    assert_eq!(found["outside"], found["parameters"]["k_kms"]["outside"]);
    assert!(found["parameters"]["k_kms"]["paraboloid"].is_null());

    other_grid(&desk, "/grid/axes", json!({ "k_kms": [0.1, 0.3, 5], "phi": [-0.05, 0.04, 11] }));
    says(&compared(&desk, "other").0, &["note: the grid is coarse (node spacing", "k_kms 5."]);

    // no part of it: the run's prior ends before the grid begins
    other_grid(&desk, "/grid/axes", json!({ "k_kms": [1.1, 1.2, 3], "phi": [-0.05, 0.04, 3] }));
    let (_, found) = compared(&desk, "other");
    let k = &found["parameters"]["k_kms"];
    assert_eq!((&found["outside"], &k["landscape"], &k["distribution"]), (&json!(1.0), &Value::Null, &Value::Null));

    // a chain that is not long enough, and its likelihood grid as well
    desk.set("/sampler/steps", json!(12));
    desk.succeed(&["sample", CONFIG, "--out", "run", "--force"]);
    let (table, found) = compared(&desk, "grid");
    says(&table, &["note: the chain has not converged: "]);
    assert_eq!(found["converged"], false);
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let mut config = config();
    config["sampler"]["steps"] = json!(10);
    config["grid"] = json!({ "axes": { "k_kms": [0.15, 0.25, 3], "phi": [-0.05, 0.04, 3] } });
    let desk = both(config);
    let refused = |parts: &[&str]| {
        let message = desk.refusal(&["compare", "run", "other", "--out", "compared"]);
        says(&message, &[&["run and other do not belong together: "], parts].concat());
    };
    for (pointer, value, what) in [
        (
            "/observations/simulate/seed",
            json!(8),
            "the observations are not the same: observations.simulate.seed (7 in the run, 8 in the grid)",
        ),
        (
            "/planet/k_kms",
            json!(0.21),
            "the observations are not the same: injected k_kms 0.2 in the run and 0.21 in the grid",
        ),
        ("/planet/porb_over_prot", json!(1.72), "porb_over_prot is fixed at 1.7 in the run and at 1.72 in the grid"),
        ("/imaging/chi2_target", json!(1.06), "imaging.chi2_target (1.05 in the run, 1.06 in the grid)"),
        (
            "/imaging/objective",
            json!("entropy"),
            "imaging.objective (\"spottedness\" in the run, \"entropy\" in the grid)",
        ),
        ("/star/rotation_period_d", json!(3.1), "star.rotation_period_d (3.0 in the run, 3.1 in the grid)"),
        ("/star/vsini_kms", json!(20.1), "vsini_kms is fixed at 20 in the run and at 20.1 in the grid"),
        (
            "/grid/axes",
            json!({ "vsys_kms": [-0.05, 0.05, 3] }),
            "vsys_kms is an axis of the grid and not sampled in the run",
        ),
    ] {
        other_grid(&desk, pointer, value);
        refused(&[what]);
    }
    // keys that only steer the chain do not matter
    other_grid(&desk, "/sampler/seed", json!(5));
    let as_it_was = desk.read("other/landscape.json");
    // several maps where the same profiles have one in the run
    let mut header = desk.json("other/landscape.json");
    let season = json!({ "first_d": 0.0, "last_d": 1.0, "profiles": 10, "epoch_d": 0.0 });
    header["measured"]["seasons"] = json!([season, season]);
    desk.write("other/landscape.json", &header.to_string());
    refused(&["maps of the star: 1 in the run, 2 in the grid"]);
    desk.write("other/landscape.json", &as_it_was);
    compared(&desk, "other");
}

#[test]
fn what_is_not_there_or_not_whole_is_refused() {
    let desk = shared::desk();
    std::fs::rename(desk.path("sample"), desk.path("run")).unwrap();
    let refused = |run: &str, grid: &str, parts: &[&str]| {
        says(&desk.refusal(&["compare", run, grid, "--out", "unwritten"]), parts);
    };
    refused("grid", "run", &[]);
    refused("run", "run", &[]);
    refused("run", "absent", &[]);
    // only the nodes decide what is whole; the paraboloid may be missing
    std::fs::remove_file(desk.path("grid/paraboloid.json")).unwrap();
    compared(&desk, "grid");
    let nodes = desk.read("grid/landscape.jsonl");
    let end = nodes.match_indices('\n').nth(39).unwrap().0;
    desk.write("grid/landscape.jsonl", &nodes[..=end]);
    refused("run", "grid", &["grid: 40 of 49 nodes: finish the grid first, with --resume"]);
    desk.write("grid/landscape.jsonl", &nodes.replacen("\"ln_evidence\"", "\"evidence\"", 1));
    refused("run", "grid", &["grid/landscape.jsonl, line 1: unknown key `evidence`"]);
    desk.write("grid/landscape.jsonl", &nodes);
    desk.write("run/chain.jsonl", "");
    refused("run", "grid", &["run/chain.jsonl: the chain has no complete step"]);
}
