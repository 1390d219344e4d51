//! `dimcmc init`: other commands accept its config without changes, its values are those of the star, and every unknown
//! value is reported.

use crate::desk::{Desk, dimcmc, says, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const PROFILES: usize = 11;

/// A small star with a planet of 0.3 km/s, with continuum beside the line.
fn simulated() -> Value {
    json!({
        "star": {
            "rotation_period_d": 3.0, "epoch_d": 100.0, "inclination_deg": 50.0, "vsini_kms": 25.0, "vsys_kms": 1.7,
            "photosphere_k": 5000.0, "spot_k": 3500.0,
            "line": { "sigma_kms": 2.5, "equivalent_width_kms": 5.8 }
        },
        "instrument": { "resolving_power": 65000.0 },
        "planet": { "k_kms": 0.3, "porb_over_prot": 1.7, "phi": 0.5 },
        "observations": { "simulate": {
            "spots": [[30, 40, 25, 0.8], [200, 10, 15, 0.9]],
            "cycles": [0.0, 0.19, 0.37, 0.56, 0.79, 1.01, 1.18, 1.37, 1.61, 1.86, 2.04],
            "velocity_kms": { "min": -64.8, "max": 64.8, "step": 2.7 },
            "snr": 300, "seed": 7, "pixels": 2000
        } }
    })
}

/// That star observed.
pub fn desk() -> Desk {
    let desk = Desk::new(simulated());
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    desk
}

/// Few pixels, for the sake of time.
pub const INIT: [&str; 8] =
    ["init", "data/observations.txt", "--rotation-period", "3", "--inclination", "50", "--pixels", "300"];

/// With the objective that is tested fastest, where only measurements on the profiles matter.
pub fn quick() -> Vec<&'static str> {
    [&INIT[..], &["--objective", "spottedness"]].concat()
}

fn number(config: &Value, pointer: &str) -> f64 {
    config.pointer(pointer).unwrap_or_else(|| panic!("{pointer}")).as_f64().unwrap_or_else(|| panic!("{pointer}"))
}

#[test]
fn the_config_is_taken_as_it_is() {
    let desk = desk();
    let table = desk.succeed(&INIT);
    println!("{table}");
    says(
        &table,
        &[
            "11 profiles of 49 bins of 2.700 km/s, from 100.000 to 106.120 (6.120 d); quoted S/N 300 per bin",
            "from the profiles\n",
            "given\n",
            "--rotation-period",
            "assumed, please check\n",
            "--resolving-power",
            "note: test fit: evolving maps fit the 11 profiles with χ²/N = ",
            "written: star.json\n",
            "  dimcmc map star.json --out map ",
        ],
    );
    assert!(!table.contains("still to be given") && !table.contains("imaging.brightness"));
    let config = desk.json("star.json");
    assert!((number(&config, "/star/vsini_kms") - 25.0).abs() < 1.0, "its error says 0.7, the width of the line open");
    assert!((number(&config, "/star/vsys_kms") - 1.7).abs() < 0.3, "three errors of 0.1");
    assert_eq!(number(&config, "/star/epoch_d"), 103.06);
    assert_eq!(config["star"]["line"]["equivalent_width_kms"], "auto");
    let range = &config["observations"]["velocity_range_kms"];
    // vsini, three sigmas of a line of 3.2 km/s (R = 65000 included) and six bins of continuum, around vsys
    assert!((range[0].as_f64().unwrap() - (1.7 - 50.8)).abs() < 3.0 && (range[1].as_f64().unwrap() - 52.5).abs() < 3.0);
    assert_eq!(config["observations"]["sigma_scale"], "auto");
    says(&table, &["measured by every command: ", "rescaled by ", "(continuum rms "]);
    assert!(config["observations"].get("continuum_level").is_none(), "it is at 1");
    assert!(config["imaging"].get("nuisances").is_none(), "and stays there");
    let orbits = &config["parameters"]["porb_over_prot"];
    assert!(orbits["min"].as_f64().unwrap() < 0.5 && orbits["max"] == 2.0, "one orbit in 2.04 rotations: {orbits}");
    assert!(number(&config, "/parameters/k_kms/max") > 0.6);

    desk.succeed(&["map", "star.json", "--out", "map"]);
    desk.succeed(&["periodogram", "star.json", "--out", "search"]);
    let found = desk.json("search/periodogram.json");
    let (k, sigma) = (number(&found, "/best/k_kms"), number(&found, "/best/sigma_k_kms"));
    assert!((k - 0.3).abs() < 2.0 * sigma && sigma < 0.3, "{}", found["best"]);
    // a step from the prior: that a search leads to the orbit is a truth of others
    let mut config = config;
    config["sampler"] = json!({ "ensembles": 2, "walkers": 14, "steps": 1 });
    desk.write("star.json", &config.to_string());
    desk.succeed(&["sample", "star.json", "--out", "run", "--start", "prior"]);
    // the walkers at the start and after the step
    assert_eq!(desk.lines("run/chain.jsonl"), 2 * (2 * 14));
}

