//! Results that must hold whatever the paper's, each test named after the mistake that it would catch; and the program
//! on a row.

use super::{Args, list, rows, run};
use crate::cases::{Case, Nodes, Outcome, Route, paper, with};
use crate::report::{SUMMARY, TABLE};
use crate::rows::ROWS;
use clap::Parser as _;
use dimcmc::{Failure, Pool};
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::OnceLock;

/// Rotation period of the paper's star (d).
const ROTATION_PERIOD_D: f64 = 3.0;

/// Injected orbit: no two numbers alike, phi far from its mirror image and from half a turn.
const ORBIT: [(&str, f64); 3] = [("k_kms", 0.12), ("porb_over_prot", 1.6), ("phi", 0.2)];

/// Likelihood grid and periodogram of the paper's star with that orbit, on few pixels.
///
/// The program simulates only the star, and each profile is shifted by the formula of the method, written here
/// independently, through the velocity that the list of profiles subtracts: so a mistake in the program's own orbit
/// cannot cancel itself.
fn outcome(changes: &[(&str, Value)]) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    let lone = [("/planet", json!({ "k_kms": 0.0, "porb_over_prot": 1.0, "phi": 0.0 }))];
    let config = with(with(paper(), &lone), changes);
    std::fs::write(folder.path().join("lone.json"), config.to_string()).unwrap();
    let path = |name: &str| folder.path().join(name).into_os_string();
    let simulate = ["dimcmc".into(), "simulate".into(), path("lone.json"), "--out".into(), path("profiles")];
    assert_eq!(dimcmc::command_line(simulate), 0);
    let list = std::fs::read_to_string(folder.path().join("profiles/observations.txt")).unwrap();
    let [(_, k), (_, period), (_, phi)] = ORBIT;
    let shifted = |line: &str| {
        let (file, time) = line.split_once(char::is_whitespace).unwrap();
        let time: f64 = time.trim().parse().unwrap();
        let velocity = k * (TAU * (time / ROTATION_PERIOD_D / period - phi)).cos();
        format!("{file} {time} {}\n", -velocity)
    };
    let shifted: String = list.lines().filter(|line| !line.starts_with('#')).map(shifted).collect();
    std::fs::write(folder.path().join("profiles/shifted.txt"), shifted).unwrap();
    let own = [
        ("/observations", json!({ "path": folder.path().join("profiles/shifted.txt") })),
        ("/imaging/pixels", json!(1000)),
        ("/parameters/porb_over_prot/min", json!(1.2)),
        ("/parameters/porb_over_prot/max", json!(2.2)),
        // a start that is not the answer
        ("/planet", json!({ "k_kms": 0.05, "porb_over_prot": 1.8, "phi": 0.4 })),
    ];
    let config = with(config, &own);
    let case =
        Case { name: "test".into(), config, grid: Some(Nodes::Around(5)), chain: false, periodogram: Some(1000) };
    let mut outcome = case.run(folder.path(), &Pool::default()).unwrap();
    outcome.truth = ORBIT.map(|(name, value)| (name.to_owned(), value)).into();
    outcome
}

/// The outcome on the unmodified star of the paper, shared by tests.
fn plain() -> &'static Outcome {
    static MADE: OnceLock<Outcome> = OnceLock::new();
    MADE.get_or_init(|| outcome(&[]))
}

/// Deviation of every route from the injected value, in its error bars.
fn deviations(outcome: &Outcome, name: &str) -> Vec<(&'static str, f64)> {
    let of_route = |(route, found): (&'static str, &Route)| {
        let estimate = found.parameters.get(name).unwrap_or_else(|| panic!("{route}: {:?}", found.note));
        (route, outcome.deviation(name, estimate).unwrap() / estimate.error())
    };
    outcome.routes().map(of_route).collect()
}

/// Three error bars: wrong by chance once in 400 times, and the seeds are fixed.
fn assert_recovered(outcome: &Outcome, name: &str) {
    for (route, deviation) in deviations(outcome, name) {
        println!("{name} by {route}: {deviation:+.2} error bars");
        assert!(deviation.abs() < 3.0, "{name} by {route} is {deviation:+.2} error bars off");
    }
}

/// With the sign of K wrong phi would come out half a turn off: 12 error bars.
#[test]
#[ignore = "long: .ci/run has it run"]
fn k_has_the_right_sign_and_phi_the_right_zero_point() {
    let outcome = plain();
    for (name, _) in ORBIT {
        assert_recovered(outcome, name);
    }
    let phi = outcome.grid.as_ref().unwrap().parameters["phi"];
    assert!(phi.error() < 0.05, "too uncertain for the test: {}", phi.error());
}

