//! Several data sets in one config: two spectrographs in two seasons, a transit left out.

use super::desk::{Desk, dimcmc, says, text};
use super::svg::texts;
use dimcmc::Scene;
use dimcmc::internals::star::observation::Profile;
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

/// A star seen by two spectrographs, simulated.
fn two_sets() -> Value {
    let cycles = |first: f64| (0..7).map(|k| first + 0.37 * f64::from(k)).collect::<Vec<f64>>();
    json!({
        "star": { "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 22.0, "contrast": 0.3,
                  "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "planet": { "k_kms": 0.15, "porb_over_prot": 1.7, "phi": 0.3 },
        "imaging": { "pixels": 200, "objective": "marginal-likelihood", "spot_amplitude": 0.2, "spot_slope": 0.9 },
        "parameters": { "k_kms": { "prior": "uniform", "min": 0, "max": 1 }, "phi": { "prior": "periodic" } },
        "sampler": { "ensembles": 2, "walkers": 10, "steps": 2, "ess": 1e6 },
        "observations": [
            { "name": "blue", "resolving_power": 50000,
              "simulate": { "random_spots": { "number": 8, "lifetime_d": 20, "seed": 4 }, "cycles": cycles(0.0),
                            "velocity_kms": { "min": -33.0, "max": 33.0, "step": 3.0 }, "pixels": 1000 } },
            { "name": "red", "resolving_power": 90000, "contrast": 0.4, "zero_point_kms": "fitted",
              "simulate": { "cycles": cycles(83.2), "velocity_kms": { "min": -32.0, "max": 32.0, "step": 2.0 },
                            "seed": 2, "zero_point_kms": 0.3, "pixels": 1000 } }
        ]
    })
}

/// The same read from the files that `simulate` has written to `data`.
fn from_files(config: &Value) -> Value {
    let mut config = config.clone();
    for set in config["observations"].as_array_mut().unwrap() {
        let path = format!("data/{}/observations.txt", set["name"].as_str().unwrap());
        let set = set.as_object_mut().unwrap();
        set.remove("simulate");
        set.insert("path".into(), json!(path));
    }
    config
}

#[test]
fn two_spectrographs_from_files_to_a_chain() {
    let desk = Desk::new(two_sets());
    says(&desk.succeed(&["simulate", CONFIG, "--out", "data"]), &["data set", "blue", "red"]);
    assert_eq!(desk.json("data/red/truth.json")["zero_point_kms"], 0.3);
    let mut config = from_files(&two_sets());
    // times are 3 d a cycle: the profile at cycle 0.37 lies in a transit
    config["observations"][0]["exclude"] = json!([[1.0, 1.2]]);
    desk.write("star.json", &config.to_string());
    let said = desk.succeed(&["map", "star.json", "--out", "map"]);
    says(&said, &["blue: 1 of 7 left out", "red: 7 profiles, RV offset"]);
    let map = desk.json("map/map.json");
    let sets = map["data_sets"].as_array().unwrap();
    assert_eq!((sets[0]["name"].as_str(), sets[0]["profiles"].as_u64()), (Some("blue"), Some(6)));
    let held = &sets[1]["zero_point"];
    let (value, sigma) = (held["value_kms"].as_f64().unwrap(), held["sigma_kms"].as_f64().unwrap());
    assert!((value - 0.3).abs() < 3.0 * sigma && sigma < 0.2, "{value} +- {sigma}");
    let rv = desk.read("map/rv.csv");
    assert!(rv.starts_with("time_d") && rv.lines().next().unwrap().ends_with(",data_set"));
    assert_eq!(rv.lines().skip(1).filter(|line| line.ends_with(",2")).count(), 7);
    desk.succeed(&["plot", "map"]);
    let sampled = dimcmc(&["sample", "star.json", "--out", "run"], &desk.path(""));
    assert_eq!(sampled.status.code(), Some(0), "{}", text(&sampled.stderr));
    says(&text(&sampled.stderr), &["blue: 1 of 7 left out"]);
    desk.succeed(&["report", "run"]);
    says(&desk.read("run/report.html"), &["blue: 6 profiles", "red: 7 profiles"]);
}

/// The systemic velocity free and fixed: its uncertainty enters that of the offset, but not that of single velocities.
#[test]
fn what_profiles_have_in_common_is_told_apart() {
    const PRIOR_SD_KMS: f64 = 0.577;
    let mut simulated = two_sets();
    simulated["planet"]["k_kms"] = json!(0.4);
    for set in simulated["observations"].as_array_mut().unwrap() {
        set["simulate"]["snr"] = json!(1000);
    }
    let desk = Desk::new(simulated.clone());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let config = from_files(&simulated);
    let vsys = json!({ "prior": "uniform", "min": -0.9, "max": 1.1 });
    let config_with = |keys: &[(&str, &str, Value)]| {
        let mut config = config.clone();
        keys.iter().for_each(|(section, key, value)| config[*section][*key] = value.clone());
        config.to_string()
    };
    let still = ("star", "velocity_drift", json!("none"));
    desk.write("held.json", &config_with(std::slice::from_ref(&still)));
    desk.write("still.json", &config_with(&[still, ("parameters", "vsys_kms", vsys.clone())]));
    desk.write("free.json", &config_with(&[("parameters", "vsys_kms", vsys)]));
    let search = |name: &str| {
        let table = desk.succeed(&["periodogram", &format!("{name}.json"), "--out", name]);
        (table, desk.json(&format!("{name}/periodogram.json")))
    };
    let [(_, held), (_, still), (table, free)] = [search("held"), search("still"), search("free")];
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value}"));
    let velocity = |of: &Value| [number(&of["value_kms"]), number(&of["sigma_kms"])];
    let offset = |found: &Value| velocity(&found["measured"]["sets"][1]["zero_point"]);
    let [[_, sigma_held], [_, sigma_still], [value, sigma]] = [offset(&held), offset(&still), offset(&free)];
    assert!((value - 0.3).abs() < 2.0 * sigma && sigma < 0.2, "{value} +- {sigma}");
    assert!(sigma_still > 1.2 * sigma_held, "{sigma_still} {sigma_held}");
    assert!(sigma > 0.95 * sigma_still, "{sigma} {sigma_still}");
    says(&table, &[&format!("RV offset {value:.3} ± {sigma:.3} km/s"), "systemic velocity: "]);
    assert_eq!(held.get("systemic_velocity"), None);
    let [vsys, sigma_vsys] = velocity(&free["systemic_velocity"]);
    assert!(vsys.abs() < 3.0 * sigma_vsys && sigma_vsys < 0.3 * PRIOR_SD_KMS, "{vsys} +- {sigma_vsys}");
    // velocities and their covariance are enough for the orbit, and no uncertainty is that of the systemic velocity
    let rows = |file: &str, head: usize| -> Vec<Vec<f64>> {
        let text = desk.read(file);
        text.lines().skip(head).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect()
    };
    let (rv, covariance) = (rows("free/rv.csv", 1), rows("free/covariance.csv", 0).concat());
    let n = rv.len();
    assert!(rv.iter().all(|row| row[3] < 0.5 * PRIOR_SD_KMS), "{rv:?}");
    let factor = DMatrix::from_row_slice(n, n, &covariance).cholesky().unwrap();
    let angle = |k: usize| std::f64::consts::TAU * rv[k][0] / number(&free["best"]["period_d"]);
    let x = DMatrix::from_fn(n, 2, |k, c| if c == 0 { angle(k).cos() } else { angle(k).sin() });
    let kms = DVector::from_fn(n, |k, _| rv[k][2]);
    let ab = x.tr_mul(&factor.solve(&x)).cholesky().unwrap().solve(&x.tr_mul(&factor.solve(&kms)));
    assert!((ab.norm() / number(&free["best"]["k_kms"]) - 1.0).abs() < 0.01, "{} {}", ab.norm(), free["best"]);
    desk.succeed(&["plot", "free"]);
    let figure = desk.read("free/figures/rv.svg");
    // two digits of its uncertainty
    let digits = (1.0 - number(&free["best"]["sigma_period_d"]).log10().floor()) as usize;
    let period = format!("{:.digits$} d = ", number(&free["best"]["period_d"]));
    assert!(
        figure.contains(&period) && texts(&figure).iter().any(|text| text.starts_with("residual (")),
        "{period}: {:?}",
        texts(&figure)
    );
    desk.succeed(&["export", "free", "--format", "rv"]);
    says(&desk.read("free/rv/README.txt"), &["leave a constant velocity free", &format!("{vsys:.4} ± ")]);
    assert_eq!(desk.read("free/rv/radvel.csv").lines().filter(|line| line.ends_with(",red")).count(), 7);
}

