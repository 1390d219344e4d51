//! The program as users run it: what commands write, and one clear line for every error.

use crate::desk::{Desk, dimcmc, says, star, text, with_line};
use serde_json::{Value, json};
use std::path::Path;

/// A small star, simulated.
fn simulated() -> Value {
    json!({
        "star": star(),
        "planet": { "k_kms": 0.1, "porb_over_prot": 1.7, "phi": 0.5 },
        "observations": { "simulate": {
            "spots": [[30, 40, 25, 0.8], [200, 10, 15, 0.9]],
            "cycles": [0.0, 0.11, 0.23, 0.37, 0.52, 0.66, 0.79, 0.91],
            "velocity_kms": { "min": -28.8, "max": 28.8, "step": 1.8 },
            "snr": 500, "seed": 7, "pixels": 1000
        } },
        "imaging": { "pixels": 300, "chi2_target": 1.05, "objective": "spottedness" },
        "parameters": {
            "k_kms": { "prior": "uniform", "min": 0.0, "max": 0.3 },
            "phi": { "prior": "periodic" }
        },
        "sampler": { "walkers": 8 }
    })
}

/// The same star, its observations from files.
fn from_files() -> Value {
    let mut config = simulated();
    config["observations"] = json!({ "path": "data/observations.txt" });
    config
}

/// A desk with simulated observations in `data`.
fn desk(config: Value) -> Desk {
    let desk = Desk::new(config);
    desk.write("simulated.json", &simulated().to_string());
    desk.succeed(&["simulate", "simulated.json", "--out", "data"]);
    desk
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Columns of a CSV file by name.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let k = lines.next().unwrap().split(',').position(|c| c == name).unwrap_or_else(|| panic!("no column {name}"));
    lines.map(|line| line.split(',').nth(k).unwrap().parse().unwrap()).collect()
}

#[test]
fn simulated_files_give_the_map_of_the_simulation() {
    let desk = desk(from_files());
    let truth = desk.json("data/truth.json");
    assert_eq!(truth["spots"], json!([[30.0, 40.0, 25.0, 0.8], [200.0, 10.0, 15.0, 0.9]]));
    assert_eq!(truth["parameters"]["k_kms"], 0.1);
    assert_eq!((&truth["snr"], &truth["seed"]), (&json!(500.0), &json!(7)));

    let table = desk.succeed(&["map", "config.json", "--out", "a"]);
    desk.succeed(&["map", "simulated.json", "--out", "b", "--threads", "1", "--quiet"]);
    says(&table, &["chi2", "spottedness", "RV filtered", "a: map.json, profiles.csv, rv.csv, fit.json"]);
    let (a, b) = (desk.json("a/map.json"), desk.json("b/map.json"));
    for key in ["longitude_deg", "latitude_deg", "area_fraction", "spot_filling"] {
        for (a, b) in numbers(&a[key]).into_iter().zip(numbers(&b[key])) {
            // files hold intensities to 5e-13, a part in 1e9 of sigma; lambda and the map follow them
            assert!((a - b).abs() <= 1e-6 * b.abs(), "{key}: {a} {b}");
        }
    }
    assert!(a["true_spot_filling"].is_null());
    assert_eq!(numbers(&b["true_spot_filling"]).len(), numbers(&b["spot_filling"]).len());
    let (a, b) = (desk.json("a/fit.json"), desk.json("b/fit.json"));
    for key in ["chi2", "lambda", "entropy", "spottedness", "observed_rv_rms_kms", "filtered_rv_rms_kms"] {
        let (a, b) = (a[key].as_f64().unwrap(), b[key].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 1e-6, "{key}: {a} {b}");
    }
    assert_eq!((&a["status"], &a["truth"]), (&json!("converged"), &Value::Null));
    assert_eq!(b["truth"]["porb_over_prot"], 1.7);
}

