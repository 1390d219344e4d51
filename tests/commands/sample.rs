//! `sample` and related commands as users run them: the same bytes whatever happens meanwhile, and refusals that write
//! nothing.

#[cfg(unix)]
use crate::desk::interrupt;
use crate::desk::{Desk, dimcmc, kill, says, text, tiny};
use serde_json::{Value, json};
use std::process::Child;
use std::time::Duration;

/// Step limit of the tiny run; its goals are unattainable, so that it reaches the limit.
const STEPS: usize = 60;

/// Lines of a step: two ensembles of six walkers.
const LINES: usize = 12;

/// The files of a run, all of which come out to the same bytes.
const FILES: [&str; 3] = ["manifest.json", "chain.jsonl", "summary.json"];

const CONFIG: &str = "config.json";

fn desk() -> Desk {
    Desk::new(tiny(STEPS))
}

/// A desk with a finished run in `run`.
fn finished() -> Desk {
    let desk = desk();
    desk.succeed(&["sample", CONFIG, "--out", "run"]);
    desk
}

/// Lines in the chain of a run so far.
fn lines(desk: &Desk, run: &str) -> usize {
    desk.lines(&format!("{run}/chain.jsonl"))
}

/// Waits until the chain of a run has so many lines or the run has ended.
fn wait_for_lines(desk: &Desk, run: &str, child: &mut Child, least: usize) {
    desk.wait_for_lines(&format!("{run}/chain.jsonl"), child, least);
}

fn same_run(desk: &Desk, a: &str, b: &str) {
    for file in FILES {
        let [a, b] = [a, b].map(|run| desk.read(&format!("{run}/{file}")));
        assert!(a == b, "{file} of {b} differs from that of {a}");
    }
}