#[test]
fn an_orbit_is_put_into_all_sets() {
    let desk = Desk::new(two_sets());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let mut config = from_files(&two_sets());
    config["observations"][0]["exclude"] = json!([[1.0, 1.2]]);
    desk.write("star.json", &config.to_string());
    let orbit = ["--k-kms", "0.7", "--porb-over-prot", "1.7", "--phi", "0.3"];
    let said = desk.succeed(&[&["inject", "star.json", "--out", "injected"][..], &orbit].concat());
    says(&said, &["13, shifted by up to 0.6"]);
    // its start is not the injected orbit, and the keys of the sets are kept
    let written = desk.json("injected/config.json");
    assert_eq!(written["planet"]["k_kms"], 0.15);
    assert_eq!(written["observations"][1]["zero_point_kms"], "fitted");
    assert_eq!(written["observations"][1]["path"], "red/observations.txt");
    // first moments have the noise of each profile, and the loss at the ends of its window
    let (before, after) = (mean_velocities(&desk, "star.json"), mean_velocities(&desk, "injected/config.json"));
    let of_set =
        |name: &str| desk.json(&format!("injected/{name}/truth.json"))["velocity_kms"].as_array().unwrap().clone();
    let velocities = [of_set("blue"), of_set("red")].concat();
    for (k, (before, after)) in before.iter().zip(&after).enumerate() {
        let velocity = velocities[k].as_f64().unwrap();
        assert!((after - before - velocity).abs() < 0.1, "{k}: {before} {after} {velocity}");
    }
    let over_itself = [&["inject", "star.json", "--force", "--out", "data"][..], &orbit].concat();
    says(&desk.refusal(&over_itself), &["data"]);
    desk.succeed(&["plot", "injected/red"]);
}

