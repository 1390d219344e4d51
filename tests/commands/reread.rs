//! Files that are read again after somebody has edited or cut them: each is checked as a whole, and refused by key or
//! line. And observations that are given twice, or hold a number that would outweigh all others.

use crate::desk::{Desk, dimcmc, says, text, tiny, with_line};
use crate::shared;
use serde_json::{Value, json};

/// `value` with the element at `pointer` replaced.
fn with(value: &Value, pointer: &str, new: Value) -> Value {
    let mut value = value.clone();
    *value.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = new;
    value
}

#[test]
fn results_that_were_edited_are_refused_by_key() {
    let desk = shared::desk();
    desk.succeed(&[
        "inject",
        "config.json",
        "--k-kms",
        "0.2",
        "--porb-over-prot",
        "2.6",
        "--phi",
        "0.2",
        "--out",
        "inj",
    ]);
    let cases = [
        ("optimise/optimum.json", "/parameters", json!({ "k_kms": 0.2 }), "parameters: missing"),
        ("optimise/optimum.json", "/covariance", json!([[1.0]]), "covariance: 1 entries instead of"),
        ("optimise/optimum.json", "/log_prob", json!(1e300), "log_prob: 1e300 is out of range"),
        ("map/map.json", "/ring_pixels", json!([1, 2]), "ring_pixels: 3 entries instead of"),
        ("map/map.json", "/maps/0/spot_filling", json!([0.1]), "maps: 1 entries instead of"),
        ("map/map.json", "/rotation_period_d", json!(0), "rotation_period_d: 0 must be above 0"),
        ("periodogram/periodogram.json", "/best/period_d", json!(-2), "best.period_d: -2 must be above 0"),
        ("periodogram/periodogram.json", "/search/max_period_d", json!(1e-3), "search.max_period_d"),
        ("compare/comparison.json", "/parameters", json!({}), "parameters: missing"),
        ("inj/truth.json", "/velocity_kms", json!([]), "velocity_kms: 0 entries instead of"),
        ("sample/manifest.json", "/priors/k_kms", json!({}), "priors.k_kms: is missing, or no prior"),
    ];
    for (file, pointer, new, part) in cases {
        let good = desk.read(file);
        desk.write(file, &with(&desk.json(file), pointer, new).to_string());
        let folder = file.split('/').next().unwrap();
        says(&desk.refusal(&["report", folder, "--out", "page.html"]), &[file, part]);
        desk.write(file, &good);
    }
}

#[test]
fn a_plan_whose_best_is_none_of_its_schedules_is_refused() {
    let desk = Desk::new(tiny(2));
    let mut config = tiny(2);
    config["imaging"] = json!({ "objective": "marginal-likelihood", "pixels": 100, "spot_lifetime_d": 20.0 });
    config["sampler"]["walkers"] = json!(16);
    desk.write("plan.json", &config.to_string());
    desk.succeed(&["plan", "plan.json", "--nights", "3,5", "--maps", "0", "--draws", "1000", "--out", "plan"]);
    let plan = desk.json("plan/plan.json");
    for (pointer, new, part) in [
        ("/best", json!(99), "best: 99 must be from 1 to 2"),
        ("/best", json!(0), "best: 0 must be from 1 to 2"),
        ("/schedules", json!([]), "schedules: empty"),
        ("/range_d", json!([5.0, 1.0]), "range_d"),
    ] {
        desk.write("plan/plan.json", &with(&plan, pointer, new).to_string());
        for command in [&["report", "plan", "--out", "page.html"][..], &["plot", "plan", "--out", "figures"]] {
            says(&desk.refusal(command), &["plan/plan.json: ", part]);
        }
    }
    let many: Vec<f64> = (0..1001).map(|k| 0.01 * f64::from(k)).collect();
    config["observations"]["simulate"]["cycles"] = json!(many);
    desk.write("plan.json", &config.to_string());
    says(&desk.refusal(&["plan", "plan.json", "--out", "many"]), &["1001 profiles", "1000 are the most", "--nights"]);
}