/// A phase counted from the first profile, or in rotations, would differ: here a quarter of a turn or a fifth.
#[test]
#[ignore = "long: .ci/run has it run"]
fn phi_is_counted_in_orbital_cycles_from_the_epoch() {
    let cycles: Vec<f64> = (0..50).map(|k| 1.2 + 0.06 * f64::from(k)).collect();
    let outcome = outcome(&[("/observations/simulate/cycles", json!(cycles))]);
    assert_recovered(&outcome, "phi");
    assert_recovered(&outcome, "porb_over_prot");
}

/// The nodes of the likelihood grid are in the order of the table: the best node is the injected orbit, not one with
/// axes exchanged.
#[test]
#[ignore = "long: .ci/run has it run"]
fn axes_are_not_swapped() {
    let config = with(paper(), &[("/imaging/pixels", json!(1000))]);
    let at = Nodes::At([(0.06, 0.14, 3), (1.5, 1.9, 3), (0.4, 0.6, 3)]);
    let case = Case { name: "axes".into(), config, grid: Some(at), chain: false, periodogram: None };
    let folder = tempfile::tempdir().unwrap();
    case.run(folder.path(), &Pool::default()).unwrap();
    let text = std::fs::read_to_string(folder.path().join("grid/landscape.jsonl")).unwrap();
    let nodes: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let height = |node: &Value| node["log_likelihood"].as_f64().unwrap_or(f64::NEG_INFINITY);
    let best = nodes.iter().max_by(|a, b| height(a).total_cmp(&height(b))).unwrap();
    let place = ["k_kms", "porb_over_prot", "phi"].map(|name| best[name].as_f64().unwrap());
    assert_eq!(place, [0.1, 1.7, 0.5]);
}

/// The error bar of K is that of an independent implementation from the full curvature, 10.6 m/s (to 10 %: another
/// orbit, other noise), and twice that at half the signal-to-noise ratio (to 15 %: fewer spots are seen in more noise).
/// A chi2 scaled or counted twice would change both.
#[test]
#[ignore = "long: .ci/run has it run"]
fn chi2_has_its_scale() {
    const SIGMA_K_KMS: f64 = 0.0106;
    assert_eq!(paper()["observations"]["simulate"]["snr"], 1000.0);
    let noisy = outcome(&[("/observations/simulate/snr", json!(500.0))]);
    let errors = |outcome: &Outcome| {
        outcome.routes().map(|(route, found)| (route, found.parameters["k_kms"].error())).collect::<Vec<_>>()
    };
    for ((route, good), (_, poor)) in errors(plain()).into_iter().zip(errors(&noisy)) {
        println!("{route}: {good} and {poor} km/s");
        assert!((good / SIGMA_K_KMS - 1.0).abs() < 0.1, "{route}: {good}");
        assert!((poor / good - 2.0).abs() < 0.3, "{route}: {good} and {poor}");
    }
}

/// Runs the program on the reduced row R1, in `folder`.
fn first_row(folder: &Path, more: &[&str]) -> Result<(), Failure> {
    let [out, work] = ["out", "work"].map(|name| folder.join(name).to_str().unwrap().to_owned());
    run(&Args::parse_from([&["reproduce", "r1", "--out", &out, "--work", &work], more].concat()))
}

#[test]
fn a_row_is_done_once() {
    let folder = tempfile::tempdir().unwrap();
    first_row(folder.path(), &["--quick"]).unwrap();
    let row = folder.path().join("out/R1");
    let table = row.join(TABLE);
    let written = std::fs::read_to_string(&table).unwrap();
    assert_eq!(written.lines().count(), 51, "a line a profile");
    assert!(row.join("R1.png").is_file());
    let summary: Value = serde_json::from_slice(&std::fs::read(row.join(SUMMARY)).unwrap()).unwrap();
    assert_eq!(summary["command"], "cargo run --release --example reproduce -- R1 --quick");
    std::fs::write(&table, "left alone").unwrap();
    first_row(folder.path(), &["--quick"]).unwrap();
    assert_eq!(std::fs::read_to_string(&table).unwrap(), "left alone");
    let whole = first_row(folder.path(), &[]).unwrap_err();
    assert_eq!(whole.exit_code(), 2);
    assert!(whole.to_string().contains("--quick") && whole.to_string().contains("--force"), "{whole}");
    first_row(folder.path(), &["--quick", "--force"]).unwrap();
    assert_eq!(std::fs::read_to_string(&table).unwrap(), written, "the same bytes");
}

#[test]
fn rows_are_listed_and_others_refused() {
    let all = list(&rows(&[]).unwrap());
    assert!(ROWS.iter().all(|row| all.contains(row.name) && all.contains(row.paper)), "{all}");
    let wrong = rows(&["R99".to_owned()]).unwrap_err();
    assert_eq!(wrong.exit_code(), 2);
    assert!(wrong.to_string().contains("R99"));
    let quick = Args::parse_from(["reproduce", "--quick"]).folders();
    assert_eq!(quick.map(|folder| folder.to_str().unwrap().to_owned()), ["runs/quick", "runs/reproduce_quick"]);
}