/// Two spectrographs in two seasons, with static spots in each.
fn unchanging() -> Value {
    let mut config = two_sets();
    config["imaging"] = json!({ "pixels": 200, "chi2_target": 1.05, "objective": "spottedness" });
    config["observations"][1]["zero_point_kms"] = json!(0.3);
    config
}

#[test]
fn a_star_that_does_not_change_has_a_map_a_season() {
    let desk = Desk::new(unchanging());
    let said = desk.succeed(&["map", CONFIG, "--out", "map"]);
    says(&said, &["0.000 to 6.660 d: 7 profiles, own map", "249.600 to 256.260 d: 7 profiles"]);
    let map = desk.json("map/map.json");
    let seasons = map["maps"].as_array().unwrap();
    assert_eq!(seasons.len(), 2);
    // on top their mean
    let number = |of: &Value, key: &str| of[key].as_f64().unwrap();
    for key in ["spottedness", "true_spottedness"] {
        let mean = 0.5 * (number(&seasons[0], key) + number(&seasons[1], key));
        assert!((number(&map, key) - mean).abs() < 1e-12, "{key}");
    }
    let pixel = |of: &Value| of["spot_filling"][17].as_f64().unwrap();
    assert!((pixel(&map) - 0.5 * (pixel(&seasons[0]) + pixel(&seasons[1]))).abs() < 1e-12);
    assert_ne!(seasons[0]["true_spot_filling"], seasons[1]["true_spot_filling"]);
    for file in ["map/rv.csv", "map/profiles.csv"] {
        let table = desk.read(file);
        assert!(table.lines().next().unwrap().ends_with(",season,data_set"), "{file}");
        assert!(table.lines().skip(1).all(|line| line.ends_with(",1,1") || line.ends_with(",2,2")), "{file}");
    }
    says(&desk.succeed(&["plot", "map"]), &["map_1.svg", "map_2.svg"]);
    // one of them in two
    desk.set("/imaging/seasons", json!([[-1, 3], [3.1, 100], [200, 300]]));
    desk.succeed(&["map", CONFIG, "--out", "three"]);
    assert_eq!(desk.json("three/fit.json")["measured"]["seasons"].as_array().unwrap().len(), 3);
}