/// What is written does not depend on threads or on when and how often it is asked for.
#[test]
fn the_same_observations_give_the_same_config() {
    let desk = desk();
    let first = desk.succeed(&[&INIT[..], &["--out", "a.json"]].concat());
    let second = desk.succeed(&[&INIT[..], &["--out", "b.json", "--threads", "1", "--quiet"]].concat());
    assert_eq!(desk.read("a.json"), desk.read("b.json"));
    assert_eq!(first.replace("a.json", "b.json"), second);
}

#[test]
fn what_nobody_knows_is_marked_and_refused_later() {
    let desk = desk();
    let table = desk.succeed(&["init", "data/observations.txt", "--out", "a.json"]);
    says(
        &table,
        &[
            "still to be given\n",
            "star.rotation_period_d",
            "null",
            "note: missing rotation period: other commands refuse",
        ],
    );
    assert_eq!(desk.json("a.json")["star"]["rotation_period_d"], Value::Null);
    for command in ["map", "periodogram", "optimise", "sample"] {
        let message = desk.refusal(&[command, "a.json", "--out", "out"]);
        says(&message, &["a.json: star.rotation_period_d: null marks a missing value: give a number"]);
    }
    desk.edit("a.json", |text| text.replace("null", "3.0"));
    desk.succeed(&["map", "a.json", "--out", "out"]);
}

#[test]
fn options_replace_what_is_measured() {
    let desk = desk();
    let options = [
        ("--epoch", "/star/epoch_d", -1.5),
        ("--vsini", "/star/vsini_kms", 25.5),
        ("--domega", "/star/domega_rad_d", -0.01),
        ("--limb-darkening", "/star/limb_darkening/coefficients/0", 0.5),
        ("--photosphere", "/star/photosphere_k", 4400.0),
        ("--spot", "/star/spot_k", 3600.0),
        ("--wavelength", "/star/wavelength_nm", 650.0),
        ("--line-sigma", "/star/line/sigma_kms", 3.5),
        ("--resolving-power", "/instrument/resolving_power", 100_000.0),
    ];
    let texts: Vec<String> =
        options.iter().flat_map(|(name, _, value)| [name.to_string(), value.to_string()]).collect();
    let args: Vec<&str> = quick().into_iter().chain(texts.iter().map(String::as_str)).collect();
    let table = desk.succeed(&args);
    let config = desk.json("star.json");
    for (name, pointer, value) in options {
        assert_eq!(number(&config, pointer), value, "{name}");
        assert!(table.contains(name), "{name}");
    }
}

