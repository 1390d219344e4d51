//! `dimcmc init`: the config that it writes is taken by the other commands as it is, its values are those of the star,
//! and nothing that is not known is passed over in silence.

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

fn desk() -> Desk {
    let desk = Desk::new(simulated());
    desk.succeed(&["simulate", "config.json", "--out", "data"]);
    desk
}

/// Few pixels, for the sake of time.
const INIT: [&str; 8] =
    ["init", "data/observations.txt", "--rotation-period", "3", "--inclination", "50", "--pixels", "300"];

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
            "11 profiles of 49 bins of 2.700 km/s, from 100.000 to 106.120 (6.120 d); S/N 300 a bin",
            "from the profiles\n",
            "given\n",
            "--rotation-period",
            "assumed, please check\n",
            "--resolving-power",
            "note: tried out: a brightness that varies by ",
            "written: star.json\n",
            "  dimcmc map star.json --out map ",
        ],
    );
    assert!(!table.contains("still to be given"));
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
        &["still to be given\n", "star.rotation_period_d", "null", "note: without a rotation period no command"],
    );
    assert_eq!(desk.json("a.json")["star"]["rotation_period_d"], Value::Null);
    for command in ["map", "periodogram", "optimise", "sample"] {
        let message = desk.refusal(&[command, "a.json", "--out", "out"]);
        says(&message, &["a.json: star.rotation_period_d: null stands for a value still to be given: put a number"]);
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
    let args: Vec<&str> = INIT.into_iter().chain(texts.iter().map(String::as_str)).collect();
    let table = desk.succeed(&args);
    let config = desk.json("star.json");
    for (name, pointer, value) in options {
        assert_eq!(number(&config, pointer), value, "{name}");
        assert!(table.contains(name), "{name}");
    }
}

/// Errors five times too large, and five times too small: the continuum says so.
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
        let table = desk.succeed(&INIT);
        says(
            &table,
            &["observations.sigma_scale", "auto", "rescaled by", "note: tried out: a brightness that varies by "],
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
    for k in 0..PROFILES {
        let changed = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
            [v, i, s] => format!("{v} {} {s}\n", change(k, i.parse::<f64>().unwrap())),
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
    let table = desk.succeed(&[&INIT[..], &["--objective", "spottedness"]].concat());
    says(
        &table,
        &[
            "observations.continuum_level",
            "0.97",
            "the continuum beside the line is there",
            "tried out: a brightness that varies by",
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
    says(
        &table,
        &["imaging.nuisances.continuum_offset", "more than their noise explains", "observations.continuum_level"],
    );
    let config = desk.json("star.json");
    // 0.006 times the standard deviation of a sine
    assert!((0.003..0.007).contains(&number(&config, "/imaging/nuisances/continuum_offset")), "{config}");
    desk.succeed(&["map", "star.json", "--out", "map"]);
}

/// The wrong vsini is named, with a better one, whether errors are measured or given.
#[test]
fn a_map_that_does_not_fit_says_why() {
    let desk = desk();
    desk.succeed(&[&INIT[..], &["--objective", "spottedness"]].concat());
    let mut config = desk.json("star.json");
    config["imaging"]["pixels"] = json!(500);
    config["star"]["vsini_kms"] = json!(21.0);
    config["star"]["line"]["sigma_kms"] = json!(2.5);
    desk.write("star.json", &config.to_string());
    let table = desk.succeed(&["map", "star.json", "--out", "map"]);
    says(
        &table,
        &[
            "warning",
            "vsini is the likely reason: with star.vsini_kms = 2",
            "instead of 21 a map comes down to chi2 = ",
        ],
    );
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
            "; vsini is the likely reason: with star.vsini_kms = 2",
        ],
    );
}

/// With a vsini that is far from the measured one nothing fits: the measured one is written, and that is said.
#[test]
fn a_vsini_of_another_star_is_put_right() {
    let desk = desk();
    let table = desk.succeed(&[&INIT[..], &["--vsini", "45"]].concat());
    says(
        &table,
        &[
            "note: vsini is given as 45 km/s, the mean profile looks like 2",
            "note: no map fits with the given vsini, and one does much better with that of the mean profile, which is \
            written: 2",
            "next:\n  dimcmc map star.json",
        ],
    );
    assert!((number(&desk.json("star.json"), "/star/vsini_kms") - 25.0).abs() < 1.2);
}

/// A line that is too broad for the profiles: the config is written all the same, with what is likely to be wrong.
#[test]
fn a_model_that_does_not_fit_is_no_dead_end() {
    let desk = desk();
    let table = desk.succeed(&[&INIT[..], &["--line-sigma", "9", "--vsini", "25"]].concat());
    says(
        &table,
        &["note: the model does not fit as well as the errors promise: the width of the local line is the likely \
            reason"],
    );
    assert_eq!(desk.json("star.json")["observations"]["sigma_scale"], "auto");
    let failed = dimcmc(&["map", "star.json", "--out", "map"], &desk.path(""));
    assert_eq!(failed.status.code(), Some(1));
    says(&text(&failed.stderr), &["no map (amplitude-at-bound)", "the width of the local line is the likely reason"]);
    desk.succeed(
        &[&INIT[..], &["--line-sigma", "9", "--vsini", "25", "--force", "--objective", "spottedness"]].concat(),
    );
    desk.succeed(&["map", "star.json", "--out", "map"]);
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
        desk.succeed(&[&INIT[..], &["--out", out]].concat());
        let config = desk.json(out);
        assert_eq!(Path::new(config["observations"]["path"].as_str().unwrap()), Path::new(expected));
        assert!(config.get("$schema").is_none());
    }
    desk.succeed(&["map", "data/inside/star.json", "--out", "map"]);
    // the schema is named where it lies beside the config
    let schema = text(&dimcmc(&["schema"], &desk.path("")).stdout);
    desk.write("configs/dimcmc.schema.json", &schema);
    desk.succeed(&[&INIT[..], &["--out", "configs/star.json"]].concat());
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
    desk.succeed(&[&INIT[..], &["--force"]].concat());
    assert_ne!(desk.read("star.json"), "precious");
}

/// A single profile, or two at the same time, say nothing of spots and periods; two within minutes are enough for the
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