fn copy(desk: &Desk, from: &str, to: &str) {
    std::fs::create_dir(desk.path(to)).unwrap();
    for file in FILES.iter().filter(|file| desk.path(from).join(file).exists()) {
        std::fs::copy(desk.path(from).join(file), desk.path(to).join(file)).unwrap();
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let desk = desk();
    let [one, two] = [("1", "a"), ("2", "b")]
        .map(|(threads, out)| desk.succeed(&["sample", CONFIG, "--out", out, "--threads", threads]));
    assert_eq!(one, two);
    says(&one, &["truth", "k_kms", "phi", "60 steps", "evaluations", "Not converged", "--extend"]);
    let verbose = desk.succeed(&["analyse", "a", "--verbose"]);
    assert!(verbose.starts_with(&one), "{verbose}");
    says(&verbose[one.len()..], &["acceptance 0.", "model applications", "highest ln posterior", "stretch"]);
    same_run(&desk, "a", "b");
    assert_eq!(lines(&desk, "a"), LINES * (STEPS + 1));
    let summary = desk.json("a/summary.json");
    for name in ["k_kms", "phi"] {
        for key in ["median", "mean", "sd", "mode", "ci68", "ci95", "hdi68", "hdi95", "rhat", "ess", "tau"] {
            assert!(!summary["parameters"][name][key].is_null(), "{name}.{key}");
        }
    }
    assert_eq!(summary["converged"], false);
    assert_eq!(summary["evaluations"].as_u64(), Some((LINES * (STEPS + 1)) as u64));
    let first: Value = serde_json::from_str(desk.read("a/chain.jsonl").lines().next().unwrap()).unwrap();
    for key in ["ensemble", "step", "walker", "accepted", "log_prob", "k_kms", "phi", "spottedness", "chi2", "status"] {
        assert!(!first[key].is_null(), "{key}");
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_during_the_search_writes_nothing() {
    let desk = desk();
    // an image large enough to be at work for a while
    desk.set("/imaging", json!({ "pixels": 20000, "chi2_target": 1.05, "objective": "spottedness" }));
    let before = desk.inventory();
    let child = desk.start(&["sample", CONFIG, "--out", "run"]);
    std::thread::sleep(Duration::from_millis(150));
    assert_eq!(interrupt(child), "error: interrupted before the first step; nothing was written\n");
    assert!(desk.inventory() == before);
}

#[test]
fn an_extension_adds_its_steps() {
    let desk = finished();
    let short = desk.read("run/chain.jsonl");
    copy(&desk, "run", "raised");
    desk.succeed(&["sample", CONFIG, "--out", "run", "--extend", "30"]);
    let long = desk.read("run/chain.jsonl");
    assert_eq!(lines(&desk, "run"), LINES * (STEPS + 30 + 1));
    assert!(long.starts_with(&short));
    // finished is finished
    desk.succeed(&["sample", CONFIG, "--out", "run", "--resume"]);
    assert_eq!(desk.read("run/chain.jsonl"), long);

    // the same steps by a higher limit: the same chain, and another manifest
    desk.set("/sampler/steps", json!(STEPS + 30));
    desk.succeed(&["sample", CONFIG, "--out", "raised", "--resume"]);
    assert_eq!(desk.read("raised/chain.jsonl"), long);
    assert_eq!(desk.json("raised/manifest.json")["config"]["sampler"]["steps"], STEPS + 30);
    desk.succeed(&["sample", CONFIG, "--out", "whole"]);
    same_run(&desk, "whole", "raised");
    // a limit raised after an extension holds
    desk.set("/sampler/steps", json!(STEPS + 40));
    desk.succeed(&["sample", CONFIG, "--out", "run", "--resume"]);
    assert_eq!(lines(&desk, "run"), LINES * (STEPS + 40 + 1));
}

#[test]
fn another_config_or_other_data_are_not_resumed() {
    let mut config = tiny(STEPS);
    config["observations"] = json!({ "path": "data/observations.txt" });
    let desk = Desk::new(config);
    desk.write("simulated.json", &tiny(STEPS).to_string());
    desk.succeed(&["simulate", "simulated.json", "--out", "data"]);
    desk.succeed(&["sample", CONFIG, "--out", "run"]);
    let resume = ["sample", CONFIG, "--out", "run", "--resume"];

    for (pointer, value, key) in [
        ("/parameters/k_kms/max", json!(0.9), "parameters.k_kms.max (1.0 then, 0.9 now)"),
        ("/sampler/seed", json!(4), "sampler.seed (3 then, 4 now)"),
        ("/star/inclination_deg", json!(51.0), "star.inclination_deg"),
        ("/imaging/objective", json!("entropy"), "imaging.objective (\"spottedness\" then, \"entropy\" now)"),
    ] {
        desk.set(pointer, value);
        says(&desk.refusal(&resume), &["run: ", key, "of the config changed since this run began"]);
    }
    desk.write(CONFIG, &desk.config.to_string());

    let profile = desk.read("data/p003.prof");
    let digit = profile.rfind(|c: char| c.is_ascii_digit() && c != '9').unwrap();
    let next = (profile.as_bytes()[digit] + 1) as char;
    desk.edit("data/p003.prof", |text| format!("{}{next}{}", &text[..digit], &text[digit + 1..]));
    says(&desk.refusal(&resume), &["run: ", "the observations changed since this run began"]);
    desk.write("data/p003.prof", &profile);
    desk.succeed(&resume);
}

#[test]
fn what_is_no_run_is_neither_resumed_nor_analysed() {
    let desk = finished();
    std::fs::create_dir(desk.path("empty")).unwrap();
    for (folder, parts) in [("empty", "empty: no manifest.json"), ("absent", "absent: no manifest.json")] {
        says(&desk.refusal(&["sample", CONFIG, "--out", folder, "--resume"]), &[parts]);
        says(&desk.refusal(&["sample", CONFIG, "--out", folder, "--extend", "5"]), &[parts]);
        says(&desk.refusal(&["analyse", folder]), &[parts]);
    }
    desk.refusal(&["sample", CONFIG, "--out", "run"]);
    desk.write("empty/map.json", "{}");
    for command in [&["analyse", "empty"][..], &["export", "empty", "--format", "csv"]] {
        says(&desk.refusal(command), &["empty: no manifest.json: this folder has results of `dimcmc map`"]);
    }

    copy(&desk, "run", "corrupt");
    desk.edit("corrupt/chain.jsonl", |chain| crate::desk::with_line(&chain, 100, "{\"ensemble\":0,\"st"));
    copy(&desk, "run", "swapped");
    desk.edit("swapped/chain.jsonl", |chain| {
        let line = chain.lines().nth(98).unwrap().to_string();
        crate::desk::with_line(&chain, 100, &line)
    });
    for (run, problem) in [("corrupt", "EOF"), ("swapped", "expected step 8, ensemble 0, walker 3")] {
        let line = format!("{run}/chain.jsonl, line 100");
        says(&desk.refusal(&["sample", CONFIG, "--out", run, "--resume"]), &[&line, problem]);
        says(&desk.refusal(&["analyse", run]), &[&line, problem]);
    }
    desk.write("swapped/manifest.json", "{}");
    says(&desk.refusal(&["analyse", "swapped"]), &["swapped/manifest.json", "missing field"]);
    std::fs::remove_file(desk.path("corrupt/chain.jsonl")).unwrap();
    says(&desk.refusal(&["analyse", "corrupt"]), &["corrupt/chain.jsonl"]);
}

#[test]
fn a_run_has_one_process() {
    let desk = finished();
    let mut child = desk.start(&["sample", CONFIG, "--out", "run", "--extend", "100000"]);
    wait_for_lines(&desk, "run", &mut child, LINES * (STEPS + 3));
    for args in [&["--resume"][..], &["--extend", "5"], &["--force"]] {
        let output = dimcmc(&[&["sample", CONFIG, "--out", "run"], args].concat(), &desk.path(""));
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        says(&text(&output.stderr), &["error: run/chain.jsonl: another process is writing this run"]);
    }
    // reading is allowed
    desk.succeed(&["analyse", "run"]);
    kill(child);
    assert!(lines(&desk, "run") >= LINES * (STEPS + 3));
}

#[test]
fn a_start_from_the_prior_is_as_deterministic() {
    let desk = desk();
    for (out, threads) in [("a", "1"), ("b", "2")] {
        desk.succeed(&["sample", CONFIG, "--out", out, "--start", "prior", "--threads", threads]);
    }
    same_run(&desk, "a", "b");
    let start: Vec<Vec<Vec<f64>>> = serde_json::from_value(desk.json("a/manifest.json")["start"].clone()).unwrap();
    let k: Vec<f64> = start.iter().flatten().map(|theta| theta[0]).collect();
    assert!(k.iter().all(|k| (0.0..=1.0).contains(k)));
    // the posterior is 0.02 wide
    assert!(k.iter().fold(0.0f64, |most, k| most.max(*k)) > 0.5, "{k:?}");
    let output = dimcmc(&["sample", CONFIG, "--out", "a", "--resume", "--start", "prior"], &desk.path(""));
    assert_eq!(output.status.code(), Some(2), "the start of a run that has begun cannot be chosen");
}

#[test]
fn optimise_finds_the_injected_planet_with_error_bars() {
    let desk = desk();
    let table = desk.succeed(&["optimise", CONFIG, "--out", "a", "--threads", "1"]);
    desk.succeed(&["optimize", CONFIG, "--out", "b", "--threads", "2"]);
    assert_eq!(desk.read("a/optimum.json"), desk.read("b/optimum.json"));
    says(&table, &["k_kms", "phi", "injected", "Well-defined maximum"]);
    let optimum = desk.json("a/optimum.json");
    assert_eq!(optimum["names"], json!(["k_kms", "phi"]));
    for (i, (name, truth)) in [("k_kms", 0.2), ("phi", 0.5)].into_iter().enumerate() {
        let (best, sd) = (&optimum["parameters"][name], &optimum["sd"][name]);
        let (best, sd) = (best.as_f64().unwrap(), sd.as_f64().unwrap());
        assert!(sd > 0.0 && (best - truth).abs() < 4.0 * sd, "{name}: {best} +- {sd}");
        let variance = optimum["covariance"][i][i].as_f64().unwrap();
        assert!((variance / (sd * sd) - 1.0).abs() < 1e-12);
    }
    assert_eq!(optimum["covariance"][0][1], optimum["covariance"][1][0]);
    // at a fixed period the quadratic has one maximum, and the climb from the config's values has found it
    assert_eq!(optimum["starts"].as_array().unwrap().len(), 1);
}

#[test]
fn american_spellings_are_understood() {
    let desk = desk();
    desk.set("/imaging/objective", json!("regularised-likelihood"));
    let british = desk.succeed(&["optimise", CONFIG, "--out", "a"]);
    desk.set("/imaging/objective", json!("regularized-likelihood"));
    let american = desk.succeed(&["optimize", CONFIG, "--out", "b"]);
    assert_eq!(british, american);
    assert_eq!(desk.read("a/optimum.json"), desk.read("b/optimum.json"));
}

#[test]
fn a_run_is_analysed_to_the_same_bytes() {
    let desk = finished();
    let summary = desk.read("run/summary.json");
    std::fs::remove_file(desk.path("run/summary.json")).unwrap();
    let table = desk.succeed(&["analyse", "run"]);
    assert_eq!(desk.read("run/summary.json"), summary);
    assert_eq!(desk.succeed(&["analyze", "run"]), table);
    assert_eq!(desk.read("run/summary.json"), summary);
    // the folder may move, and needs neither config nor data
    std::fs::rename(desk.path("run"), desk.path("moved")).unwrap();
    std::fs::remove_file(desk.path(CONFIG)).unwrap();
    assert_eq!(desk.succeed(&["analyse", "moved"]), table);
}

#[test]
fn a_target_out_of_reach_is_refused_with_its_floor() {
    let desk = desk();
    desk.set("/imaging/chi2_target", json!(0.3));
    for command in ["sample", "optimise"] {
        let message = desk.refusal(&[command, CONFIG, "--out", "out"]);
        says(&message, &["config.json: imaging.chi2_target", "0.3000", "floor", "0.4"]);
    }
}

#[test]
fn nothing_free_is_nothing_to_sample() {
    let desk = desk();
    desk.set("/parameters", json!({}));
    for command in ["sample", "optimise"] {
        says(&desk.refusal(&[command, CONFIG, "--out", "out"]), &["config.json: parameters", "no parameter is free"]);
    }
}

/// Half of the config's own amplitude is all that the prior allows: the chain begins there all the same.
#[test]
fn a_prior_that_excludes_the_best_orbit_is_no_obstacle() {
    let mut config = tiny(STEPS);
    config["parameters"]["k_kms"]["max"] = json!(0.1);
    config["planet"]["k_kms"] = json!(0.05);
    config["observations"]["simulate"]["truth"] = json!({ "k_kms": 0.2 });
    let desk = Desk::new(config);
    let table = desk.succeed(&["sample", CONFIG, "--out", "a"]);
    says(&table, &["k_kms", "phi"]);
    let highest = desk.json("a/summary.json")["parameters"]["k_kms"]["ci95"][1].as_f64().unwrap();
    assert!(highest <= 0.1);
}

/// Wherever the walkers start, and whichever moves they make, the posterior is the same.
#[test]
#[ignore = "long: .ci/run has it run"]
fn starts_and_moves_make_no_difference() {
    let mut config = tiny(STEPS);
    config["sampler"]["ess"] = json!(600);
    config["sampler"]["rhat"] = json!(1.05);
    config["sampler"]["steps"] = json!(5000);
    let desk = Desk::new(config);
    desk.succeed(&["sample", CONFIG, "--out", "a"]);
    desk.succeed(&["sample", CONFIG, "--out", "b", "--start", "prior"]);
    let mut config = desk.config.clone();
    config["sampler"]["moves"] = json!({ "surrogate": 0.0 });
    desk.write(CONFIG, &config.to_string());
    desk.succeed(&["sample", CONFIG, "--out", "c"]);
    let summaries = ["a", "b", "c"].map(|out| desk.json(&format!("{out}/summary.json")));
    for summary in &summaries {
        assert_eq!(summary["converged"], json!(true));
    }
    let kinds =
        |i: usize| summaries[i]["moves"].as_array().unwrap().iter().filter(|m| m["move"] == "surrogate").count();
    assert_eq!([kinds(0), kinds(1), kinds(2)], [1, 1, 0]);
    for name in ["k_kms", "phi"] {
        let of = |i: usize, key: &str| summaries[i]["parameters"][name][key].as_f64().unwrap();
        for other in [1, 2] {
            let error = of(0, "sd") * (1.6 / of(0, "ess") + 1.6 / of(other, "ess")).sqrt();
            let difference = of(0, "median") - of(other, "median");
            assert!(difference.abs() < 4.5 * error, "{name} {other}: {difference} with error {error}");
        }
    }
}
