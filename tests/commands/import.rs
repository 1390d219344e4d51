//! `dimcmc import`: ZDIpy's star in this program's terms, settings without a counterpart, and all errors of its files.

use crate::desk::{Desk, says, with_line};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/zdipy").join(name)
}

/// Profiles of the 17 that `inzdi.dat` lists.
const PROFILES: usize = 12;

/// ZDIpy's files in `zdi`, with profiles of the star that they describe, in wide bins for the sake of time: of the
/// demo's times, in ZDIpy's Julian dates.
fn desk() -> Desk {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/demo.json");
    let mut demo: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let cycles: Vec<f64> = (0..PROFILES).map(|k| 0.18 * k as f64).collect();
    let simulate = &mut demo["observations"]["simulate"];
    simulate["cycles"] = json!(cycles);
    simulate["snr"] = json!(300);
    simulate["velocity_kms"]["step"] = json!(3.6);
    simulate["pixels"] = json!(3000);
    demo["star"]["domega_rad_d"] = json!(0.02);
    let desk = Desk::new(demo);
    desk.succeed(&["simulate", "config.json", "--out", "zdi/LSDprof"]);
    for file in ["inzdi.dat", "model-voigt-line.dat"] {
        std::fs::copy(data(file), desk.path("zdi").join(file)).unwrap();
    }
    let first_left_out = format!("LSDprof/p{PROFILES:03}.prof");
    desk.edit("zdi/inzdi.dat", |text| text.split(&first_left_out).next().unwrap().to_owned());
    desk
}

#[test]
fn values_and_conventions_are_taken_over() {
    let desk = desk();
    let table = desk.succeed(&["import", "zdi/inzdi.dat"]);
    println!("{table}");
    let config = desk.json("star.json");
    let star = &config["star"];
    for (key, value) in [
        ("rotation_period_d", 3.0),
        ("epoch_d", 0.0),
        ("inclination_deg", 38.0),
        ("vsini_kms", 40.0),
        ("vsys_kms", 0.0),
        ("domega_rad_d", 0.02),
        ("wavelength_nm", 550.0),
    ] {
        assert_eq!(star[key], value, "{key}");
    }
    assert_eq!(star["limb_darkening"], json!({ "law": "linear", "coefficients": [0.65] }));
    assert_eq!(star["line"]["equivalent_width_kms"], "auto");
    // Gauss: 3.2 / sqrt 2 km/s; Lorentz: half width 0.25 x 3.2 km/s
    let line = json!({ "shape": "voigt", "sigma_kms": 2.2627, "gamma_kms": 0.8, "equivalent_width_kms": "auto" });
    assert_eq!(star["line"], line);
    assert_eq!(config["instrument"]["resolving_power"], 65000.0);
    assert_eq!(config["observations"]["path"], "star_observations.txt");
    assert_eq!(config["observations"]["velocity_range_kms"], json!([-50.0, 50.0]));
    assert_eq!(
        (&config["observations"]["sigma_scale"], &config["imaging"]["chi2_target"]),
        (&json!("auto"), &json!(1.0))
    );
    // 20 rings: 4 / pi x 400
    assert_eq!(config["imaging"]["pixels"], 509);
    let list = desk.read("star_observations.txt");
    let expected = "# file  time_d  vrad_kms\nzdi/LSDprof/p000.prof  0  0\nzdi/LSDprof/p001.prof  0.54  0\n";
    assert!(list.starts_with(expected) && list.lines().count() == 1 + PROFILES, "{list}");
    says(
        &table,
        &[
            "not imported\n",
            "inzdi.dat:5             mass 0.9, radius 1.1",
            "inzdi.dat:20            default and limiting brightness",
            "star.line.gamma_kms",
            "model-voigt-line.dat:2  line depth 0.7",
            "model-voigt-line.dat:2  Lande factor 1.2",
            "model-voigt-line.dat:2  gravity darkening 0.5",
            "written: star.json, star_observations.txt\n",
        ],
    );
    // the star is the one that was simulated: with errors and velocities as given no map fits with another sense of
    // rotation, whose floor is a chi2 of 1.7
    let mut config = config;
    config["observations"]["sigma_scale"] = json!(1.0);
    config["observations"]["velocity_jitter_kms"] = json!(0);
    config["imaging"]["pixels"] = json!(800);
    desk.write("star.json", &config.to_string());
    desk.succeed(&["map", "star.json", "--out", "map"]);
    let spottedness = desk.json("map/fit.json")["spottedness"].as_f64().unwrap();
    let truth = desk.json("zdi/LSDprof/truth.json")["spottedness"].as_f64().unwrap();
    assert!(spottedness < 1.5 * truth, "{spottedness} {truth}");
}

