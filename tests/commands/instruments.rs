//! Spectrographs by name: what `init --instrument` writes, and what `instrument.name` of a config gives.

use crate::desk::says;
use crate::init::{desk, quick};
use serde_json::json;

#[test]
fn init_takes_what_the_name_gives() {
    let desk = desk();
    let table = desk.succeed(&[&quick()[..], &["--instrument", "spirou"]].concat());
    println!("{table}");
    says(&table, &["instrument.name", "SPIRou", "--instrument; Donati et al. 2020", "instrument.resolving_power"]);
    let config = desk.json("star.json");
    assert_eq!(config["instrument"], json!({ "name": "SPIRou", "resolving_power": 70_000.0 }));
    assert_eq!(config["star"]["wavelength_nm"], 1600.0);
    let given = table.split("given\n").nth(1).unwrap().split("assumed").next().unwrap();
    says(given, &["instrument.name", "instrument.resolving_power", "star.wavelength_nm"]);

    let own = ["--instrument", "ESPADONS", "--resolving-power", "68000", "--wavelength", "700", "--out", "own.json"];
    desk.succeed(&[&quick()[..], &own].concat());
    let config = desk.json("own.json");
    assert_eq!(config["instrument"], json!({ "name": "ESPaDOnS", "resolving_power": 68_000.0 }));
    assert_eq!(config["star"]["wavelength_nm"], 700.0);
}

/// Each of several lists has its own spectrograph, and a given option applies to all of them.
#[test]
fn each_list_has_its_spectrograph() {
    let desk = desk();
    let list = desk.read("data/observations.txt");
    std::fs::create_dir(desk.path("second")).unwrap();
    // the same profiles an hour later: none is in both lists
    let later = |line: &str| match line.split_once(' ') {
        Some((file, time)) if file.starts_with('p') => {
            format!("../data/{file} {}\n", time.trim().parse::<f64>().unwrap() + 0.04)
        }
        _ => format!("{line}\n"),
    };
    desk.write("second/observations.txt", &list.lines().map(later).collect::<String>());
    let both = ["init", "data/observations.txt", "second/observations.txt"];
    // without a rotation period nothing is tried out
    let named = ["--instrument", "narval,HARPSpol", "--wavelength", "600"];
    let table = desk.succeed(&[&both[..], &named].concat());
    println!("{table}");
    says(&table, &["observations[1].resolving_power"]);
    let config = desk.json("star.json");
    assert_eq!(config["instrument"], json!({ "name": "NARVAL", "resolving_power": 65_000.0 }));
    assert_eq!(config["star"]["wavelength_nm"], 600.0);
    let second = &config["observations"][1];
    assert!(second["resolving_power"] == 110_000.0 && second.get("wavelength_nm").is_none(), "{second}");

    let stable = desk.succeed(&["init", "data/observations.txt", "--instrument", "harps", "--out", "stable.json"]);
    says(&stable, &["RV offsets of nights, up to 2.0 m/s, twice the stability of the spectrograph"]);

    let three = [&both[..], &["--instrument", "harps,harps,harps", "--out", "no.json"]].concat();
    says(&desk.refusal(&three), &["--instrument: 3 values, and 2 of what they are for"]);
}

#[test]
fn a_name_that_is_not_known_is_refused_with_those_that_are() {
    let desk = desk();
    let refused = desk.refusal(&[&quick()[..], &["--instrument", "espadon"]].concat());
    says(&refused, &["--instrument: \"espadon\" is none of ESPaDOnS, NARVAL, ", "HIRES", "--resolving-power"]);
    assert!(!desk.path("star.json").exists());

    desk.succeed(&quick());
    desk.edit("star.json", |text| text.replace("\"resolving_power\": 65000.0", "\"name\": \"espadon\""));
    let refused = desk.refusal(&["map", "star.json", "--out", "map"]);
    says(&refused, &["star.json: instrument.name: \"espadon\" is none of ESPaDOnS, ", "instrument.stability_ms"]);
}