/// Errors five times too large, and five times too small: as measured on the continuum.
#[test]
fn wrong_errors_are_scaled() {
    for (scale, expected) in [(5.0, 0.2), (0.2, 5.0)] {
        let desk = desk();
        for k in 0..PROFILES {
            let scaled = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
                [v, i, s] => format!("{v} {i} {:e}\n", s.parse::<f64>().unwrap() * scale),
                _ => format!("{line}\n"),
            };
            // two lines of header
            desk.edit(&format!("data/p{k:03}.prof"), |text| {
                text.lines().enumerate().map(|(n, l)| if n < 2 { format!("{l}\n") } else { scaled(l) }).collect()
            });
        }
        let table = desk.succeed(&quick());
        says(
            &table,
            &["observations.sigma_scale", "auto", "rescaled by", "note: test fit: a brightness that varies by"],
        );
        assert_eq!(desk.json("star.json")["observations"]["sigma_scale"], "auto");
        desk.succeed(&["map", "star.json", "--out", "map"]);
        let found = number(&desk.json("map/fit.json"), "/measured/errors/sigma_scale");
        // the scatter of some 120 bins is good to 6 %, and the larger of two such numbers counts
        assert!((found / expected - 1.0).abs() < 0.15, "{found}");
    }
}

/// Intensities of profile `k` become `change(k, intensity)`, times and errors stay.
fn with_intensities(desk: &Desk, change: impl Fn(usize, f64) -> f64) {
    with_rows(desk, |k, _, intensity, sigma| (change(k, intensity), sigma));
}

/// Intensity and its error of profile `k` become `change(k, velocity, intensity, error)`, times stay.
fn with_rows(desk: &Desk, change: impl Fn(usize, f64, f64, f64) -> (f64, f64)) {
    for k in 0..PROFILES {
        let number = |text: &str| text.parse::<f64>().unwrap();
        let changed = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
            [v, i, s] => {
                let (i, s) = change(k, number(v), number(i), number(s));
                format!("{v} {i:e} {s:e}\n")
            }
            _ => format!("{line}\n"),
        };
        desk.edit(&format!("data/p{k:03}.prof"), |text| {
            text.lines().enumerate().map(|(n, l)| if n < 2 { format!("{l}\n") } else { changed(l) }).collect()
        });
    }
}

#[test]
fn a_continuum_that_is_not_at_one_is_recognised() {
    let desk = desk();
    with_intensities(&desk, |_, intensity| 0.977 * intensity);
    let table = desk.succeed(&quick());
    says(
        &table,
        &[
            "observations.continuum_level",
            "0.97",
            "level of the continuum beside the line",
            "test fit: a brightness that varies by",
        ],
    );
    let config = desk.json("star.json");
    // 11 profiles of some 11 bins of S/N 300: good to 3e-4
    assert!((number(&config, "/observations/continuum_level") - 0.977).abs() < 6e-4);
    assert!((number(&config, "/star/vsini_kms") - 25.0).abs() < 1.2);
    desk.succeed(&["map", "star.json", "--out", "map"]);
    let fit = desk.json("map/fit.json");
    assert!((number(&fit, "/measured/errors/sigma_scale") - 1.0).abs() < 0.15);
    assert!((number(&fit, "/equivalent_width_kms") / 5.8 - 1.0).abs() < 0.02);
    assert!(fit.get("diagnosis").is_none());
    // the level is part of what the data are
    desk.edit("star.json", |text| text.replace("\"continuum_level\": 0.97", "\"continuum_level\": 0.96"));
    desk.succeed(&["map", "star.json", "--out", "other"]);
    let other = desk.json("other/fit.json");
    assert_ne!(fit["data_sha256"], other["data_sha256"]);
    assert_eq!(other["diagnosis"]["reason"], "continuum", "{}", other["diagnosis"]);
    for level in ["0", "0.4", "3"] {
        desk.write("b.json", &with_level(&config, level).to_string());
        says(&desk.refusal(&["map", "b.json", "--out", "x"]), &["b.json: observations.continuum_level: "]);
    }
}

fn with_level(config: &Value, level: &str) -> Value {
    let mut config = config.clone();
    config["observations"]["continuum_level"] = serde_json::from_str(level).unwrap();
    config
}

