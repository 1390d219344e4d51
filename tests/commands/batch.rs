//! `batch` and the scripts for SLURM as users run them, without SLURM; and a scheduler's signals.

use crate::desk::{Desk, dimcmc, says, star, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

const RUN: [&str; 3] = ["manifest.json", "chain.jsonl", "summary.json"];

fn config(seed: u64) -> Value {
    json!({
        "star": star(),
        "planet": { "k_kms": 0.2, "porb_over_prot": 1.7, "phi": 0.5 },
        "observations": { "simulate": {
            "spots": [[30, 40, 25, 0.8], [200, 10, 15, 0.9]],
            "cycles": [0.0, 0.13, 0.29, 0.41, 0.58, 0.72, 0.87, 1.04, 1.21, 1.35, 1.52, 1.66],
            "velocity_kms": { "min": -27.0, "max": 27.0, "step": 3.0 },
            "snr": 500, "seed": seed, "pixels": 1000
        } },
        "imaging": { "pixels": 200, "chi2_target": 1.05, "objective": "spottedness" },
        "parameters": {
            "k_kms": { "prior": "uniform", "min": 0.0, "max": 1.0 },
            "phi": { "prior": "periodic" }
        },
        "sampler": { "ensembles": 2, "walkers": 6, "steps": 40, "seed": 3, "ess": 1e6 },
        "grid": { "axes": { "k_kms": [0.0, 0.4, 400] } }
    })
}

/// A desk with the configs of three stars, and a list of them.
fn desk() -> Desk {
    let desk = Desk::new(config(7));
    for seed in 1..=3 {
        desk.write(&format!("star_{seed}.json"), &config(seed).to_string());
    }
    desk.write("stars.txt", "# three stars\nstar_1.json\n\nstar_2.json  # the second\nstar_3.json\n");
    desk
}

fn same(desk: &Desk, a: &str, b: &str) {
    for file in RUN {
        let [a, b] = [a, b].map(|run| desk.read(&format!("{run}/{file}")));
        assert!(a == b, "{file} of {b} differs from that of {a}");
    }
}

#[test]
fn stars_of_a_batch_are_those_of_sample() {
    let desk = desk();
    let table = desk.succeed(&["batch", "stars.txt", "--out", "stars", "--threads", "2"]);
    says(&table, &["star_1  k_kms  ", "star_3  phi  ", "written: stars: batch.json"]);
    for seed in 1..=3 {
        desk.succeed(&["sample", &format!("star_{seed}.json"), "--out", &format!("{seed}")]);
        same(&desk, &format!("{seed}"), &format!("stars/star_{seed}"));
    }
    let rows = desk.json("stars/batch.json");
    assert_eq!(rows[1]["parameters"], desk.json("2/summary.json")["parameters"]);
    // finished results are not touched: the same bytes again, and no file touched
    let touched = || std::fs::metadata(desk.path("stars/star_2/summary.json")).unwrap().modified().unwrap();
    let before = touched();
    assert_eq!(desk.succeed(&["batch", "stars.txt", "--out", "stars"]), table);
    assert_eq!(touched(), before);
}

#[test]
fn a_star_that_fails_stops_no_other() {
    let desk = desk();
    desk.write("bad.json", "{}");
    let mut hopeless = config(4);
    hopeless["imaging"]["chi2_target"] = json!(0.1);
    desk.write("hopeless.json", &hopeless.to_string());
    desk.write("stars.txt", "bad.json\nstar_1.json\nabsent.json\nhopeless.json\n");
    let output = dimcmc(&["batch", "stars.txt", "--out", "stars"], &desk.path(""));
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(text(&output.stderr), "error: 3 of 4 stars have no chain\n");
    says(&text(&output.stdout), &["bad: bad.json: ", "absent: absent.json: ", "hopeless: ", "floor", "star_1  k_kms"]);
    assert_eq!(desk.json("stars/batch.json")[1]["end"], "sampled");
    // another config than that of the run
    let mut other = config(1);
    other["parameters"]["k_kms"]["max"] = json!(0.9);
    desk.write("star_1.json", &other.to_string());
    desk.write("stars.txt", "star_1.json\n");
    let output = dimcmc(&["batch", "stars.txt", "--out", "stars"], &desk.path(""));
    says(&text(&output.stdout), &["star_1: stars/star_1: parameters.k_kms.max (1.0 then, 0.9 now)"]);
}

#[test]
fn lists_that_make_no_sense_are_refused() {
    let desk = desk();
    for (list, parts) in [
        ("# nothing\n", ["stars.txt", "no config"]),
        ("star_1.json\nother/star_1.json\n", ["stars.txt:2", "share the folder star_1"]),
        ("star_1.json\n/\n", ["stars.txt:2", "no file"]),
    ] {
        desk.write("stars.txt", list);
        says(&desk.refusal(&["batch", "stars.txt", "--out", "stars"]), &parts);
    }
    says(&desk.refusal(&["batch", "absent.txt", "--out", "stars"]), &["absent.txt"]);
}

/// Sends a signal and waits; exit code and message.
fn send(signal: &str, child: Child) -> (Option<i32>, String) {
    assert!(Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    (output.status.code(), text(&output.stderr))
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/slurm").join(name)
}

/// A script for SLURM without it, and without MPI.
fn start(desk: &Desk, name: &str, args: &[&str], variables: &[(&str, &str)]) -> Child {
    let folder = Path::new(env!("CARGO_BIN_EXE_dimcmc")).parent().unwrap();
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    let mut bash = Command::new("bash");
    bash.arg(script(name)).args(args).current_dir(desk.path("")).env("PATH", path).env("DIMCMC", "dimcmc");
    bash.envs(variables.iter().copied()).stdout(Stdio::piped()).stderr(Stdio::piped());
    bash.spawn().unwrap()
}

fn run(desk: &Desk, name: &str, args: &[&str], variables: &[(&str, &str)]) {
    let output = start(desk, name, args, variables).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{name}: {}", text(&output.stderr));
}

#[test]
fn the_scripts_do_what_they_say() {
    for entry in std::fs::read_dir(script("")).unwrap() {
        let path = entry.unwrap().path();
        assert!(Command::new("bash").arg("-n").arg(&path).status().unwrap().success(), "{}", path.display());
    }
    let desk = desk();
    desk.succeed(&["sample", "config.json", "--out", "whole"]);
    run(&desk, "chain.sh", &["config.json", "chain"], &[]);
    same(&desk, "whole", "chain");
    // a finished one is resumed, and finished
    run(&desk, "chain.sh", &["config.json", "chain"], &[]);
    same(&desk, "whole", "chain");
    for seed in ["3", "4"] {
        run(&desk, "array.sh", &["config.json", "runs"], &[("SLURM_ARRAY_TASK_ID", seed)]);
    }
    same(&desk, "whole", "runs/seed_3");
    run(&desk, "merge.sh", &["runs"], &[]);
    assert_eq!(desk.json("runs/merged/manifest.json")["merged_seeds"], json!([3, 4]));
    assert!(desk.path("runs/merged/report.html").exists());
    run(&desk, "batch.sh", &["stars.txt", "stars"], &[]);
    assert_eq!(desk.json("stars/batch.json")[2]["end"], "sampled");
}

/// The script forwards the warning, and returns the program's code.
#[test]
fn a_script_that_is_warned_is_gone_on_with() {
    let desk = Desk::new(config(7));
    desk.succeed(&["sample", "config.json", "--out", "whole"]);
    desk.set("/sampler/steps", json!(100_000));
    let mut child = start(&desk, "chain.sh", &["config.json", "chain"], &[]);
    desk.wait_for_lines("chain/chain.jsonl", &mut child, 24);
    let (code, message) = send("USR1", child);
    assert_eq!(code, Some(75), "{message}");
    let steps = desk.lines("chain/chain.jsonl") / 12 - 1;
    desk.set("/sampler/steps", json!(steps.max(40)));
    run(&desk, "chain.sh", &["config.json", "chain"], &[]);
    let [whole, chain] = ["whole", "chain"].map(|run| desk.read(&format!("{run}/chain.jsonl")));
    assert!(chain.starts_with(&whole));
}