#[test]
fn sets_that_count_other_days_are_refused() {
    let desk = Desk::new(two_sets());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    desk.write("star.json", &from_files(&two_sets()).to_string());
    let list = desk.read("data/red/observations.txt");
    let in_jd = |line: &str| match line.rsplit_once(' ') {
        Some((file, time)) if !line.starts_with('#') => {
            format!("{file} {}", time.parse::<f64>().unwrap() + 2_459_000.0)
        }
        _ => line.to_owned(),
    };
    desk.write("data/red/observations.txt", &list.lines().map(in_jd).collect::<Vec<_>>().join("\n"));
    let message = desk.refusal(&["map", "star.json", "--out", "map"]);
    says(&message, &["observations[1]", "one time system", "MJD is JD - 2400000.5"]);
}

/// A profile of one spectrograph every 63 d between those of the other: a map of each alone would leave no residuals.
#[test]
fn errors_are_measured_with_maps_of_the_seasons_of_all_sets() {
    let mut config = unchanging();
    let few = (0..7).map(|k| 0.3 + 21.13 * f64::from(k));
    let many = (0..21).map(|k| 6.97 * f64::from(k));
    for (k, cycles) in [many.collect::<Vec<f64>>(), few.collect()].into_iter().enumerate() {
        config["observations"][k]["simulate"]["cycles"] = json!(cycles);
    }
    config["observations"][0]["simulate"]["random_spots"]["lifetime_d"] = json!(1e6);
    let desk = Desk::new(config.clone());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let mut config = from_files(&config);
    config["observations"][1]["sigma_scale"] = json!("auto");
    desk.write("star.json", &config.to_string());
    desk.succeed(&["map", "star.json", "--out", "map"]);
    let map = desk.json("map/map.json");
    assert_eq!(map["maps"].as_array().unwrap().len(), 1);
    let scale = map["data_sets"][1]["errors"]["sigma_scale"].as_f64().unwrap();
    // a map of each of its profiles: 0.795
    assert!((scale - 1.0).abs() < 0.16, "{scale}");
}

#[test]
fn seasons_that_make_no_sense_are_refused_by_their_key() {
    let refused = |key: &str, value: Value, parts: &[&str]| {
        let desk = Desk::new(unchanging());
        desk.set(&format!("/imaging/{key}"), value);
        says(&desk.refusal(&["map", CONFIG, "--out", "map"]), parts);
    };
    let windows = |windows: Value, parts: &[&str]| refused("seasons", windows, parts);
    windows(json!([[-1, 100], [90, 300]]), &["imaging.seasons[1]", "90 d", "imaging.seasons[0] ends only at 100 d"]);
    windows(json!([[-1, 100], [300, 200]]), &["imaging.seasons[1]", "300 must be before the end 200"]);
    windows(json!([[1, 100], [200, 300]]), &["imaging.seasons", "profile at 0 d (observations[0])"]);
    windows(json!([[-1, 100], [200, 300], [400, 500]]), &["imaging.seasons[2]", "no profile"]);
    refused("season_gap_d", json!(0), &["imaging.season_gap_d", "above 0"]);
    let mut both = unchanging();
    both["imaging"]["season_gap_d"] = json!(30);
    both["imaging"]["seasons"] = json!([[-1, 300]]);
    says(&Desk::new(both).refusal(&["map", CONFIG, "--out", "map"]), &["imaging.seasons", "season_gap_d"]);
    let mut bright = unchanging();
    bright["imaging"]["brightness"] = json!("bright-and-dark");
    says(&Desk::new(bright).refusal(&["map", CONFIG, "--out", "map"]), &["observations[1].contrast", "bright"]);
    let mut integrated = two_sets();
    integrated["imaging"]["season_gap_d"] = json!(30);
    says(&Desk::new(integrated).refusal(&["map", CONFIG, "--out", "map"]), &["imaging.season_gap_d", "delete it"]);
}

/// First moments of all profiles of a config (km/s).
fn mean_velocities(desk: &Desk, config: &str) -> Vec<f64> {
    let scene = Scene::load(&desk.path(config)).unwrap();
    let moment = |profile: &Profile| {
        let depths = profile.intensity.iter().map(|intensity| 1.0 - intensity);
        let velocity = |j: usize| profile.first_velocity_kms + j as f64 * profile.step_kms;
        let (sum, moved) = depths.enumerate().fold((0.0, 0.0), |(s, m), (j, d)| (s + d, m + d * velocity(j)));
        moved / sum
    };
    scene.observations.profiles.iter().map(moment).collect()
}

