//! Quoted quantities of an orbit in every relevant result: period in days, times of the largest radial velocity and of
//! inferior conjunction, minimum mass, each with its uncertainty; and the definition of phi.

use crate::desk::{Desk, says, two_spots};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

const NAMES: [&str; 4] = ["period_d", "t_max_rv_d", "t_conjunction_d", "msini_mjup"];

/// Rotation period and epoch (d) of the star.
const PROT: f64 = 3.0;
const EPOCH: f64 = 2_459_000.5;

/// What a summary, a table and a page say of phi.
const PHI: &str = "time from star.epoch_d to the next RV maximum, in orbital cycles";

/// A star of known mass with a planet, its orbit free.
fn config() -> Value {
    let mut config = two_spots(json!({ "ensembles": 2, "walkers": 8, "steps": 40, "seed": 3, "ess": 1e6 }));
    config["star"]["epoch_d"] = json!(EPOCH);
    config["star"]["mass_msun"] = json!(0.9);
    config["parameters"]["porb_over_prot"] = json!({ "prior": "uniform", "min": 0.5, "max": 4.0 });
    config
}

/// M sin i (Jupiter masses) without the planet's own mass, good to a part in a thousand for a planet of one.
fn light_planet(k_kms: f64, period_d: f64, mass_msun: f64) -> f64 {
    // Lovis & Fischer (2010), equation 14: 28.4329 m/s for a Jupiter in a year around a sun
    k_kms * 1e3 / 28.4329 * mass_msun.powf(2.0 / 3.0) * (period_d / 365.25).cbrt()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// Whole periods that two times are apart, and how far off that is.
fn off(difference: f64, period: f64) -> f64 {
    (difference / period - (difference / period).round()) * period
}

/// One run, in all its outputs.
#[test]
fn a_run_gives_what_is_usually_quoted() {
    let desk = Desk::new(config());
    let table = desk.succeed(&["sample", CONFIG, "--out", "run"]);
    for part in [&NAMES[..], &["derived", PHI, "(planet in front)", "2459000.500", "2459001.775"]].concat() {
        assert!(table.contains(part), "{part}:\n{table}");
    }
    let summary = desk.json("run/summary.json");
    assert_eq!(summary["derived_names"], json!(NAMES));
    assert_eq!(summary["names"], json!(["k_kms", "porb_over_prot", "phi"]));
    assert!(summary["definitions"]["phi"].as_str().unwrap().contains(PHI));
    for format in ["csv", "zarr", "emcee", "getdist"] {
        desk.succeed(&["export", "run", "--format", format]);
    }
    // each draw by itself, and the medians of those kept
    let csv = desk.read("run/chain.csv");
    let columns: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let column = |name: &str| columns.iter().position(|one| *one == name).unwrap_or_else(|| panic!("{name}"));
    let middle = EPOCH + 0.5 * 1.66 * PROT;
    let mut kept = NAMES.map(|_| Vec::new());
    for line in csv.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let at = |name: &str| cells[column(name)].parse::<f64>().unwrap();
        let [period, maximum, conjunction, mass] = NAMES.map(at);
        assert!((period - PROT * at("porb_over_prot")).abs() < 1e-12);
        // times of today are doubles good to some 1e-9 d
        assert!(off(maximum - EPOCH - period * at("phi"), period).abs() < 1e-7, "{line}");
        assert!(off(conjunction - maximum - 0.25 * period, period).abs() < 1e-7, "{line}");
        assert!((mass / light_planet(at("k_kms"), period, 0.9) - 1.0).abs() < 3e-3, "{line}");
        if cells[column("warmup")] == "false" {
            kept.iter_mut().zip(NAMES).for_each(|(values, name)| values.push(at(name)));
        }
    }
    let page = desk.succeed(&["report", "run"]) + &desk.read("run/report.html");
    says(&page, &["Derived quantities", PHI]);
    for (name, mut values) in NAMES.into_iter().zip(kept) {
        values.sort_by(f64::total_cmp);
        let one = &summary["derived"][name];
        let median = number(&one["median"]);
        let rank = values.iter().filter(|x| **x < median).count().abs_diff(values.len() / 2);
        assert!(rank <= 1, "{name}: {rank}");
        let within = |key: &str| {
            let [low, high] = [0, 1].map(|end| number(&one[key][end]));
            assert!(low < median && median < high, "{name} {key}");
            values.iter().filter(|x| (low..=high).contains(*x)).count() as f64 / values.len() as f64
        };
        for (key, share) in [("ci68", 0.68), ("ci95", 0.95), ("hdi68", 0.68), ("hdi95", 0.95)] {
            assert!((within(key) - share).abs() < 0.02, "{name} {key}: {}", within(key));
        }
        assert!(number(&one["sd"]) > 0.0 && number(&one["ess"]) > 10.0 && number(&one["rhat"]) < 1.5);
        let node = desk.json(&format!("run/chain.zarr/posterior/{name}/zarr.json"));
        assert_eq!(node["attributes"]["units"], if name == "msini_mjup" { "Mjup" } else { "d" });
        assert!(desk.read("run/chain.paramnames").contains(&format!("{name}*\t")));
        let h5 = std::fs::read(desk.path("run/chain.h5")).unwrap();
        assert!(h5.windows(name.len()).any(|bytes| bytes == name.as_bytes()), "{name}");
    }
    let time = |name: &str| number(&summary["derived"][name]["median"]);
    for name in ["t_max_rv_d", "t_conjunction_d"] {
        assert!((time(name) - middle).abs() < 0.55 * time("period_d"), "{name}");
    }
    // the injected planet, within four standard deviations
    let truth = [1.7 * PROT, EPOCH, EPOCH + 0.25 * 1.7 * PROT, light_planet(0.2, 1.7 * PROT, 0.9)];
    for (name, truth) in NAMES.into_iter().zip(truth) {
        assert!((time(name) - truth).abs() < 4.0 * number(&summary["derived"][name]["sd"]), "{name}");
    }
}