#[test]
fn continua_that_wander_are_let() {
    let desk = desk();
    with_intensities(&desk, |k, intensity| intensity + 0.006 * (7.3 * k as f64 * k as f64).sin() - 0.01);
    let table = desk.succeed(&INIT);
    says(&table, &["imaging.nuisances.continuum_offset", "above the noise", "observations.continuum_level"]);
    let config = desk.json("star.json");
    // 0.006 times the standard deviation of a sine
    assert!((0.003..0.007).contains(&number(&config, "/imaging/nuisances/continuum_offset")), "{config}");
    desk.succeed(&["map", "star.json", "--out", "map"]);
}

/// The wrong vsini is reported, with a better one, whether uncertainties are measured or given.
#[test]
fn a_map_that_does_not_fit_says_why() {
    let desk = desk();
    desk.succeed(&quick());
    let mut config = desk.json("star.json");
    config["imaging"]["pixels"] = json!(500);
    config["star"]["vsini_kms"] = json!(21.0);
    config["star"]["line"]["sigma_kms"] = json!(2.5);
    desk.write("star.json", &config.to_string());
    let table = desk.succeed(&["map", "star.json", "--out", "map"]);
    says(&table, &["warning", "likely cause: vsini; with star.vsini_kms = 2", "instead of 21 a map reaches chi2/N = "]);
    let diagnosis = desk.json("map/fit.json")["diagnosis"].clone();
    assert_eq!(diagnosis["reason"], "vsini");
    let [before, after] = ["/chi2_per_datum", "/chi2_per_datum_changed"].map(|key| number(&diagnosis, key));
    assert!(after < 1.4 && before > 2.0 * after, "{before} {after}");
    config["observations"]["sigma_scale"] = json!(1.0);
    desk.write("star.json", &config.to_string());
    says(
        &desk.refusal(&["map", "star.json", "--out", "other"]),
        &[
            "imaging.chi2_target: the target chi2 of 0.9700 per datum is below",
            "; likely cause: vsini; with star.vsini_kms = 2",
        ],
    );
}

/// With a vsini far from the measured one nothing fits: the measured one is written, and this is reported.
#[test]
fn a_vsini_of_another_star_is_put_right() {
    let desk = desk();
    let table = desk.succeed(&[&INIT[..], &["--vsini", "45"]].concat());
    says(
        &table,
        &[
            "note: the given vsini is 45 km/s, the mean profile suggests 2",
            "note: maps fit much better with the vsini of the mean profile than with the given one: 2",
            "next:\n  dimcmc map star.json",
        ],
    );
    assert!((number(&desk.json("star.json"), "/star/vsini_kms") - 25.0).abs() < 1.2);
}

/// A line that is too broad for the profiles is corrected by the fit that `init` requests; a config that fixes it gets
/// maps with the reason why they are invalid.
#[test]
fn a_line_that_is_wrong_is_put_right_or_named() {
    let desk = desk();
    let wrong = ["--line-sigma", "9", "--vsini", "25"];
    let table = desk.succeed(&[&INIT[..], &wrong].concat());
    says(
        &table,
        &[
            "star.fitted",
            "line_sigma_kms, equivalent_width_kms",
            "note: test fit: evolving maps fit",
            "note: star: line sigma ",
        ],
    );
    let mut config = desk.json("star.json");
    assert_eq!(config["star"]["fitted"].as_array().unwrap().len(), 4);
    config["star"].as_object_mut().unwrap().remove("fitted");
    desk.write("star.json", &config.to_string());
    let said = desk.succeed(&["map", "star.json", "--out", "map"]);
    says(&said, &["implausibly large", "likely cause: the width of the local line"]);
}