/// The velocity of each profile is subtracted, as ZDIpy does.
#[test]
fn velocities_have_the_same_sign() {
    let desk = desk();
    desk.succeed(&["import", "zdi/inzdi.dat", "--pixels", "300", "--out", "a.json"]);
    for k in 0..PROFILES {
        let moved = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
            [v, i, s] => format!("{:.6} {i} {s}\n", v.parse::<f64>().unwrap() - 19.8),
            _ => format!("{line}\n"),
        };
        desk.edit(&format!("zdi/LSDprof/p{k:03}.prof"), |text| {
            text.lines().enumerate().map(|(n, l)| if n < 2 { format!("{l}\n") } else { moved(l) }).collect()
        });
    }
    let here = |line: &str| line.starts_with("LSDprof");
    desk.edit("zdi/inzdi.dat", |text| {
        text.lines().map(|l| if here(l) { l.replace("    0.0", "  -19.8") + "\n" } else { format!("{l}\n") }).collect()
    });
    desk.succeed(&["import", "zdi/inzdi.dat", "--pixels", "300", "--out", "b.json"]);
    assert!(desk.read("b_observations.txt").contains("p011.prof  5.94  -19.8\n"));
    assert_eq!(desk.read("a.json").replace("a_obs", "b_obs"), desk.read("b.json"));
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn targets_become_errors_and_flags_decide() {
    // (line of inzdi.dat, its new text, chi2_target, what the table says)
    type Case<'a> = (usize, &'a str, f64, &'a str);
    let cases: [Case; 6] = [
        (9, "C 1.44 20", 0.97, "\"sigma_scale\": 1.2 would repeat"),
        (9, "C 1.05 20", 1.05, "inzdi.dat:9"),
        (9, "E -28828. 20", 0.97, "inzdi.dat:9             target entropy -28828"),
        (18, "0 1.0 1.0", 0.97, "inzdi.dat:9             target chi^2 1"),
        (18, "1 0.64 1.0", 1.0, "\"sigma_scale\": 1.25 would repeat"),
        (13, "1 15 100.0 Full", 1.0, "inzdi.dat:13            magnetic field"),
    ];
    let desk = desk();
    let good = desk.read("zdi/inzdi.dat");
    for (line, text, target, said) in cases {
        desk.write("zdi/inzdi.dat", &with_line(&good, line, text));
        let table = desk.succeed(&["import", "zdi/inzdi.dat", "--pixels", "300", "--force"]);
        says(&table, &[said]);
        let config = desk.json("star.json");
        assert_eq!(config["imaging"]["chi2_target"], target, "{text}");
        assert_eq!(config["observations"]["sigma_scale"], "auto", "{text}");
    }
}

