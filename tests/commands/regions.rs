//! Parameters of the star fitted before maps and searches: active regions, line and vsini; and drifts.

use super::desk::{Desk, program, says, two_spots};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

/// A star with spots whose regions have a different line, or that of the photosphere; to be simulated into `data`.
fn star(regions: &Value) -> Value {
    let mut config = two_spots(json!({ "ensembles": 2, "walkers": 10, "steps": 2, "seed": 3, "ess": 1e6 }));
    config["star"]["regions"] = regions.clone();
    config["star"]["vsini_kms"] = json!(25.0);
    let simulate = &mut config["observations"]["simulate"];
    simulate["cycles"] = (0..24).map(|k| 0.083 * f64::from(k)).collect();
    simulate["velocity_kms"] = json!({ "min": -42.0, "max": 42.0, "step": 2.0 });
    config["planet"]["k_kms"] = json!(0.0);
    config["imaging"] = json!({ "pixels": 400, "objective": "marginal-likelihood" });
    config
}

/// Simulates it, and leaves its regions to the profiles.
fn observed(regions: &Value) -> (Desk, Value) {
    let mut config = star(regions);
    let desk = Desk::new(config.clone());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    config["observations"] = json!({ "path": "data/observations.txt", "velocity_jitter_kms": 0.0 });
    config["star"].as_object_mut().unwrap().remove("regions");
    (desk, config)
}

/// Tells the config what its spots are: where these are not tested, to fit them takes most of the time.
fn with_known_spots(config: &mut Value, keys: &[&str]) {
    let known = json!({ "spot_amplitude": 0.3, "spot_slope": 1.3, "spot_lifetime_d": 3000 });
    keys.iter().for_each(|key| config["imaging"][key] = known[key].clone());
}

#[test]
fn regions_are_found_where_they_are_and_nowhere_else() {
    let regions = json!({ "line_width": 1.5, "equivalent_width": 1.1, "shift_kms": 0.5, "area": 2.0,
                          "area_limb": 0.0, "dimming_limb": -0.4 });
    let plain = json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 });
    let [found, none] = [&regions, &plain].map(|regions| {
        let (desk, config) = observed(regions);
        desk.write(CONFIG, &config.to_string());
        let said = desk.succeed(&["map", CONFIG, "--out", "map"]);
        says(&said, &["\nstar  ", "line"]);
        desk.json("map/fit.json")["measured"]["star"].clone()
    });
    assert_eq!(none["numbers"], json!([]), "{none}");
    assert!(found["gain"].as_f64().unwrap() > 50.0, "{found}");
    for number in found["numbers"].as_array().unwrap() {
        let name = number["name"].as_str().unwrap();
        let truth = regions[name.trim_start_matches("region_")].as_f64().unwrap();
        let [value, sigma] = ["value", "sigma"].map(|key| number[key].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * sigma, "{name}: {value} +- {sigma}, not {truth}");
    }
}

/// A second command uses the fit of the first, with identical bytes; damaged fits and those of other profiles are
/// repeated, and nothing is stored where this is disabled.
#[test]
fn what_is_fitted_is_kept_for_the_next_command() {
    let (desk, mut config) = observed(&json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 }));
    with_known_spots(&mut config, &["spot_lifetime_d"]);
    desk.write(CONFIG, &config.to_string());
    let map = |cache: &str, out: &str| {
        let mut command = program();
        command.args(["map", CONFIG, "--out", out, "--force"]).current_dir(desk.path("")).env("DIMCMC_CACHE", cache);
        assert!(command.output().unwrap().status.success());
        desk.read(&format!("{out}/fit.json"))
    };
    let kept = || std::fs::read_dir(desk.path("cache")).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    let by_itself = map("off", "map");
    assert!(!desk.path("cache").exists());
    assert_eq!(map("cache", "first"), by_itself);
    let [file] = &kept()[..] else { panic!("{:?}", kept()) };
    assert_eq!(map("cache", "second"), by_itself);
    // another gain is reported as stored
    let whole = std::fs::read_to_string(file).unwrap();
    let mut measured: Value = serde_json::from_str(&whole).unwrap();
    measured["star"]["gain"] = json!(3.25);
    std::fs::write(file, measured.to_string()).unwrap();
    map("cache", "second");
    assert_eq!(desk.json("second/fit.json")["measured"]["star"]["gain"], 3.25);
    // sampler and planet do not count
    let mut other = config.clone();
    other["sampler"]["seed"] = json!(99);
    other["planet"] = json!({ "k_kms": 0.3, "porb_over_prot": 2.2, "phi": 0.1 });
    other["parameters"]["k_kms"] = json!({ "prior": "uniform", "min": 0.0, "max": 0.7 });
    desk.write(CONFIG, &other.to_string());
    map("cache", "second");
    assert_eq!(desk.json("second/fit.json")["measured"]["star"]["gain"], 3.25);
    desk.write(CONFIG, &config.to_string());
    std::fs::write(file, &whole[..whole.len() / 2]).unwrap();
    assert_eq!(map("cache", "second"), by_itself);
    assert_eq!(std::fs::read_to_string(file).unwrap(), whole);
    let list = desk.read("data/observations.txt");
    desk.write("data/observations.txt", list.lines().skip(4).collect::<Vec<_>>().join("\n").as_str());
    map("cache", "fewer");
    assert_eq!(kept().len(), 2);
}