/// Profiles that end where the line does: their continuum is seen at their ends alone.
#[test]
fn a_continuum_at_the_ends_alone_is_recognised() {
    let mut config = simulated();
    config["observations"]["simulate"]["velocity_kms"] = json!({ "min": -32.3, "max": 35.7, "step": 1.7 });
    let desk = Desk::new(config);
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    with_intensities(&desk, |_, intensity| 0.977 * intensity);
    let table = desk.succeed(&INIT);
    says(
        &table,
        &[
            "observations.continuum_level",
            "note: test fit: evolving maps fit",
            "as quoted: too little continuum beside the line to measure the noise. Give profiles of a wider velocity",
        ],
    );
    assert!(!table.contains("unknown"), "{table}");
    let config = desk.json("star.json");
    let level = number(&config, "/observations/continuum_level");
    assert!((level - 0.977).abs() < 2e-3, "{level}: ten errors of a bin of the mean profile");
    assert!((number(&config, "/star/vsini_kms") - 25.0).abs() < 1.2);
    desk.succeed(&["map", "star.json", "--out", "map"]);
    // what ends within the line is none: its ends are no continuum
    let mut config = simulated();
    config["observations"]["simulate"]["velocity_kms"] = json!({ "min": -22.1, "max": 25.5, "step": 1.7 });
    let cut = Desk::new(config);
    cut.succeed(&["simulate", "config.json", "--out", "data"]);
    cut.succeed(&[&INIT[..], &["--line-sigma", "2.5"]].concat());
    assert!(cut.json("star.json")["observations"].get("continuum_level").is_none());
}

/// Continua that are tilted, all alike: their slope is written, and `map` takes it up.
#[test]
fn continua_that_are_tilted_are_let() {
    let desk = desk();
    with_rows(&desk, |_, v, i, s| (i * (1.0 + 2e-4 * v), s));
    let table = desk.succeed(&quick());
    says(&table, &["imaging.nuisances.continuum_slope", "above the noise", "test fit: a brightness"]);
    let config = desk.json("star.json");
    let range = &config["observations"]["velocity_range_kms"];
    let expected = 1e-4 * (range[1].as_f64().unwrap() - range[0].as_f64().unwrap());
    let slope = number(&config, "/imaging/nuisances/continuum_slope");
    assert!((slope / expected - 1.0).abs() < 0.2, "{slope} {expected}");
    desk.succeed(&["map", "star.json", "--out", "map"]);
}

/// Variances in place of standard deviations are reported, not corrected.
#[test]
fn variances_are_named() {
    const SAID: &str = "the uncertainties of the profiles look like variances: they are 1.1e-5";
    let desk = desk();
    with_rows(&desk, |_, _, i, s| (i, s * s));
    says(&desk.succeed(&INIT), &[SAID, "Give standard deviations, the roots of these numbers"]);
    assert_eq!(desk.json("star.json")["observations"]["sigma_scale"], "auto");
    // where there is no continuum beside the line to scale them by, no map could be made
    let mut config = simulated();
    config["observations"]["simulate"]["velocity_kms"] = json!({ "min": -34.0, "max": 37.4, "step": 1.7 });
    let desk = Desk::new(config);
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    with_rows(&desk, |_, _, i, s| (i, s * s));
    says(&desk.refusal(&INIT), &["data/observations.txt: ", SAID]);
}

/// A second star in the profiles is named by `init` and `map`, and no other rotation period is advised.
#[test]
fn double_lines_are_named() {
    const SAID: &str = "the profiles look like those of a double-lined binary";
    let desk = desk();
    desk.succeed(&INIT);
    with_rows(&desk, |k, v, i, s| {
        let away = (v - 40.0 * (1.3 * k as f64).sin()) / 14.0;
        (i - 0.1 * (1.0 - away * away).max(0.0).sqrt(), s)
    });
    // few pixels may follow the companion, poorly
    let table = desk.succeed(&[&INIT[..], &["--out", "other.json"]].concat());
    says(&table, &["but not to within the uncertainties: the line is ", SAID, "Take out the line of the companion"]);
    assert!(!table.contains("likely reason") && !table.contains("a rotation period of"), "{table}");
    let mut config = desk.json("star.json");
    config["imaging"]["objective"] = json!("spottedness");
    config["imaging"]["pixels"] = json!(300);
    config["observations"]["sigma_scale"] = json!(1.0);
    config["observations"]["velocity_jitter_kms"] = json!(0);
    desk.write("star.json", &config.to_string());
    let message = desk.refusal(&["map", "star.json", "--out", "map"]);
    says(&message, &["star.json: imaging.chi2_target: ", SAID]);
    assert!(!message.contains("likely reason"), "{message}");
}

