//! `export` as users run it: content of the files, reading by other programs, and refusals.

use crate::desk::{Desk, dimcmc, says, text, two_spots};
use crate::shared::{self, ENSEMBLES, WALKERS};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;

const CONFIG: &str = "config.json";

const FORMATS: [&str; 4] = ["zarr", "emcee", "getdist", "csv"];

/// A desk with a run in `run`.
fn small() -> Desk {
    let desk = shared::desk();
    std::fs::rename(desk.path("sample"), desk.path("run")).unwrap();
    desk
}

/// Steps of the run, including the start.
fn steps(desk: &Desk) -> usize {
    desk.lines("run/chain.jsonl") / (ENSEMBLES * WALKERS)
}

/// Lines of the chain.
fn records(desk: &Desk) -> Vec<Value> {
    desk.read("run/chain.jsonl").lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// Little-endian numbers of a file.
fn floats(desk: &Desk, name: &str) -> Vec<f64> {
    let bytes = std::fs::read(desk.path(name)).unwrap();
    bytes.chunks_exact(8).map(|eight| f64::from_le_bytes(eight.try_into().unwrap())).collect()
}

fn integers(desk: &Desk, name: &str) -> Vec<usize> {
    let bytes = std::fs::read(desk.path(name)).unwrap();
    bytes.chunks_exact(8).map(|eight| i64::from_le_bytes(eight.try_into().unwrap()) as usize).collect()
}

/// The lines of the chain in the order of a group's draws, ensemble after ensemble.
fn in_order(desk: &Desk, records: &[Value], store: &str, group: &str) -> Vec<Value> {
    let of = |name: &str| integers(desk, &format!("{store}/{group}/{name}/c/0"));
    let draws: Vec<(usize, usize)> = of("step").into_iter().zip(of("walker")).collect();
    let place = |e: usize, (step, walker): (usize, usize)| (step * ENSEMBLES + e) * WALKERS + walker;
    (0..ENSEMBLES).flat_map(|e| draws.iter().map(move |draw| place(e, *draw))).map(|k| records[k].clone()).collect()
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn other_programs_find_what_the_summary_says() {
    let Some(python) = crate::python::python() else { return };
    let moves = json!({ "surrogate": 0 });
    let desk = Desk::new(two_spots(json!({ "ensembles": 4, "walkers": 8, "steps": 800, "ess": 1e6, "moves": moves })));
    desk.succeed(&["sample", CONFIG, "--out", "run"]);
    for format in FORMATS {
        let said = desk.succeed(&["export", "run", "--format", format]);
        says(&said, &["written: run/chain", "note: the chain has not converged"]);
    }
    for script in ["tests/export.py", "examples/read_run.py"] {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join(script);
        // GetDist keeps what it has read in the user's folders if it is let
        let output = Command::new(&python)
            .arg(script)
            .arg("run")
            .current_dir(desk.path(""))
            .env("HOME", desk.path(""))
            .env("MPLBACKEND", "agg")
            .output()
            .unwrap();
        println!("{}", text(&output.stdout));
        assert!(output.status.success(), "{}", text(&output.stderr));
    }
    assert!(std::fs::read(desk.path("corner.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn a_zarr_store_has_every_draw_once() {
    let desk = small();
    let out = desk.succeed(&["export", "run", "--format", "zarr", "--out", "new/a.zarr"]);
    says(&out, &["written: new/a.zarr\n"]);
    let records = records(&desk);
    let discarded = desk.json("run/summary.json")["discarded_steps"].as_u64().unwrap() as usize;
    let whole = steps(&desk);
    assert!((1..=whole / 2).contains(&discarded) && records.len() == whole * ENSEMBLES * WALKERS);
    for (group, steps) in [("posterior", discarded..whole), ("warmup_posterior", 0..discarded)] {
        let stats = group.replace("posterior", "sample_stats");
        let draws = in_order(&desk, &records, "new/a.zarr", group);
        let mut places: Vec<[u64; 3]> =
            draws.iter().map(|r| ["ensemble", "step", "walker"].map(|key| r[key].as_u64().unwrap())).collect();
        places.sort();
        places.dedup();
        assert_eq!(places.len(), steps.len() * ENSEMBLES * WALKERS);
        assert!(places.iter().all(|place| steps.contains(&(place[1] as usize))));
        let wanted = |key: &str| draws.iter().map(|record| number(&record[key])).collect::<Vec<f64>>();
        for name in ["k_kms", "spot_lifetime_d"] {
            assert_eq!(floats(&desk, &format!("new/a.zarr/{group}/{name}/c/0/0")), wanted(name));
        }
        for (name, key) in [("lp", "log_prob"), ("ln_evidence", "ln_evidence")] {
            assert_eq!(floats(&desk, &format!("new/a.zarr/{stats}/{name}/c/0/0")), wanted(key), "{name}");
        }
        let phases = floats(&desk, &format!("new/a.zarr/{group}/phi/c/0/0"));
        let apart = phases.iter().zip(wanted("phi")).map(|(x, y)| (x - y) - (x - y).round());
        assert!(apart.map(f64::abs).fold(0.0, f64::max) < 1e-15);
        let bytes = std::fs::read(desk.path(&format!("new/a.zarr/{stats}/accepted/c/0/0"))).unwrap();
        assert_eq!(bytes, draws.iter().map(|r| u8::from(r["accepted"] == true)).collect::<Vec<u8>>());
    }
    // the mode is near 0: unwrapped, phases are on both sides of it
    let phases = floats(&desk, "new/a.zarr/posterior/phi/c/0/0");
    assert!(phases.iter().any(|x| *x < 0.0 || *x >= 1.0));
    let node = desk.json("new/a.zarr/posterior/phi/zarr.json");
    assert_eq!(node["shape"], json!([ENSEMBLES, (whole - discarded) * WALKERS]));
    assert_eq!((&node["dimension_names"], &node["data_type"]), (&json!(["chain", "draw"]), &json!("float64")));
    assert_eq!((&node["attributes"]["units"], &node["attributes"]["injected"]), (&json!("cycles"), &json!(0.0)));
    let root = desk.json("new/a.zarr/zarr.json");
    assert_eq!(root["attributes"]["inference_library_version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(root["attributes"]["discarded_steps"], discarded);
    let priors: Value = serde_json::from_str(root["attributes"]["priors"].as_str().unwrap()).unwrap();
    assert_eq!(priors["k_kms"], json!({ "prior": "uniform", "min": 0.0, "max": 1.0 }));
}

#[test]
fn text_formats_have_the_digits_of_the_chain() {
    let desk = small();
    desk.succeed(&["export", "run", "--format", "csv"]);
    desk.succeed(&["export", "run", "--format", "getdist"]);
    desk.succeed(&["export", "run", "--format", "zarr"]);
    let records = records(&desk);
    let discarded = desk.json("run/summary.json")["discarded_steps"].as_u64().unwrap();
    let table = desk.read("run/chain.csv");
    let mut lines = table.lines();
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let names = "ensemble step walker warmup k_kms phi spot_lifetime_d log_prob ln_evidence accepted status move \
                 proposed model_applications t_max_rv_d t_conjunction_d";
    assert_eq!(columns.join(" "), names);
    assert_eq!(lines.clone().count(), records.len());
    for (line, record) in lines.zip(&records) {
        for (column, cell) in columns.iter().zip(line.split(',')) {
            match &record[*column] {
                Value::Number(wanted) => assert_eq!(cell.parse::<f64>().unwrap(), wanted.as_f64().unwrap(), "{line}"),
                Value::String(wanted) => assert_eq!(cell, wanted),
                Value::Bool(wanted) => assert_eq!(cell, wanted.to_string()),
                Value::Null if column.starts_with("t_") => assert!(cell.parse::<f64>().unwrap().abs() < 6.0, "{line}"),
                _ if *column == "warmup" => assert_eq!(cell == "true", record["step"].as_u64().unwrap() < discarded),
                _ => assert_eq!((*column, cell, &record["step"]), ("move", "", &json!(0))),
            }
        }
    }

    let draws = in_order(&desk, &records, "run/chain.zarr", "posterior");
    let phases = floats(&desk, "run/chain.zarr/posterior/phi/c/0/0");
    let rows = (1..=ENSEMBLES).map(|n| desk.read(&format!("run/chain_{n}.txt"))).collect::<String>();
    assert_eq!(rows.lines().count(), draws.len());
    for (row, (record, phi)) in rows.lines().zip(draws.iter().zip(phases)) {
        let found: Vec<f64> = row.split(' ').map(|cell| cell.parse().unwrap()).collect();
        let [k, log_prob, lifetime, evidence] =
            ["k_kms", "log_prob", "spot_lifetime_d", "ln_evidence"].map(|key| number(&record[key]));
        // P = 5.1 d, counted from day 0
        let quarters = (found[6] - found[5] - 0.25 * 5.1) / 5.1;
        let turns = found[5] / 5.1 - phi;
        assert!((quarters - quarters.round()).abs() < 1e-12 && (turns - turns.round()).abs() < 1e-12, "{row}");
        assert_eq!([&found[..5], &found[7..]].concat(), [1.0, -log_prob, k, phi, lifetime, evidence]);
    }
    let names = "k_kms\tK\\;[\\mathrm{km/s}]\nphi\t\\phi\\;[\\mathrm{cycles}]\n\
                 spot_lifetime_d\t\\tau_\\mathrm{spot}\\;[\\mathrm{d}]\n\
                 t_max_rv_d*\tT_\\mathrm{max\\,RV}\\;[\\mathrm{d}]\n\
                 t_conjunction_d*\tT_\\mathrm{conj}\\;[\\mathrm{d}]\n\
                 ln_evidence*\t\\mathrm{ln\\_evidence}\n";
    assert_eq!(desk.read("run/chain.paramnames"), names);
    let ranges = desk.read("run/chain.ranges");
    let phi: Vec<&str> = ranges.lines().nth(1).unwrap().split(' ').collect();
    let bound = |k: usize| phi[k].parse::<f64>().unwrap();
    assert!(ranges.starts_with("k_kms 0 1\n") && (phi[0], phi[3]) == ("phi", "periodic"), "{ranges}");
    assert!((bound(2) - bound(1) - 1.0).abs() < 1e-15 && phases_within(&rows, bound(1), bound(2)));
}

fn phases_within(rows: &str, low: f64, high: f64) -> bool {
    rows.lines().all(|row| (low..=high).contains(&row.split(' ').nth(3).unwrap().parse::<f64>().unwrap()))
}

#[test]
fn the_hdf5_file_holds_the_chain_step_by_step() {
    let desk = small();
    desk.succeed(&["export", "run", "--format", "emcee"]);
    let bytes = std::fs::read(desk.path("run/chain.h5")).unwrap();
    assert!(bytes.starts_with(b"\x89HDF\r\n\x1a\n"));
    let later = &records(&desk)[ENSEMBLES * WALKERS..];
    let holds = |numbers: Vec<f64>| {
        let wanted: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        bytes.windows(wanted.len()).any(|window| window == wanted)
    };
    assert!(holds(later.iter().map(|record| number(&record["log_prob"])).collect()));
    // blobs: derived quantities come after ln_evidence, as in the last columns of csv
    desk.succeed(&["export", "run", "--format", "csv"]);
    let csv = desk.read("run/chain.csv");
    let derived = csv.lines().skip(1 + ENSEMBLES * WALKERS).map(|line| {
        let cells: Vec<f64> = line.rsplit(',').take(2).map(|cell| cell.parse().unwrap()).collect();
        [cells[1], cells[0]]
    });
    let blobs = later.iter().zip(derived);
    let blobs = blobs.flat_map(|(r, [maximum, conjunction])| [number(&r["ln_evidence"]), maximum, conjunction]);
    assert!(holds(blobs.collect()));
    let accepted =
        |w: usize| later.iter().skip(w).step_by(ENSEMBLES * WALKERS).filter(|r| r["accepted"] == true).count();
    assert!(holds((0..ENSEMBLES * WALKERS).map(|walker| accepted(walker) as f64).collect()));
}

#[test]
fn the_same_bytes_again_and_nothing_overwritten() {
    let desk = small();
    for format in FORMATS {
        desk.succeed(&["export", "run", "--format", format]);
    }
    let before = desk.inventory();
    for (format, name) in FORMATS.into_iter().zip(["chain.zarr", "chain.h5", "chain_1.txt", "chain.csv"]) {
        let message = desk.refusal(&["export", "run", "--format", format]);
        says(&message, &[&format!("run/{name}: is there already"), "--out", "--force"]);
        desk.succeed(&["export", "run", "--format", format, "--force", "--threads", "1"]);
        assert!(desk.inventory() == before, "{format}");
    }
    // folders and files of others stay, whatever the user says
    std::fs::create_dir(desk.path("mine")).unwrap();
    desk.write("mine/zarr.json", r#"{"zarr_format":3,"node_type":"group","attributes":{}}"#);
    let message = desk.refusal(&["export", "run", "--format", "zarr", "--out", "mine", "--force"]);
    says(&message, &["mine: is there already, and no earlier export"]);
    let message = desk.refusal(&["export", "run", "--format", "zarr", "--out", CONFIG, "--force"]);
    says(&message, &["config.json: is there already, and no earlier export"]);
    for format in ["csv", "emcee"] {
        let message = desk.refusal(&["export", "run", "--format", format, "--out", "run/chain.jsonl", "--force"]);
        says(&message, &["run/chain.jsonl: is there already, and no earlier export"]);
        let message = desk.refusal(&["export", "run", "--format", format, "--out", "mine", "--force"]);
        says(&message, &["mine: is a folder"]);
        let message = desk.refusal(&["export", "run", "--format", format, "--out", "config.json/x", "--force"]);
        says(&message, &["config.json/x: ", "config.json is not a folder"]);
    }
    says(&desk.refusal(&["export", "run", "--format", "csv", "--out", ".."]), &["..: is no name"]);
    for (name, text) in [("night_1.txt", "my notes of that night\n"), ("log_2.txt", "1 2 3\n"), ("a.ranges", "x 0 1\n")]
    {
        desk.write(name, text);
        let root = &name[..name.find(['_', '.']).unwrap()];
        let message = desk.refusal(&["export", "run", "--format", "getdist", "--out", root, "--force"]);
        says(&message, &[&format!("{name}: is there already, and no earlier export")]);
        assert_eq!(desk.read(name), text);
    }
    // an export that was interrupted is one
    for name in ["chain.paramnames", "chain.ranges"] {
        std::fs::remove_file(desk.path(&format!("run/{name}"))).unwrap();
    }
    desk.succeed(&["export", "run", "--format", "getdist", "--force"]);
    assert!(desk.path("run/chain.paramnames").exists());
    // GetDist would read a third chain, of another run perhaps, along with these two
    desk.write("run/chain_3.txt", "1 0 0 0 0 0\n");
    let message = desk.refusal(&["export", "run", "--format", "getdist", "--force"]);
    says(&message, &["run/chain_3.txt: GetDist would take it for one of the chains"]);
}

#[test]
fn what_cannot_be_exported_is_refused() {
    let desk = small();
    desk.refusal(&["export", "nowhere", "--format", "csv"]);
    for args in [&["export", "run"][..], &["export", "run", "--format", "fits"]] {
        let output = dimcmc(args, &desk.path(""));
        assert_eq!(output.status.code(), Some(2));
        says(&text(&output.stderr), &["error: ", "--format <FORMAT>"]);
    }
    says(&text(&dimcmc(&["export", "run", "--format", "fits"], &desk.path("")).stderr), &["zarr, emcee, getdist, csv"]);
    std::fs::remove_file(desk.path("run/summary.json")).unwrap();
    let chain = desk.read("run/chain.jsonl");
    let step: String = chain.lines().take(ENSEMBLES * WALKERS).map(|line| format!("{line}\n")).collect();
    let whole =
        |desk: &Desk, format: &str| desk.succeed(&["export", "run", "--format", format, "--out", "out", "--force"]);
    // not one step
    for cut in ["", &step[..step.len() - 1]] {
        desk.write("run/chain.jsonl", cut);
        for format in FORMATS {
            let message = desk.refusal(&["export", "run", "--format", format, "--out", "out/of/this"]);
            says(&message, &["run/chain.jsonl: the chain has no complete step"]);
        }
    }
    // the start alone: nothing to discard, and no step for emcee
    desk.write("run/chain.jsonl", &step);
    let message = desk.refusal(&["export", "run", "--format", "emcee", "--out", "out/of/this"]);
    says(&message, &["run/chain.jsonl: only the start"]);
    whole(&desk, "zarr");
    assert_eq!(desk.json("out/posterior/phi/zarr.json")["shape"], json!([ENSEMBLES, WALKERS]));
    assert!(!desk.path("out/warmup_posterior").exists());
    // a line in the middle that is none
    desk.write("run/chain.jsonl", &crate::desk::with_line(&chain, 20, "{}"));
    says(&desk.refusal(&["export", "run", "--format", "csv"]), &["run/chain.jsonl, line 20: "]);
}

#[test]
fn a_run_may_grow_meanwhile() {
    let desk = small();
    // a chain that has ended would be cut
    std::fs::remove_file(desk.path("run/summary.json")).unwrap();
    let chain = desk.read("run/chain.jsonl");
    let (size, whole) = (ENSEMBLES * WALKERS, steps(&desk));
    let ends: Vec<usize> = chain.match_indices('\n').map(|(k, _)| k + 1).collect();
    // within the last line, and after a line that is not the last of its step
    for cut in [chain.len() - 40, ends[ends.len() - 3]] {
        desk.write("run/chain.jsonl", &chain[..cut]);
        for format in FORMATS {
            desk.succeed(&["export", "run", "--format", format, "--out", &format!("{format}/x"), "--force"]);
        }
        assert_eq!(desk.lines("csv/x"), 1 + (whole - 1) * size);
        let shape = desk.json("zarr/x/posterior/k_kms/zarr.json")["shape"][1].as_u64().unwrap() as usize;
        let warmup = desk.json("zarr/x/warmup_posterior/k_kms/zarr.json")["shape"][1].as_u64().unwrap() as usize;
        assert_eq!(shape + warmup, (whole - 1) * WALKERS);
        assert_eq!(desk.lines("getdist/x_1.txt"), shape);
        assert_eq!(desk.read("run/chain.jsonl").len(), cut, "the chain is left alone");
    }
}

/// A desk with a search in `search`.
fn searched() -> Desk {
    let desk = shared::desk();
    std::fs::rename(desk.path("periodogram"), desk.path("search")).unwrap();
    desk
}

#[test]
fn velocities_are_passed_on_with_their_covariance() {
    let desk = searched();
    let said = desk.succeed(&["export", "search", "--format", "rv"]);
    says(&said, &["written: search/rv/README.txt", "radvel.csv", "rv_likelihood.py"]);
    let readme = desk.read("search/rv/README.txt");
    says(&readme, &["as quoted by such a package", "instead of 1", "km/s  pyaneti", "m/s   kima"]);
    let lines = |name: &str| desk.read(&format!("search/rv/{name}")).lines().map(str::to_owned).collect::<Vec<_>>();
    let profiles = desk.read("search/rv.csv").lines().count() - 1;
    let heads = [("radvel.csv", 1), ("juliet.dat", 0), ("kima.txt", 1), ("pyaneti.dat", 1), ("covariance_m2s2.csv", 0)];
    for (name, head) in heads {
        assert_eq!(lines(name).len(), profiles + head, "{name}");
    }
    let row = desk.read("search/rv.csv").lines().nth(1).unwrap().split(',').map(str::to_owned).collect::<Vec<_>>();
    let [kms, ms] = [("pyaneti.dat", 1), ("juliet.dat", 0)].map(|(name, k)| {
        let line = lines(name)[k].clone();
        line.split(' ').nth(1).unwrap().parse::<f64>().unwrap()
    });
    assert_eq!(kms, row[2].parse::<f64>().unwrap());
    assert!((ms - 1000.0 * kms).abs() < 1e-9 * ms.abs());
    // nothing is replaced without --force, and nothing but an export with it
    says(&desk.refusal(&["export", "search", "--format", "rv"]), &["search/rv", "--force"]);
    desk.succeed(&["export", "search", "--format", "rv", "--force"]);
    let foreign = desk.refusal(&["export", "search", "--format", "rv", "--out", "search", "--force"]);
    says(&foreign, &["search", "no earlier export"]);
    desk.edit("search/covariance.csv", |text| text.lines().skip(1).map(|line| format!("{line}\n")).collect());
    let short = desk.refusal(&["export", "search", "--format", "rv", "--out", "other"]);
    says(&short, &["search/covariance.csv", &format!("{} lines instead of {profiles}", profiles - 1)]);
    says(&desk.refusal(&["export", ".", "--format", "rv"]), &["periodogram.json"]);
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn numpy_reads_the_velocities() {
    let Some(python) = crate::python::python() else { return };
    let desk = searched();
    desk.succeed(&["export", "search", "--format", "rv"]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/velocities.py");
    let output = Command::new(&python).arg(script).arg("search/rv").current_dir(desk.path("")).output().unwrap();
    println!("{}", text(&output.stdout));
    assert!(output.status.success(), "{}", text(&output.stderr));
}