#[test]
fn a_list_of_one_is_that_one() {
    let mut config = two_sets();
    let one = config["observations"][0].clone();
    config["observations"] = one.clone();
    let desk = Desk::new(config.clone());
    config["observations"] = json!([one]);
    desk.write("list.json", &config.to_string());
    for (config, out) in [(CONFIG, "one"), ("list.json", "list")] {
        desk.succeed(&["map", config, "--out", out]);
    }
    for file in ["map.json", "profiles.csv", "rv.csv", "fit.json"] {
        assert!(desk.read(&format!("one/{file}")) == desk.read(&format!("list/{file}")), "{file}");
    }
}

#[test]
fn what_makes_no_sense_is_refused_by_its_key() {
    let refused = |edit: &dyn Fn(&mut Value), parts: &[&str]| {
        let mut config = two_sets();
        edit(&mut config);
        says(&Desk::new(config).refusal(&["map", CONFIG, "--out", "map"]), parts);
    };
    let set =
        |s: usize, key: &'static str, value: Value| move |c: &mut Value| c["observations"][s][key] = value.clone();
    refused(&set(1, "name", json!("Blue")), &["observations[1].name", "observations[0]"]);
    refused(&set(1, "name", json!("a/b")), &["observations[1].name", "letters"]);
    refused(&set(1, "pth", json!("x")), &["unknown key observations[1].pth", "path"]);
    refused(&set(1, "resolving_power", json!(-1)), &["observations[1].resolving_power", "above 0"]);
    refused(&set(1, "wavelength_nm", json!(500)), &["observations[1].wavelength_nm", "contrast"]);
    refused(&set(1, "velocity_jitter_kms", json!(0.1)), &["observations[1].velocity_jitter_kms", "observations[0]"]);
    refused(&set(1, "zero_point_kms", json!(1000)), &["observations[1].zero_point_kms", "100"]);
    refused(&set(1, "path", json!("x")), &["observations[1]", "not both"]);
    refused(&set(0, "exclude", json!([[1, 2]])), &["observations[0].exclude", "files"]);
    refused(
        &|c| c["imaging"]["objective"] = json!("spottedness"),
        &["observations[1].zero_point_kms", "give a number", "marginal-likelihood"],
    );
    refused(&|c| c["observations"] = json!([]), &["observations", "empty"]);
    refused(
        &|c| c["observations"][1]["simulate"]["spots"] = json!([[0, 0, 10, 1]]),
        &["observations[1].simulate.spots", "one star"],
    );
    refused(&|c| c["observations"][1]["simulate"]["seed"] = json!(1), &["observations[1].simulate.seed", "noise"]);
    refused(
        &|c| c["parameters"]["contrast"] = json!({ "prior": "uniform", "min": 0, "max": 0.9 }),
        &["observations[1].contrast", "parameters.contrast"],
    );
    refused(
        &|c| {
            c["observations"].as_array_mut().unwrap().remove(0);
            c["observations"][0]["simulate"]["spots"] = json!([]);
        },
        &["observations[0].zero_point_kms", "star.vsys_kms"],
    );
    let desk = Desk::new(two_sets());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let mut config = from_files(&two_sets());
    config["observations"][1]["exclude"] = json!([[0, 1000]]);
    desk.write("star.json", &config.to_string());
    says(&desk.refusal(&["map", "star.json", "--out", "map"]), &["observations[1].exclude", "leaves 0 of 7"]);
    config["observations"][1]["exclude"] = json!([[5, 4]]);
    desk.write("star.json", &config.to_string());
    says(&desk.refusal(&["map", "star.json", "--out", "map"]), &["observations[1].exclude[0]", "before"]);
    config["observations"][1] = two_sets()["observations"][1].clone();
    desk.write("star.json", &config.to_string());
    says(&desk.refusal(&["map", "star.json", "--out", "map"]), &["observations[1]", "either all"]);
}