/// Evolving maps are bright and dark as the profiles require: there is no choice to make.
#[test]
fn brightness_is_for_static_maps() {
    let desk = desk();
    let refused = desk.refusal(&[&INIT[..], &["--brightness", "spots"]].concat());
    says(&refused, &["--brightness: no effect on evolving maps", "--objective spottedness"]);
    desk.succeed(&INIT);
    let mut config = desk.json("star.json");
    assert!(config["imaging"].get("brightness").is_none());
    for model in ["spots", "bright-and-dark"] {
        config["imaging"]["brightness"] = json!(model);
        desk.write("star.json", &config.to_string());
        let refused = desk.refusal(&["map", "star.json", "--out", "map"]);
        says(&refused, &["star.json: imaging.brightness: no effect", "\"spottedness\""]);
    }
}

/// Two spectrographs and a light curve become one config, which every command takes.
#[test]
fn several_lists_and_a_light_curve_are_joined() {
    let mut config = simulated();
    let mut second = json!({ "simulate": {
        "cycles": [0.07, 0.31, 0.64, 0.93, 1.27, 1.49, 1.75, 1.98],
        "velocity_kms": { "min": -60.0, "max": 60.0, "step": 2.0 }, "snr": 250, "seed": 8, "pixels": 2000,
        "zero_point_kms": 0.4
    } });
    second["name"] = json!("harps");
    second["resolving_power"] = json!(115000);
    second["wavelength_nm"] = json!(520);
    let mut first = config["observations"].clone();
    first["name"] = json!("espadons");
    config["observations"] = json!([first, second]);
    config["photometry"] =
        json!({ "name": "tess", "wavelength_nm": 790, "simulate": { "cadence_d": 0.1, "sigma": 1e-3 } });
    config["imaging"] = json!({ "objective": "marginal-likelihood" });
    let desk = Desk::new(config);
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    let both = ["init", "data/espadons/observations.txt", "data/harps/observations.txt"];
    let star = ["--rotation-period", "3", "--inclination", "50", "--pixels", "300"];
    let own = ["--photometry", "data/tess.csv", "--resolving-power", "65000,115000", "--wavelength", "550,520"];
    let table = desk.succeed(&[&both[..], &star, &own].concat());
    println!("{table}");
    says(
        &table,
        &[
            "11 profiles of 49 bins",
            "8 profiles of 61 bins",
            "observations[1].zero_point_kms",
            "observations[1].resolving_power",
            "observations[1].wavelength_nm",
            "photometry.wavelength_nm",
            "note: test fit: evolving maps fit the 19 profiles",
        ],
    );
    let config = desk.json("star.json");
    let sets = config["observations"].as_array().unwrap();
    assert_eq!(sets.iter().map(|set| &set["name"]).collect::<Vec<_>>(), ["espadons", "harps"]);
    assert!(sets[0].get("zero_point_kms").is_none() && sets[1]["zero_point_kms"] == "fitted");
    assert_eq!((number(&config, "/instrument/resolving_power"), number(&sets[1], "/resolving_power")), (65e3, 115e3));
    assert_eq!((number(&config, "/star/wavelength_nm"), number(&sets[1], "/wavelength_nm")), (550.0, 520.0));
    assert!(sets.iter().all(|set| set["velocity_range_kms"].is_array() && set["sigma_scale"] == "auto"));
    assert_eq!(config["photometry"]["path"], "data/tess.csv");
    assert_eq!(number(&config, "/photometry/wavelength_nm"), 790.0);
    assert!((number(&config, "/star/vsini_kms") - 25.0).abs() < 1.0);
    // orbits of all times, and K of no offset between the sets
    assert_eq!(config["parameters"]["porb_over_prot"]["max"], 2.0);
    desk.succeed(&["map", "star.json", "--out", "map"]);
    desk.succeed(&["periodogram", "star.json", "--out", "search"]);
    let offset = &desk.json("map/fit.json")["measured"]["sets"][1]["zero_point"];
    let (value, sigma) = (number(offset, "/value_kms"), number(offset, "/sigma_kms"));
    assert!((value - 0.4).abs() < 3.0 * sigma && sigma < 0.3, "{offset}");

    let refused = |more: &[&str], parts: &[&str]| {
        says(&desk.refusal(&[&both[..], &["--out", "no.json"], more].concat()), parts);
    };
    refused(&["--objective", "spottedness"], &["several lists", "\"marginal-likelihood\""]);
    refused(&["--resolving-power", "1e5,1e5,1e5"], &["--resolving-power: 3 values, and 2 "]);
    refused(&["data/../data/harps/observations.txt"], &["is given twice"]);
    refused(&["--photometry", "absent.csv"], &["absent.csv: cannot read"]);
    let one = ["init", both[1], "--photometry", "data/tess.csv", "--objective", "spottedness", "--out", "no.json"];
    says(&desk.refusal(&one), &["--photometry: takes the objective \"marginal-likelihood\""]);
}