#[test]
fn a_map_is_a_fit() {
    let desk = desk(simulated());
    desk.succeed(&["map", "config.json", "--out", "a"]);
    let fit = desk.json("a/fit.json");
    let data = 8.0 * 33.0;
    assert!((fit["chi2"].as_f64().unwrap() / (1.05 * data) - 1.0).abs() < 1e-9);
    // the gradients of entropy and chi2 are parallel
    assert!(fit["test"].as_f64().unwrap() < 1e-6, "{}", fit["test"]);
    let profiles = desk.read("a/profiles.csv");
    let chi2: f64 = column(&profiles, "residual")
        .iter()
        .zip(column(&profiles, "sigma"))
        .map(|(residual, sigma)| (residual / sigma).powi(2))
        .sum();
    assert!((chi2 / (1.05 * data) - 1.0).abs() < 1e-9, "{chi2}");
    let rv = desk.read("a/rv.csv");
    let [observed, modelled, filtered, orbit] =
        ["observed_kms", "modelled_kms", "filtered_kms", "orbit_kms"].map(|c| column(&rv, c));
    for k in 0..8 {
        assert!((observed[k] - modelled[k] - filtered[k]).abs() < 1e-12);
    }
    // phi = 0.5: the star approaches fastest at cycle 0
    assert_eq!(orbit[0], -0.1);
    let map = desk.json("a/map.json");
    let spottedness: f64 =
        numbers(&map["spot_filling"]).iter().zip(numbers(&map["area_fraction"])).map(|(s, a)| s * a).sum();
    assert!((spottedness / fit["spottedness"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    let rings: f64 = numbers(&map["ring_pixels"]).iter().sum();
    assert_eq!(rings, map["pixels"].as_f64().unwrap());
}

#[test]
fn wrong_arguments_are_refused() {
    let here = Path::new(".");
    for (args, part) in [(&["map"][..], "CONFIG"), (&["mapp"], "map"), (&["map", "x", "--threads", "0"], "threads")] {
        let output = dimcmc(args, here);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        says(&text(&output.stderr), &["error: ", part]);
    }
}

#[test]
fn nothing_is_overwritten_without_force() {
    let desk = desk(simulated());
    desk.write("data/mine.txt", "precious");
    for command in ["map", "simulate"] {
        let message = desk.refusal(&[command, "config.json", "--out", "data"]);
        says(&message, &["--out data", "not empty", "--force"]);
        let message = desk.refusal(&[command, "config.json", "--out", "config.json"]);
        says(&message, &["--out config.json", "not a folder"]);
        let message = desk.refusal(&[command, "config.json", "--out", "config.json/x"]);
        says(&message, &["--out config.json/x", "config.json is not a folder"]);
        desk.succeed(&[command, "config.json", "--out", "data", "--force"]);
        assert_eq!(desk.read("data/mine.txt"), "precious");
    }
    std::fs::create_dir(desk.path("empty")).unwrap();
    desk.succeed(&["map", "config.json", "--out", "empty"]);
    desk.succeed(&["map", "config.json", "--out", "new/within/new"]);
}

#[test]
fn bad_profiles_are_refused_by_file_and_line() {
    // rows begin on line 3; velocities -28.8, -27.0, ...
    let row = |change: &'static str| move |text: String| with_line(&text, 5, change);
    // bad bins at the ends are left out
    let middle = |change: &'static str| move |text: String| with_line(&text, 18, change);
    type Change = Box<dyn Fn(String) -> String>;
    let cases: Vec<(&str, &str, Change, &[&str])> = vec![
        ("short row", "p002.prof", Box::new(row("-25.2 0.99")), &["data/p002.prof:5:", "2 columns instead of 3"]),
        ("text", "p002.prof", Box::new(row("-25.2 0.9x 0.002")), &["data/p002.prof:5:", "\"0.9x\" is not a number"]),
        ("NaN", "p002.prof", Box::new(middle("-1.8 NaN 0.002")), &["data/p002.prof:18:", "NaN"]),
        ("zero sigma", "p002.prof", Box::new(middle("-1.8 0.99 0")), &["data/p002.prof:18:", "sigma"]),
        ("negative sigma", "p002.prof", Box::new(middle("-1.8 0.99 -0.002")), &["data/p002.prof:18:", "sigma"]),
        ("backwards", "p002.prof", Box::new(row("-27.5 0.99 0.002")), &["data/p002.prof:5:", "does not increase"]),
        ("uneven", "p002.prof", Box::new(row("-25.0 0.99 0.002")), &["data/p002.prof:5:", "not uniform"]),
        (
            "too few points",
            "p002.prof",
            Box::new(|text: String| text.replace(" 33 2", " 34 2")),
            &["data/p002.prof:2:", "announces 34 points, but 33 rows follow"],
        ),
        (
            "another axis",
            "p002.prof",
            Box::new(|text: String| {
                let moved = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
                    [v, i, s] => format!("{} {i} {s}\n", v.parse::<f64>().unwrap() + 0.5),
                    _ => format!("{line}\n"),
                };
                text.lines().enumerate().map(|(k, l)| if k < 2 { format!("{l}\n") } else { moved(l) }).collect()
            }),
            &["data/p002.prof", "velocity axis", "differs", "data/p000.prof"],
        ),
        (
            "empty list",
            "observations.txt",
            Box::new(|_| "# nothing\n".into()),
            &["data/observations.txt", "lists no profile"],
        ),
        (
            "absent profile",
            "observations.txt",
            Box::new(|text: String| text.replace("p003.prof", "q003.prof")),
            &["data/observations.txt:5:", "q003.prof"],
        ),
        (
            "bad time",
            "observations.txt",
            Box::new(|text: String| with_line(&text, 3, "p001.prof tonight")),
            &["data/observations.txt:3:", "tonight"],
        ),
    ];
    let desk = desk(from_files());
    for (name, file, change, parts) in cases {
        println!("-- {name}");
        let file = format!("data/{file}");
        let good = desk.read(&file);
        desk.edit(&file, change);
        says(&desk.refusal(&["map", "config.json", "--out", "out"]), parts);
        desk.write(&file, &good);
    }
    std::fs::remove_file(desk.path("data/p004.prof")).unwrap();
    let message = desk.refusal(&["map", "config.json", "--out", "out"]);
    says(&message, &["data/observations.txt:6:", "data/p004.prof"]);
    std::fs::remove_file(desk.path("data/observations.txt")).unwrap();
    says(&desk.refusal(&["map", "config.json", "--out", "out"]), &["data/observations.txt", "cannot read"]);
}

#[test]
fn bad_configs_are_refused_by_key() {
    let desk = desk(from_files());
    for (pointer, value, parts) in [
        ("/star/vsinni_kms", json!(20.0), &["star.vsinni_kms", "did you mean vsini_kms?"][..]),
        ("/colour", json!("red"), &["unknown key colour"]),
        ("/star/vsini_kms", json!("fast"), &["star.vsini_kms", "expected a number"]),
        ("/parameters/k_kms", json!({ "prior": "uniform", "min": 0.3, "max": 0.0 }), &["parameters.k_kms.min", "0.3"]),
        ("/planet/k_kms", json!(0.5), &["planet.k_kms", "outside its prior"]),
        ("/star/vsini_kms", json!(0.0), &["star.vsini_kms", "above 0"]),
        ("/star/vsini_kms", json!(1e9), &["star.vsini_kms", "up to"]),
        ("/star/domega_rad_d", json!(1e6), &["star.vsini_kms", "star.domega_rad_d"]),
        ("/star/line", json!({ "sigma_kms": 1e-6, "equivalent_width_kms": 5.8 }), &["star.line.sigma_kms", "narrow"]),
        ("/star/inclination_deg", json!(-5.0), &["star.inclination_deg", "-5"]),
        ("/star/inclination_deg", json!(95.0), &["star.inclination_deg", "95"]),
        ("/sampler/walkers", json!(2), &["sampler.walkers", "at least 4"]),
        ("/sampler/walkers", json!(9), &["sampler.walkers", "even"]),
        ("/imaging/chi2_target", json!(0.2), &["imaging.chi2_target", "0.2000", "floor", "comes down to"]),
        ("/imaging/chi2_target", json!(1e5), &["imaging.chi2_target", "star without spots"]),
    ] {
        desk.set(pointer, value.clone());
        let message = desk.refusal(&["map", "config.json", "--out", "out"]);
        says(&message, parts);
        assert!(message.starts_with("config.json: "), "{pointer} {value}: {message}");
    }
    desk.write("config.json", "{ \"star\": ");
    says(&desk.refusal(&["map", "config.json", "--out", "out"]), &["config.json:1:", "JSON"]);
    says(&desk.refusal(&["map", "absent.json", "--out", "out"]), &["absent.json", "cannot read"]);
    desk.write("config.json", &from_files().to_string());
    let message = desk.refusal(&["simulate", "config.json", "--out", "out"]);
    says(&message, &["config.json", "observations.simulate", "missing"]);
}

#[test]
fn lo_peg_has_a_map() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = root.join("../shared/data/lopeg/observations.txt");
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    // the shipped config, whose path to the data is valid where the repository is beside them
    let mut config: Value = serde_json::from_slice(&std::fs::read(root.join("configs/lopeg.json")).unwrap()).unwrap();
    config["observations"]["path"] = json!(data);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lopeg.json"), config.to_string()).unwrap();
    let output = dimcmc(&["map", "lopeg.json", "--out", "map"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    println!("{}", text(&output.stdout));
    let fit: Value = serde_json::from_slice(&std::fs::read(folder.path().join("map/fit.json")).unwrap()).unwrap();
    let number = |key: &str| fit[key].as_f64().unwrap();
    assert_eq!(fit["profiles"], 16);
    let correlated_bins = fit["measured"]["errors"]["correlated_bins"].as_f64().unwrap();
    assert!((number("chi2_per_datum") * correlated_bins - 0.97).abs() < 1e-9);
    // first-moment velocities of these data scatter by 1.33 km/s; most of it is spots
    assert!(number("filtered_rv_rms_kms") < 0.5 * number("observed_rv_rms_kms"));
    assert!((0.01..0.25).contains(&number("spottedness")), "{}", number("spottedness"));
}

/// A full disk is a failure, a closed pipe is not.
#[test]
#[cfg(target_os = "linux")]
fn what_cannot_be_printed_is_a_failure() {
    let desk = Desk::new(json!(null));
    for args in [&["schema"][..], &["completions", "bash"], &["man", "--out", "man"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let program = || std::process::Command::new(env!("CARGO_BIN_EXE_dimcmc"));
        let output = program().args(args).current_dir(desk.path("")).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}");
        let message = text(&output.stderr);
        says(&message, &["error: standard output: cannot write: "]);
        assert_eq!(message.lines().count(), 1, "{message}");
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let again = [args, if args[0] == "man" { &["--force"] } else { &[] }].concat();
        let output = program().args(again).current_dir(desk.path("")).stdout(writer).output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty(), "{args:?}: {}", text(&output.stderr));
    }
}

/// Repeating the paper's experiments is a separate program; the message here names it.
#[test]
fn a_command_that_moved_says_where() {
    for args in [&["reproduce", "R1", "--quick"][..], &["--quiet", "reproduce", "--list"], &["help", "reproduce"]] {
        let output = dimcmc(args, Path::new("."));
        assert_eq!(output.status.code(), Some(2));
        let told = "error: `dimcmc reproduce` is now `cargo run --release --example reproduce`\n";
        assert_eq!(text(&output.stderr), told, "{args:?}");
    }
}