/// Spots of lower contrast in the infrared: only their contrast there is fitted.
#[test]
fn the_contrast_of_a_second_set_is_fitted() {
    let mut simulated = two_sets();
    let cycles = |first: f64| (0..14).map(|k| first + 0.117 * f64::from(k)).collect::<Vec<f64>>();
    simulated["planet"]["k_kms"] = json!(0.0);
    simulated["star"]["regions"] = json!({ "area": 0, "area_limb": 0, "dimming_limb": 0 });
    for (set, first) in [(0, 0.0), (1, 0.05)] {
        simulated["observations"][set]["simulate"]["snr"] = json!(1000);
        simulated["observations"][set]["simulate"]["cycles"] = json!(cycles(first));
    }
    let red = &mut simulated["observations"][1];
    (red["contrast"], red["limb_darkening"]) = (json!(0.8), json!({ "law": "linear", "coefficients": [0.3] }));
    let desk = Desk::new(simulated.clone());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let mut config = from_files(&simulated);
    config["observations"][1]["contrast"] = json!("fitted");
    desk.write("star.json", &config.to_string());
    let said = desk.succeed(&["map", "star.json", "--out", "map"]);
    says(&said, &["red: 14 profiles", "spot contrast 0."]);
    let map = desk.json("map/map.json");
    let contrast = &map["data_sets"][1]["contrast"];
    let [value, sigma] = ["value", "sigma"].map(|key| contrast[key].as_f64().unwrap_or_else(|| panic!("{contrast}")));
    assert!((value - 0.8).abs() < 3.0 * sigma && sigma < 0.05, "{contrast}");
    assert_eq!(map["data_sets"][0].get("contrast"), None);
    let refused = |set: usize, key: &str, value: Value, expected: &str| {
        let mut config = config.clone();
        config["observations"][set][key] = value;
        desk.write("wrong.json", &config.to_string());
        says(&desk.refusal(&["map", "wrong.json", "--out", "wrong"]), &[expected]);
    };
    refused(0, "contrast", json!("fitted"), "observations[0].contrast: a number: contrasts of other data sets");
    refused(1, "regions", json!({ "area": 30 }), "observations[1].regions.area: 30 must be from 0 to 20");
    let wrong = json!({ "law": "linear", "coefficients": [1.3] });
    refused(1, "limb_darkening", wrong, "observations[1].limb_darkening.coefficients: 1.3 must be from 0 to 1");
}

/// A jitter of a set applies only to its velocities; an offset of a night is common to its profiles.
#[test]
fn sets_have_their_jitters_and_nights_their_offsets() {
    let mut simulated = two_sets();
    let pairs: Vec<f64> = (0..4).flat_map(|k| [0.0, 0.02].map(|late| 83.2 + 0.37 * f64::from(k) + late)).collect();
    simulated["observations"][1]["simulate"]["cycles"] = json!(pairs);
    let desk = Desk::new(simulated.clone());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let mut config = from_files(&simulated);
    (config["observations"][0]["velocity_jitter_kms"], config["observations"][1]["velocity_jitter_kms"]) =
        (json!(0.5), json!(0.0));
    let rows = |file: &str, head: usize| -> Vec<Vec<f64>> {
        let text = desk.read(file);
        text.lines().skip(head).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect()
    };
    let search = |config: &Value, name: &str| {
        desk.write("star.json", &config.to_string());
        desk.succeed(&["periodogram", "star.json", "--out", name, "--draws", "1000"]);
        let sigma = rows(&format!("{name}/rv.csv"), 1).iter().map(|row| row[3]).collect::<Vec<f64>>();
        (sigma, rows(&format!("{name}/covariance.csv"), 0))
    };
    let (sigma, still) = search(&config, "still");
    assert!(sigma[..7].iter().all(|sigma| *sigma > 0.5) && sigma[7..].iter().all(|sigma| *sigma < 0.4), "{sigma:?}");
    config["observations"][1]["night_jitter_kms"] = json!(0.7);
    let (_, moving) = search(&config, "moving");
    let more = |j: usize, k: usize| moving[j][k] - still[j][k];
    for (j, k) in [(7, 7), (7, 8), (13, 14)] {
        assert!((more(j, k) - 0.49).abs() < 0.05, "{}", more(j, k));
    }
    for (j, k) in [(0, 0), (0, 1), (7, 9), (0, 7)] {
        assert!(more(j, k).abs() < 0.05, "{}", more(j, k));
    }
    let refused = |set: usize, key: &str, value: Value, expected: &str| {
        let mut config = config.clone();
        config["observations"][set][key] = value;
        desk.write("wrong.json", &config.to_string());
        says(&desk.refusal(&["map", "wrong.json", "--out", "wrong"]), &[expected]);
    };
    let fitted = json!("fitted");
    refused(1, "velocity_jitter_kms", fitted, "must be as in observations[0], or a number in every data set");
    refused(1, "night_jitter_kms", json!(-1), "observations[1].night_jitter_kms: -1 must be from 0 to");
}