#[test]
fn the_observations_are_found_from_wherever_the_config_is() {
    let desk = desk();
    for folder in ["configs", "configs/deep", "data/inside"] {
        std::fs::create_dir_all(desk.path(folder)).unwrap();
    }
    let cases = [
        ("configs/deep/star.json", "../../data/observations.txt"),
        ("data/star.json", "observations.txt"),
        ("data/inside/star.json", "../observations.txt"),
    ];
    for (out, expected) in cases {
        desk.succeed(&[&quick()[..], &["--out", out]].concat());
        let config = desk.json(out);
        assert_eq!(Path::new(config["observations"]["path"].as_str().unwrap()), Path::new(expected));
        assert!(config.get("$schema").is_none());
    }
    desk.succeed(&["map", "data/inside/star.json", "--out", "map"]);
    // the schema is named where it lies beside the config
    let schema = text(&dimcmc(&["schema"], &desk.path("")).stdout);
    desk.write("configs/dimcmc.schema.json", &schema);
    desk.succeed(&[&quick()[..], &["--out", "configs/star.json"]].concat());
    assert_eq!(desk.json("configs/star.json")["$schema"], "dimcmc.schema.json");
}

#[test]
fn what_cannot_be_is_refused_in_a_line() {
    let desk = desk();
    desk.write("star.json", "precious");
    let refused = |more: &[&str], parts: &[&str]| says(&desk.refusal(&[&INIT[..], more].concat()), parts);
    refused(&[], &["--out star.json: star.json exists", "--force"]);
    refused(&["--out", "data"], &["--out data: is a folder"]);
    refused(&["--out", "absent/star.json"], &["--out absent/star.json: absent is not a folder"]);
    refused(&["--out", "star.json/x.json"], &["star.json is not a folder"]);
    let bad: [(&[&str], &str); 4] = [
        (&["--vsini", "0"], "star.vsini_kms: 0 must be above 0"),
        (&["--spot", "6000"], "star.spot_k: 6000 must be below photosphere_k"),
        (&["--limb-darkening", "1.5"], "star.limb_darkening.coefficients: 1.5"),
        (&["--line-sigma", "0"], "star.line.sigma_kms: 0 must be above 0"),
    ];
    for (options, problem) in bad {
        refused(&["--out", "a.json", &options.join("=")], &[&format!("{}: ", options[0]), problem]);
    }
    for options in [
        ["--line-sigma=1e9", "--resolving-power=1"],
        ["--line-sigma=0", "--resolving-power=1e12"],
        ["--line-sigma=2.5", "--resolving-power=-1"],
    ] {
        refused(
            &["--out", "a.json", options[0], options[1]],
            &["data/observations.txt: a local line of a standard deviation"],
        );
    }
    for option in ["--limb-darkening=nan", "--resolving-power=nan", "--line-sigma=inf", "--epoch=nan", "--vsini=1e308"]
    {
        refused(&["--out", "a.json", option], &[&format!("{}: ", option.split('=').next().unwrap())]);
    }
    for period in ["0", "-3", "inf"] {
        let args = ["init", "data/observations.txt", "--out", "a.json", &format!("--rotation-period={period}")];
        says(&desk.refusal(&args), &["--rotation-period: "]);
    }
    says(
        &desk.refusal(&[&INIT[..5], &["95", "--out", "a.json"]].concat()),
        &["--inclination: star.inclination_deg: 95"],
    );
    says(&desk.refusal(&["init", "absent.txt", "--out", "a.json"]), &["absent.txt: cannot read"]);
    desk.write("empty.txt", "# nothing\n");
    says(&desk.refusal(&["init", "empty.txt", "--out", "a.json"]), &["empty.txt: lists no profile"]);
    let flat: String = (0..40).map(|j| format!("{} 1.0 0.001\n", -39 + 2 * j)).collect();
    desk.write("flat.prof", &flat);
    desk.write("flat2.prof", &flat);
    desk.write("flat.txt", "flat.prof 0\nflat2.prof 1\n");
    says(
        &desk.refusal(&["init", "flat.txt", "--out", "a.json"]),
        &["flat.txt: no absorption line in the mean profile"],
    );
    assert_eq!(desk.read("star.json"), "precious");
    desk.succeed(&[&quick()[..], &["--force"]].concat());
    assert_ne!(desk.read("star.json"), "precious");
}