#[test]
fn a_chain_outside_its_priors_or_cut_is_refused_by_line() {
    let desk = shared::desk();
    let chain = desk.read("sample/chain.jsonl");
    let mut draw: Value = serde_json::from_str(chain.lines().nth(20).unwrap()).unwrap();
    draw["k_kms"] = json!(-1e9);
    desk.write("sample/chain.jsonl", &with_line(&chain, 21, &draw.to_string()));
    let part = ["sample/chain.jsonl, line 21: k_kms -1000000000 is outside its prior (0 to 1)"];
    for command in [
        &["analyse", "sample"][..],
        &["export", "sample", "--format", "csv", "--out", "x.csv"],
        &["plot", "sample", "--out", "x"],
        &["report", "sample", "--out", "x.html"],
        &["merge", "sample", "seed_4", "--out", "x"],
        &["sample", "config.json", "--out", "sample", "--resume"],
    ] {
        says(&desk.refusal(command), &part);
    }
    // shorter than it was
    let half: String = chain.lines().take(chain.lines().count() / 2).map(|line| format!("{line}\n")).collect();
    desk.write("sample/chain.jsonl", &half);
    says(&desk.refusal(&["analyse", "sample"]), &["sample/chain.jsonl", "the end is missing", "summary.json"]);
    desk.write("sample/chain.jsonl", &chain);
    // a merged run has no last step that was under way
    desk.succeed(&["merge", "sample", "seed_4", "--out", "merged"]);
    std::fs::remove_file(desk.path("merged/summary.json")).unwrap();
    desk.edit("merged/chain.jsonl", |text| text.lines().take(150).map(|line| format!("{line}\n")).collect());
    for command in [&["analyse", "merged"][..], &["export", "merged", "--format", "csv"]] {
        says(&desk.refusal(command), &["merged/chain.jsonl", "ends within a step", "merge the runs again"]);
    }
}

#[test]
fn a_covariance_that_is_none_is_refused_by_line() {
    let desk = shared::desk();
    let good = desk.read("periodogram/covariance.csv");
    let changed = |line: usize, column: usize, to: &dyn Fn(f64) -> f64| {
        let row = good.lines().nth(line - 1).unwrap();
        let mut cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        cells[column] = to(cells[column]);
        with_line(&good, line, &cells.iter().map(f64::to_string).collect::<Vec<_>>().join(","))
    };
    let both = |to: f64| {
        let mut rows: Vec<Vec<f64>> =
            good.lines().map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
        let scale = (rows[0][0] * rows[1][1]).sqrt();
        (rows[0][1], rows[1][0]) = (to * scale, to * scale);
        let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
        rows.iter().map(line).collect::<String>()
    };
    for (text, part) in [
        (changed(1, 0, &|_| -0.005), "covariance.csv:1: the variance of velocity 1 is -5e-3"),
        (changed(3, 0, &|x| x + 1.0), "covariance.csv:3: number 1 differs from number 3 of line 1"),
        (both(1.5), "no covariance: a direction has a variance below 0"),
    ] {
        desk.write("periodogram/covariance.csv", &text);
        says(&desk.refusal(&["export", "periodogram", "--format", "rv"]), &[part]);
    }
    desk.write("periodogram/covariance.csv", &good);
    desk.succeed(&["export", "periodogram", "--format", "rv"]);
}