#[test]
fn bright_and_dark_maps_stay_what_they_are() {
    let desk = desk();
    desk.edit("zdi/inzdi.dat", |text| with_line(&text, 20, "1 1.0 1.01"));
    let table = desk.succeed(&["import", "zdi/inzdi.dat", "--pixels", "300"]);
    says(
        &table,
        &[
            "imaging.brightness",
            "bright-and-dark",
            "inzdi.dat:20            default brightness",
            "% rms fits the profiles",
        ],
    );
    assert_eq!(desk.json("star.json")["imaging"]["brightness"], "bright-and-dark");
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn other_layouts_and_no_line_file() {
    let desk = desk();
    // older ZDIpy has no mass and radius
    let without: String =
        desk.read("zdi/inzdi.dat").lines().filter(|l| !l.starts_with("0.9 ")).map(|l| format!("{l}\n")).collect();
    desk.write("zdi/old.dat", &without);
    let table = desk.succeed(&["import", "zdi/old.dat", "--pixels", "300", "--out", "old.json"]);
    assert!(!table.contains("mass"));
    desk.succeed(&["import", "zdi/inzdi.dat", "--pixels", "300", "--out", "new.json"]);
    assert_eq!(desk.read("old.json").replace("old_obs", "new_obs"), desk.read("new.json"));
    // strength by the file: depth x sqrt(pi) x Gaussian width; one that fits no profiles is refused with its value
    let strength = |depth: f64| depth * std::f64::consts::PI.sqrt() * 3.2;
    desk.write("zdi/old.dat", &with_line(&without, 23, "0"));
    let args = |out| {
        let line = ["--line", "zdi/model-voigt-line.dat"];
        [&["import", "zdi/old.dat", "--pixels", "300", "--out", out][..], &line].concat()
    };
    let message = desk.refusal(&args("other.json"));
    let wrong = format!("\"auto\" instead of {:.3}", strength(0.7));
    says(&message, &["`map` would find no maps", "the equivalent width of the line", &wrong]);
    desk.edit("zdi/model-voigt-line.dat", |text| text.replace("0.70", "1.02"));
    desk.succeed(&args("strong.json"));
    let width = desk.json("strong.json")["star"]["line"]["equivalent_width_kms"].as_f64().unwrap();
    assert!((width - strength(1.02)).abs() < 1e-4, "{width}");
    // without it the line is assumed and reported as such; options replace what files say
    std::fs::remove_file(desk.path("zdi/model-voigt-line.dat")).unwrap();
    let table = desk.succeed(&[
        "import",
        "zdi/inzdi.dat",
        "--pixels",
        "300",
        "--out",
        "bare.json",
        "--inclination",
        "41",
        "--spot",
        "3800",
    ]);
    says(&table, &["--line-sigma", "--wavelength", "--limb-darkening"]);
    let star = &desk.json("bare.json")["star"];
    assert_eq!((&star["inclination_deg"], &star["spot_k"]), (&json!(41.0), &json!(3800.0)));
}

#[test]
fn broken_files_are_refused_by_file_and_line() {
    let desk = desk();
    let cases: [(usize, &str, &[&str]); 17] = [
        (3, "38.0 40.0 3.0", &["inzdi.dat:3: 3 columns, the dOmega is due in column 4"]),
        (3, "98.0 40.0 3.0 0.02", &["inzdi.dat:3: the inclination is 98, it must be above 0 and up to 90"]),
        (3, "38.0 forty 3.0 0.02", &["inzdi.dat:3: the vsini is \"forty\", not a number"]),
        (3, "38.0 40.0 -3.0 0.02", &["inzdi.dat:3: the period is -3, it must be above 0"]),
        (3, "38.0 40.0 3.0 nan", &["inzdi.dat:3: the dOmega is \"nan\", not a number"]),
        (5, "0.9 heavy", &["inzdi.dat:5: the radius is \"heavy\""]),
        (7, "20.5", &["inzdi.dat:7: the number of rings is \"20.5\", not a whole number"]),
        (7, "0", &["inzdi.dat:7: the number of rings is \"0\""]),
        (9, "X 1.0 20", &["inzdi.dat:9: the target is \"X\", it must be C (chi^2) or E (entropy)"]),
        (9, "C 0.0 20", &["inzdi.dat:9: the target chi^2 is 0"]),
        (13, "yes 15 100.0 Full", &["inzdi.dat:13: fit magnetic is \"yes\", it must be 0 or 1"]),
        (18, "1", &["inzdi.dat:18: 1 columns, the chi^2 scaling is due in column 2"]),
        (20, "3 1.0 1.01", &["inzdi.dat:20: the brightness entropy is \"3\""]),
        (26, "0", &["inzdi.dat:26: the resolution is 0"]),
        (28, "50.0 -50.0", &["inzdi.dat:28: vel_start 50 must be below vel_end, which is -50"]),
        (34, "LSDprof/p002.prof 1.08", &["inzdi.dat:34: 2 columns, the centre velocity is due in column 3"]),
        (35, "LSDprof/q003.prof 1.62 0.0", &["inzdi.dat:35: cannot read profile", "q003.prof"]),
    ];
    let good = desk.read("zdi/inzdi.dat");
    for (line, text, parts) in cases {
        desk.write("zdi/inzdi.dat", &with_line(&good, line, text));
        let message = desk.refusal(&["import", "zdi/inzdi.dat"]);
        says(&message, parts);
        assert!(message.starts_with("zdi/inzdi.dat:"), "{message}");
    }
    // cut off anywhere, it names what is missing, or is whole
    let lines: Vec<&str> = good.lines().collect();
    for end in 0..32 {
        desk.write("zdi/inzdi.dat", &lines[..end].join("\n"));
        says(&desk.refusal(&["import", "zdi/inzdi.dat"]), &["zdi/inzdi.dat: ends before "]);
    }
    desk.write("zdi/inzdi.dat", &good);
    let line = desk.read("zdi/model-voigt-line.dat");
    for (text, part) in [
        ("550.0 0.7 3.2 0.25 1.2", "5 columns, the limb darkening is due in column 6"),
        ("550.0 0.7 3.2 0.25 1.2 1.65", "the limb darkening is 1.65, it must be from 0 to 1"),
        ("550.0 0.7 3.2 -0.25 1.2 0.65", "the Lorentzian width is -0.25, it must be 0 or more"),
        ("550.0 0.7 wide 0.25 1.2 0.65", "the Gaussian width is \"wide\", not a number"),
    ] {
        desk.write("zdi/model-voigt-line.dat", &with_line(&line, 2, text));
        says(&desk.refusal(&["import", "zdi/inzdi.dat"]), &["zdi/model-voigt-line.dat:2: ", part]);
    }
    desk.write("zdi/model-voigt-line.dat", "# nothing\n");
    says(&desk.refusal(&["import", "zdi/inzdi.dat"]), &["model-voigt-line.dat: ends before the model of the line"]);
    says(&desk.refusal(&["import", "zdi/absent.dat"]), &["zdi/absent.dat: cannot read"]);
}

#[test]
fn nothing_is_overwritten_and_no_list_is_broken() {
    let desk = desk();
    desk.write("star_observations.txt", "precious");
    says(
        &desk.refusal(&["import", "zdi/inzdi.dat", "--pixels", "300"]),
        &["--out star.json: star_observations.txt exists", "--force"],
    );
    std::fs::rename(desk.path("zdi"), desk.path("my data")).unwrap();
    let message = desk.refusal(&["import", "my data/inzdi.dat", "--out", "b.json"]);
    says(&message, &["my data/inzdi.dat:32: profile my data/LSDprof/p000.prof: ", "a path with a blank"]);
    desk.succeed(&["import", "my data/inzdi.dat", "--pixels", "300", "--out", "my data/star.json"]);
    desk.succeed(&["map", "my data/star.json", "--out", "map"]);
}

/// A line without a Lorentzian is a Gaussian.
#[test]
fn a_gaussian_line_stays_one() {
    let desk = desk();
    desk.edit("zdi/model-voigt-line.dat", |text| with_line(&text, 2, "550.0 0.70 3.20 0.0 1.2 0.65"));
    desk.succeed(&["import", "zdi/inzdi.dat", "--pixels", "300"]);
    let line = json!({ "shape": "gaussian", "sigma_kms": 2.2627, "equivalent_width_kms": "auto" });
    assert_eq!(desk.json("star.json")["star"]["line"], line);
}

/// ZDIpy's own example, LO Peg with its line and the targets that its input file names for the brightness, is fitted to
/// them. The data may not be distributed with the program, so that this runs where they are.
#[test]
fn zdipys_own_example_reaches_its_target() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/lopeg");
    let Ok(list) = std::fs::read_to_string(data.join("observations.txt")) else { return };
    let desk = desk();
    std::fs::create_dir(desk.path("lopeg")).unwrap();
    let mut profiles = String::new();
    for line in list.lines().filter(|line| !line.starts_with('#')) {
        let file = line.split_whitespace().next().unwrap();
        std::fs::copy(data.join(file), desk.path("lopeg").join(file)).unwrap();
        profiles += &format!("{line}\n");
    }
    desk.write("lopeg/model-voigt-line.dat", "650.0 0.6306 2.41 0.89 1.195 0.66 0.5\n");
    let target = 0.1_f64;
    let star = "45.0 67.7 0.4232 0.02\n0.0 0.0\n40\n";
    let fit = format!("C {target} 20\n0.0001\n0 15 100.0 Full\n0 none\n1 1.0 1.0\n1 1.0 1.01\n0 none\n1\n");
    let rest = format!("65000.\n-80.0 80.0\n2456892.015\n{profiles}");
    desk.write("lopeg/inzdi.dat", &format!("{star}{fit}{rest}"));
    let table = desk.succeed(&["import", "lopeg/inzdi.dat", "--force"]);
    println!("{table}");
    says(&table, &["test fit: ", &format!("chi^2 of {target} with errors as quoted")]);
    let mut config = desk.json("star.json");
    assert_eq!(config["star"]["line"]["shape"], "voigt");
    // ZDIpy's own errors and target, in place of measured ones
    let scale = target.sqrt();
    config["observations"]["sigma_scale"] = json!(scale);
    config["observations"]["velocity_jitter_kms"] = json!(0);
    config["imaging"]["chi2_target"] = json!(1.0);
    desk.write("star.json", &config.to_string());
    println!("{}", desk.succeed(&["map", "star.json", "--out", "map", "--force"]));
    let fit = desk.json("map/fit.json");
    let chi2 = fit["chi2_per_datum"].as_f64().unwrap() * scale * scale;
    // within the solver's tolerance
    assert!((chi2 / target - 1.0).abs() < 1e-3, "{fit}");
}

/// Every command that reads a profile given as 1 - I reports it, as do results.
#[test]
fn what_was_made_of_profiles_is_said() {
    let desk = desk();
    for k in 0..PROFILES {
        let turned = |line: &str| match line.split_whitespace().collect::<Vec<_>>()[..] {
            [v, i, s] => format!("{v} {:.12} {s}\n", 1.0 - i.parse::<f64>().unwrap()),
            _ => format!("{line}\n"),
        };
        desk.edit(&format!("zdi/LSDprof/p{k:03}.prof"), |text| text.lines().map(turned).collect());
    }
    const SAID: &str = "profiles: all of them: given as 1 - I";
    says(&desk.succeed(&["import", "zdi/inzdi.dat", "--pixels", "300"]), &[SAID]);
    says(&desk.succeed(&["init", "zdi/LSDprof/observations.txt", "--out", "init.json"]), &[SAID]);
    says(&desk.succeed(&["map", "star.json", "--out", "map"]), &["given as 1 - I"]);
    says(&desk.read("map/fit.json"), &["all of them: given as 1 - I"]);
}