/// Wrong line and vsini of a config are corrected, and a resumed chain uses them like an uninterrupted one.
#[test]
fn a_star_that_is_fitted_is_that_of_a_chain_that_goes_on() {
    let (desk, mut config) = observed(&json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 }));
    config["star"]["regions"] = json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 });
    config["star"]["vsini_kms"] = json!(25.6);
    config["star"]["fitted"] = json!(["line_sigma_kms", "vsini_kms"]);
    with_known_spots(&mut config, &["spot_amplitude", "spot_slope", "spot_lifetime_d"]);
    config["parameters"] = json!({ "k_kms": { "prior": "uniform", "min": 0.0, "max": 1.0 },
                                   "phi": { "prior": "periodic" } });
    desk.write(CONFIG, &config.to_string());
    desk.succeed(&["sample", CONFIG, "--out", "whole"]);
    let star = desk.json("whole/manifest.json")["measured"]["star"].clone();
    let vsini = star["numbers"].as_array().unwrap().iter().find(|number| number["name"] == "vsini_kms").unwrap();
    let [value, sigma] = ["value", "sigma"].map(|key| vsini[key].as_f64().unwrap());
    assert!((value - 25.0).abs() < 4.0 * sigma && sigma < 0.3, "{star}");
    config["sampler"]["steps"] = json!(1);
    desk.write(CONFIG, &config.to_string());
    desk.succeed(&["sample", CONFIG, "--out", "run"]);
    config["sampler"]["steps"] = json!(2);
    desk.write(CONFIG, &config.to_string());
    desk.succeed(&["sample", CONFIG, "--out", "run", "--resume"]);
    assert_eq!(desk.read("run/chain.jsonl"), desk.read("whole/chain.jsonl"));
}

#[test]
fn keys_that_make_no_sense_are_refused() {
    let sampled = || two_spots(json!({ "ensembles": 2, "walkers": 10, "steps": 2, "seed": 3, "ess": 1e6 }));
    let refused = |key: &str, value: Value, objective: &str, expected: &[&str]| {
        let mut config = sampled();
        config["star"][key] = value;
        config["imaging"] = json!({ "pixels": 200, "objective": objective });
        says(&Desk::new(config).refusal(&["map", CONFIG, "--out", "map"]), expected);
    };
    let evolving = "marginal-likelihood";
    refused("regions", json!({ "line_width": 3 }), evolving, &["star.regions.line_width: 3 must be from 0.5 to 2"]);
    refused("fitted", json!(["period"]), evolving, &["star.fitted: \"period\" is none of \"line_sigma_kms\""]);
    refused("fitted", json!(["vsini_kms", "vsini_kms"]), evolving, &["star.fitted: \"vsini_kms\" is there twice"]);
    refused("velocity_drift", json!("linear"), "spottedness", &["star.velocity_drift: no effect but with"]);
    let refused = |events: Value, objective: &str, expected: &str| {
        let mut config = sampled();
        config["observations"]["events"] = events;
        config["imaging"] = json!({ "pixels": 200, "objective": objective });
        says(&Desk::new(config).refusal(&["map", CONFIG, "--out", "map"]), &[expected]);
    };
    refused(json!("some"), evolving, "observations.events: must be \"fitted\", \"none\", or windows of time");
    refused(json!({ "include": [[3, 2]] }), evolving, "observations.events.include[0]: the start 3 must be before");
    refused(json!("fitted"), "spottedness", "observations.events: no effect but with imaging.objective");
}