/// Two data sets and a light curve, simulated into `data`, and the config that reads them.
fn campaign() -> (Desk, Value) {
    let cycles = |first: f64, n: usize| (0..n).map(|k| first + 0.37 * k as f64).collect::<Vec<f64>>();
    let grid = json!({ "min": -33.0, "max": 33.0, "step": 3.0 });
    let mut config = json!({
        "star": { "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 22.0, "photosphere_k": 4500,
                  "spot_k": 3400, "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "planet": { "k_kms": 0.15, "porb_over_prot": 1.7, "phi": 0.3 },
        "imaging": { "pixels": 100, "objective": "marginal-likelihood", "spot_amplitude": 0.2, "spot_slope": 0.9,
                     "spot_lifetime_d": 15 },
        "observations": [
            { "name": "blue", "simulate": { "random_spots": { "number": 8, "seed": 4 }, "cycles": cycles(0.0, 6),
                                            "velocity_kms": grid, "pixels": 500 } },
            { "name": "red", "simulate": { "cycles": cycles(0.2, 5), "velocity_kms": grid, "seed": 2,
                                           "pixels": 500 } }
        ],
        "photometry": { "name": "tess", "wavelength_nm": 790, "simulate": { "cadence_d": 0.2, "sigma": 1e-3 } }
    });
    let desk = Desk::new(config.clone());
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    for set in config["observations"].as_array_mut().unwrap() {
        *set =
            json!({ "name": set["name"], "path": format!("data/{}/observations.txt", set["name"].as_str().unwrap()) });
    }
    config["photometry"] = json!({ "name": "tess", "wavelength_nm": 790, "path": "data/tess.csv" });
    desk.write("star.json", &config.to_string());
    (desk, config)
}

#[test]
fn what_is_given_twice_is_told() {
    let (desk, config) = campaign();
    let refused = |config: Value, parts: &[&str]| {
        desk.write("twice.json", &config.to_string());
        says(&desk.refusal(&["map", "twice.json", "--out", "x"]), parts);
    };
    let twice = with(&config, "/observations/1/path", json!("data/blue/observations.txt"));
    refused(twice, &["twice.json: observations[1]: p000.prof", "as well: give each profile once", "(blue)"]);
    let mut curves = config.clone();
    curves["photometry"] = json!([
        { "name": "tess", "wavelength_nm": 790, "path": "data/tess.csv" },
        { "name": "again", "wavelength_nm": 600, "path": "data/tess.csv" }
    ]);
    refused(curves, &["twice.json: photometry[1]", "are those of photometry[0] (tess): give each once"]);
    // rows of a table: the copies are left out
    let map = |out: &str| desk.succeed(&["map", "star.json", "--out", out]);
    map("once");
    desk.edit("data/tess.csv", |table| {
        let rows = table.lines().skip(1).flat_map(|row| [row, "\n", row, "\n"]).collect::<String>();
        format!("time,flux,sigma\n{rows}")
    });
    says(&map("twice"), &["rows left out, copies of others, line 3 the first"]);
    assert_eq!(desk.read("once/lightcurve.csv"), desk.read("twice/lightcurve.csv"));
}

#[test]
fn one_bad_number_is_named_by_file_and_row() {
    let (desk, _) = campaign();
    let table = desk.read("data/tess.csv");
    let row = table.lines().nth(4).unwrap().rsplit_once(',').unwrap().0.to_owned();
    desk.write("data/tess.csv", &with_line(&table, 5, &format!("{row},1e-9")));
    says(
        &desk.refusal(&["map", "star.json", "--out", "x"]),
        &["data/tess.csv:5: sigma: \"1e-9\"", "outweigh", "Correct it"],
    );
    desk.write("data/tess.csv", &table);
    let profile = desk.read("data/red/p002.prof");
    let row: Vec<&str> = profile.lines().nth(12).unwrap().split_whitespace().collect();
    desk.write("data/red/p002.prof", &with_line(&profile, 13, &format!("{} {} 1e-8", row[0], row[1])));
    says(&desk.refusal(&["map", "star.json", "--out", "x"]), &["data/red/p002.prof:13: sigma 1e-8", "outweigh"]);
    // whether it fits or not, the bin is named
    desk.write("data/red/p002.prof", &with_line(&profile, 13, &format!("{} 0.3 {}", row[0], row[2])));
    for command in ["map", "periodogram"] {
        let output = dimcmc(&[command, "star.json", "--out", command], &desk.path(""));
        let said = text(&output.stdout) + &text(&output.stderr);
        says(&said, &["p002.prof", &format!("the bin at {:.2} km/s", row[0].parse::<f64>().unwrap()), "cosmic ray"]);
        assert!(!said.contains("zero_point_kms"), "{said}");
    }
}

#[test]
fn a_data_set_may_be_one_profile_however_it_comes_about() {
    let (desk, config) = campaign();
    desk.edit("data/red/observations.txt", |list| list.lines().take(2).map(|line| format!("{line}\n")).collect());
    says(&desk.succeed(&["map", "star.json", "--out", "listed"]), &["red: 1 profiles"]);
    // one profile is not enough for a star
    let single = json!({ "path": "data/red/observations.txt" });
    desk.write("star.json", &with(&config, "/observations", single).to_string());
    says(&desk.refusal(&["map", "star.json", "--out", "x"]), &["the only profile of the list"]);
}

#[test]
fn names_of_sets_are_no_files() {
    let (desk, config) = campaign();
    for name in ["config.json", "truth.JSON", "p000.prof", "observations.txt"] {
        desk.write("named.json", &with(&config, "/observations/1/name", json!(name)).to_string());
        let inject = ["inject", "named.json", "--k-kms", "0.2", "--porb-over-prot", "2", "--phi", "0.1", "--out", "x"];
        says(&desk.refusal(&inject), &["named.json: observations[1].name", "ends like a file"]);
    }
}