/// A single profile, or two at the same time, do not constrain spots and periods; two within minutes are enough for the
/// rest.
#[test]
fn two_profiles_are_enough_for_a_start() {
    let desk = desk();
    desk.write("data/few.txt", "p003.prof 101.1\n");
    says(&desk.refusal(&["init", "data/few.txt", "--rotation-period", "3"]), &["data/few.txt:1: the only profile of"]);
    desk.write("data/few.txt", "p003.prof 101.1\np004.prof 101.1\n");
    says(&desk.refusal(&["init", "data/few.txt"]), &["data/few.txt:2: p004.prof has the time 101.1 of p003.prof"]);
    // of nearly the same phase
    desk.write("data/few.txt", "p001.prof 101.1\np006.prof 101.11\n");
    let table = desk.succeed(&["init", "data/few.txt", "--rotation-period", "3"]);
    says(&table, &["2 profiles of", "parameters.porb_over_prot"]);
    desk.succeed(&["map", "star.json", "--out", "map"]);
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn lo_peg_has_a_config() {
    let data = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data/lopeg/observations.txt");
    if !data.exists() {
        println!("skipped: {} is not there", data.display());
        return;
    }
    let desk = Desk::new(json!(null));
    let list = data.to_str().unwrap();
    let table = desk.succeed(&["init", list, "--rotation-period", "0.4232", "--inclination", "45", "--domega", "0.03"]);
    println!("{table}");
    let config = desk.json("star.json");
    // published: 67.7 km/s and -19.8 km/s, which VRAD subtracts
    assert!((number(&config, "/star/vsini_kms") - 67.7).abs() < 1.2);
    assert!(number(&config, "/star/vsys_kms").abs() < 0.6);
    assert_eq!(config["observations"]["sigma_scale"], "auto");
    desk.succeed(&["map", "star.json", "--out", "map"]);
    // the errors are several times too large
    let errors = desk.json("map/fit.json")["measured"]["errors"].clone();
    // where noise is correlated over several bins, they are larger by the root of that
    let alone = number(&errors, "/sigma_scale") / number(&errors, "/correlated_bins").sqrt();
    assert!((0.2..0.6).contains(&alone), "{errors}");
}
