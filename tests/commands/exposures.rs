//! Long exposures from the simulation to a planet: by the list, by the key, and left out.

use super::desk::{Desk, says};
use dimcmc::internals::star::Exposure;
use dimcmc::{Config, Scene};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

/// 5 % of a rotation: spots in the middle of the disc move by eight bins in that time.
const EXPOSURE_S: f64 = 4320.0;

/// A star with small dark spots and a planet, exposed for long.
fn star() -> Value {
    let cycles: Vec<f64> = (0..24).map(|k| 0.3 * f64::from(k) + 0.05 * f64::from(k % 3)).collect();
    json!({
        "star": { "rotation_period_d": 1.0, "inclination_deg": 60.0, "vsini_kms": 45.0, "contrast": 0.3, "fitted": [],
                  "regions": { "area": 0.0 },
                  "line": { "sigma_kms": 3.0, "equivalent_width_kms": 6.0 } },
        "planet": { "k_kms": 0.1, "porb_over_prot": 2.3, "phi": 0.2 },
        "observations": { "exposure_s": EXPOSURE_S, "velocity_jitter_kms": 0.0, "simulate": {
            "spots": [[30, 20, 9, 0.9], [110, -10, 7, 0.9], [200, 45, 10, 0.9], [290, 5, 8, 0.9]], "cycles": cycles,
            "velocity_kms": { "min": -61.2, "max": 61.2, "step": 1.8 }, "snr": 1500, "pixels": 8000 } },
        "imaging": { "pixels": 600, "objective": "marginal-likelihood", "spot_lifetime_d": "static" },
        "parameters": { "k_kms": { "prior": "uniform", "min": 0.0, "max": 1.0 }, "phi": { "prior": "periodic" } }
    })
}

/// The same read from the files in `data`.
fn from_files(exposure_s: Option<f64>) -> Value {
    let mut config = star();
    config["observations"] = json!({ "path": "data/observations.txt", "velocity_jitter_kms": 0.0, "events": "none" });
    if let Some(exposure_s) = exposure_s {
        config["observations"]["exposure_s"] = json!(exposure_s);
    }
    config
}

/// A desk with the simulated profiles, and their list without exposure times.
fn desk() -> (Desk, String) {
    let desk = Desk::new(star());
    desk.succeed(&["simulate", CONFIG, "--out", "data"]);
    let list = desk.read("data/observations.txt");
    assert!(list.starts_with("# file  time_d  vrad_kms  exposure_s\np000.prof 0 0 4320\n"), "{list}");
    let bare = list.lines().map(|line| line.rsplit_once(' ').unwrap().0.to_owned() + "\n").collect();
    (desk, bare)
}

#[test]
fn a_planet_behind_long_exposures() {
    let (desk, bare) = desk();
    desk.write("star.json", &from_files(None).to_string());
    desk.write("key.json", &from_files(Some(EXPOSURE_S)).to_string());
    let map = |config: &str, out: &str| {
        desk.succeed(&["map", config, "--out", out]);
        let fit = desk.json(&format!("{out}/fit.json"));
        let number = |pointer: &str| fit.pointer(pointer).unwrap().as_f64().unwrap();
        (number("/chi2_per_datum"), number("/field/ln_evidence"))
    };
    let with = map("star.json", "list");
    desk.succeed(&["optimise", "star.json", "--out", "optimum"]);
    let optimum = desk.json("optimum/optimum.json");
    let (k_kms, sd) = (optimum["parameters"]["k_kms"].as_f64().unwrap(), optimum["sd"]["k_kms"].as_f64().unwrap());
    assert!((k_kms - 0.1).abs() < 2.5 * sd && sd < 0.02, "{k_kms} {sd}");
    assert_eq!(optimum["blind_search"]["verdict"]["against"], json!([]));
    desk.write("data/observations.txt", &bare);
    assert_eq!(map("key.json", "key"), with);
    assert_eq!(desk.read("key/profiles.csv"), desk.read("list/profiles.csv"), "the key is as good as the list");
    // spots use up 8 % of the data; without exposure times chi2 rises by 0.09, and ln Z falls by 80
    let without = map("star.json", "none");
    assert!((with.0 - 0.92).abs() < 0.04 && without.0 > with.0 + 0.05, "{with:?} {without:?}");
    assert!(without.1 < with.1 - 40.0, "{with:?} {without:?}");
}

#[test]
fn exposures_of_a_first_config_and_of_an_injection_stay() {
    let (desk, bare) = desk();
    desk.succeed(&[
        "init",
        "data/observations.txt",
        "--rotation-period",
        "1",
        "--inclination",
        "60",
        "--pixels",
        "300",
        "--objective",
        "spottedness",
    ]);
    let scene = |config: &str| Scene::new(&Config::load(&desk.path(config)).unwrap()).unwrap();
    let exposures = |config: &str| scene(config).imager.sets[0].exposures.clone();
    assert!(exposures("star.json").iter().all(|exposure| exposure.looks > 3) && exposures("star.json").len() == 24);
    desk.write("short.json", &from_files(None).to_string());
    desk.succeed(&["inject", "short.json", "--k-kms", "0.2", "--porb-over-prot", "1.7", "--phi", "0", "--out", "more"]);
    assert_eq!(exposures("more/config.json"), [Exposure { length_d: 0.05, looks: 6 }; 24]);
    // by the key alone
    desk.write("data/observations.txt", &bare);
    desk.write("key.json", &from_files(Some(EXPOSURE_S)).to_string());
    desk.succeed(&["inject", "key.json", "--k-kms", "0.2", "--porb-over-prot", "1.7", "--phi", "0", "--out", "again"]);
    assert_eq!(exposures("again/config.json"), exposures("more/config.json"));
}

#[test]
fn exposures_that_are_too_long_name_their_line_or_key() {
    let (desk, _) = desk();
    let refused = |args: &[&str], wanted: &str| says(&desk.refusal(args), &[wanted]);
    let list = desk.read("data/observations.txt").replace("p002.prof 0.7 0 4320", "p002.prof 0.7 0 9000");
    desk.write("data/observations.txt", &list);
    desk.write("star.json", &from_files(None).to_string());
    let problem = "9000 s is 0.1042 of a rotation (star.rotation_period_d 1 d), at most 0.1 is modelled: give each";
    refused(
        &["map", "star.json", "--out", "map"],
        &format!("data/observations.txt:4: p002.prof: exposure time of {problem}"),
    );
    desk.write("key.json", &from_files(Some(9000.0)).to_string());
    refused(&["map", "key.json", "--out", "map"], &format!("key.json: observations.exposure_s: {problem}"));
}