/// A drift is reported with its uncertainty, and is not a planet at the edge of the search.
#[test]
fn a_drift_is_told_with_its_error() {
    let (desk, mut config) = observed(&json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 }));
    config["star"]["regions"] = json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 });
    config["sampler"]["walkers"] = json!(12);
    config["parameters"]["vsys_kms"] = json!({ "prior": "uniform", "min": -1, "max": 1 });
    desk.write(CONFIG, &config.to_string());
    // 20 m/s per day, as the list of profiles subtracts it
    let list = desk.read("data/observations.txt");
    let drifted = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
        [file, time] if !line.starts_with('#') => {
            format!("{file} {time} {:.6}\n", -0.02 * time.parse::<f64>().unwrap())
        }
        _ => format!("{line}\n"),
    };
    desk.write("data/observations.txt", &list.lines().map(drifted).collect::<String>());
    let said = desk.succeed(&["periodogram", CONFIG, "--out", "search", "--draws", "1000"]);
    says(&said, &["No significant signal", "RV drift: ", "m/s/d (", "a long-period companion or instrumental drift"]);
    let drift = desk.json("search/periodogram.json")["drift"].clone();
    let [slope, sigma] = ["kms_d", "sigma_kms_d"].map(|key| drift[key].as_f64().unwrap());
    assert!((slope - 0.02).abs() < 3.0 * sigma && sigma < 0.005, "{drift}");
}

/// Two profiles with a weaker line and a bump are found and named, all others keep their uncertainties, and a list by
/// hand takes precedence.
#[test]
fn flares_are_found_and_no_others() {
    let (desk, mut config) = observed(&json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 }));
    config["star"]["regions"] = json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 });
    with_known_spots(&mut config, &["spot_lifetime_d"]);
    let list = desk.read("data/observations.txt");
    let files: Vec<(String, f64)> = (list.lines().filter(|line| !line.starts_with('#')))
        .map(|line| {
            let mut words = line.split_whitespace();
            (words.next().unwrap().to_owned(), words.next().unwrap().parse().unwrap())
        })
        .collect();
    for k in [6, 15] {
        let path = format!("data/{}", files[k].0);
        desk.write(&path, &with_flare(&desk.read(&path)));
    }
    let mut found = |events: Value| {
        config["observations"]["events"] = events;
        desk.write(CONFIG, &config.to_string());
        let said = desk.succeed(&["map", CONFIG, "--out", "map", "--force"]);
        let measured = desk.json("map/fit.json")["measured"].clone();
        let named = measured["events"]["profiles"].as_array().cloned().unwrap_or_default();
        assert_eq!(said.contains("outliers"), !named.is_empty(), "{said}");
        named.iter().map(|event| event["profile"].as_u64().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(found(json!("fitted")), [7, 16]);
    assert!(found(json!("none")).is_empty());
    let at = |k: usize| json!([[files[k].1 - 1e-3, files[k].1 + 1e-3]]);
    // one that is none for the user spoils the prediction of its neighbours
    let by_hand = found(json!({ "exclude": at(6), "include": at(2) }));
    assert!(by_hand.contains(&3) && by_hand.contains(&16) && !by_hand.contains(&7), "{by_hand:?}");
}

/// A table of velocity, intensity and error with a line that is 6 % weaker and a bump.
fn with_flare(profile: &str) -> String {
    let changed = |line: &str| {
        let numbers: Option<Vec<f64>> = line.split_whitespace().map(|word| word.parse().ok()).collect();
        match numbers.filter(|numbers| numbers.len() >= 3) {
            Some(mut numbers) => {
                numbers[1] = 1.0 - 0.94 * (1.0 - numbers[1]) + 0.01 * (-0.5 * ((numbers[0] - 9.0) / 4.0).powi(2)).exp();
                numbers.iter().map(|x| format!("{x:.7}")).collect::<Vec<_>>().join(" ")
            }
            None => line.to_owned(),
        }
    };
    profile.lines().map(changed).collect::<Vec<_>>().join("\n") + "\n"
}