/// The mass does not affect the chain: a run is resumed with one, or another, or none.
#[test]
fn the_mass_of_the_star_may_come_later() {
    let desk = Desk::new(config());
    desk.set("/star/mass_msun", Value::Null);
    let table = desk.succeed(&["sample", CONFIG, "--out", "run"]);
    assert!(!table.contains("msini") && table.contains("t_max_rv_d"), "{table}");
    let chain = desk.read("run/chain.jsonl");
    desk.set("/star/mass_msun", json!(0.5));
    let table = desk.succeed(&["sample", CONFIG, "--out", "run", "--resume"]);
    assert!(table.contains("msini_mjup") && chain == desk.read("run/chain.jsonl"), "{table}");
    assert_eq!(table, desk.succeed(&["analyse", "run"]));
    for (mass, problem) in
        [(json!(0.0), "from 0.01 to 200"), (json!(-1), "from 0.01"), (json!(1e30), "200 solar masses")]
    {
        desk.set("/star/mass_msun", mass);
        says(&desk.refusal(&["sample", CONFIG, "--out", "other"]), &["star.mass_msun", problem]);
    }
}

/// A star of little noise without a planet: K touches zero, and so does the mass.
#[test]
fn where_there_is_no_planet_the_mass_has_a_limit() {
    let mut config = config();
    config["planet"]["k_kms"] = json!(0.0);
    let desk = Desk::new(config);
    let table = desk.succeed(&["sample", CONFIG, "--out", "run"]);
    let summary = desk.json("run/summary.json");
    let limit = number(&summary["derived"]["msini_mjup"]["upper95"]);
    assert!(limit > 0.0 && summary["parameters"]["k_kms"]["upper95"].is_number());
    says(&table, &["msini_mjup is consistent with zero: <"]);
    assert!(summary["derived"]["period_d"].get("upper95").is_none());
}

/// `optimise` and `periodogram` propagate their errors: those of the period are the ratio's, and all agree with each
/// other.
#[test]
fn searches_give_it_with_errors() {
    let desk = Desk::new(config());
    let table = desk.succeed(&["optimise", CONFIG, "--out", "optimum"]);
    says(&table, &["t_max_rv_d", "t_conjunction_d", "msini_mjup", PHI, "2459000.500000"]);
    let optimum = desk.json("optimum/optimum.json");
    let at = |name: &str, key: &str| number(&optimum["derived"][name][key]);
    assert!((at("period_d", "sd") / (PROT * number(&optimum["sd"]["porb_over_prot"])) - 1.0).abs() < 1e-12);
    let parameter = |name: &str| number(&optimum["parameters"][name]);
    let turn = parameter("porb_over_prot") * PROT;
    assert!(off(at("t_max_rv_d", "value") - EPOCH - turn * parameter("phi"), turn).abs() < 1e-7);
    let table = desk.succeed(&["periodogram", CONFIG, "--out", "search", "--draws", "1000", "--eccentric"]);
    says(&table, &["t_max_rv_d", "t_conjunction_d", "msini_mjup", PHI, "its t_conjunction_d"]);
    let search = desk.json("search/periodogram.json");
    let orbits = [&search["best"], &search["keplerian"][0]];
    for orbit in orbits {
        for name in ["t_max_rv_d", "t_conjunction_d", "msini_mjup"] {
            let (value, sigma) = (number(&orbit[name]), number(&orbit[&format!("sigma_{name}")]));
            // searches of one star: the two methods agree within some of their uncertainties
            assert!(sigma > 0.0 && (value - at(name, "value")).abs() < 4.0 * sigma, "{name}: {orbit}");
        }
    }
    assert!(off(number(&search["derived_truth"]["t_conjunction_d"]) - EPOCH - 0.25 * 5.1, 5.1).abs() < 1e-7);
    // K moves the mass by as much as it moves itself, the period by a third of that: within the sum of both
    let best = &search["best"];
    let relative = |sigma: &str, value: &str| number(&best[sigma]) / number(&best[value]);
    let [mass, k, period] = [relative("sigma_msini_mjup", "msini_mjup"), relative("sigma_k_kms", "k_kms"), {
        relative("sigma_period_d", "period_d") / 3.0
    }];
    assert!(mass < 1.01 * (k + period) && mass > 0.99 * (k - period), "{mass} {k} {period}");
    for folder in ["optimum", "search"] {
        desk.succeed(&["report", folder]);
        let page = desk.read(&format!("{folder}/report.html"));
        says(&page, &["<i>M</i> sin <i>i</i>", PHI]);
    }
}
