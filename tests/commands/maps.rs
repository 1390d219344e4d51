//! `map` of a star with evolving spots, and its use by `plot` and `report`.

use crate::desk::{Desk, dimcmc, says, text, two_spots};
use crate::svg::{paths, texts};
use dimcmc::internals::data::io::map::{FitFile, MapFile};
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

fn config() -> Value {
    let mut config = two_spots(json!({}));
    config["imaging"]["objective"] = json!("marginal-likelihood");
    config["imaging"].as_object_mut().unwrap().remove("unresolved_spots");
    config
}

/// A planet without an orbit in the model is absorbed by the jitter: the command reports this, with the command to run.
/// It does not for a star without a planet.
#[test]
fn velocities_that_vary_as_on_an_orbit_are_told() {
    let star = |k_kms: f64| {
        json!({
            "star": { "rotation_period_d": 2.741, "inclination_deg": 55.0, "vsini_kms": 30.5, "contrast": 0.3,
                      "line": { "sigma_kms": 3.5, "equivalent_width_kms": 6.0 } },
            "planet": { "k_kms": k_kms, "porb_over_prot": 2.3, "phi": 0.3 },
            "imaging": { "pixels": 400, "objective": "marginal-likelihood" },
            "observations": { "simulate": {
                "random_spots": { "number": 14, "lifetime_d": 20, "seed": 11 },
                "schedule": { "nights": 12, "per_night": [2, 2], "night_hours": 8, "seed": 3 },
                "velocity_kms": { "min": -45, "max": 45, "step": 1.8 }, "snr": 1500, "seed": 1, "pixels": 4000
            } }
        })
    };
    for k_kms in [0.25, 0.0] {
        let desk = Desk::new(star(k_kms));
        desk.succeed(&["simulate", CONFIG, "--out", "data"]);
        let mut config = star(0.0);
        config["observations"] = json!({ "path": "data/observations.txt", "velocity_jitter_kms": "fitted" });
        config["parameters"] = json!({
            "k_kms": { "prior": "uniform", "min": 0.0, "max": 1.0 },
            "vsys_kms": { "prior": "uniform", "min": -0.7, "max": 0.7 }
        });
        desk.write("star.json", &config.to_string());
        let said = desk.succeed(&["map", "star.json", "--out", "map"]);
        let told = "vary as on a circular orbit (P = 6.";
        assert_eq!(said.contains(told), k_kms > 0.0, "{said}");
        assert_eq!(desk.read("map/fit.json").contains(told), k_kms > 0.0);
        assert_eq!(said.contains("run `dimcmc periodogram star.json`"), k_kms > 0.0, "{said}");
        if k_kms > 0.0 {
            says(&said, &["; the RV jitter of ", " absorbs it", "FAP "]);
        }
    }
}

#[test]
fn the_files_are_typed_and_the_figures_are_of_them() {
    let desk = Desk::new(config());
    let said = desk.succeed(&["map", CONFIG, "--out", "maps", "--times", "0.5,1e4,-2"]);
    says(
        &said,
        &[
            "amplitude",
            "power-law index",
            "lifetime",
            "ln Z",
            "χ²/N",
            "3 from -2.000 to 10000.000 d (times in map.json)",
        ],
    );
    let line = |name: &str| said.lines().find(|line| line.starts_with(name)).unwrap();
    assert!(line("power-law index").contains(" ± "), "{said}");
    // profiles of 5 d do not constrain the lifetime of spots
    assert!(line("lifetime").ends_with(" d, not constrained"), "{said}");
    says(&said, &["hardly constrain the map at 10000.00 d", "written", "map.json, profiles.csv, rv.csv, fit.json"]);
    // what is read is what was written
    let map: MapFile = serde_json::from_value(desk.json("maps/map.json")).unwrap();
    let fit: FitFile = serde_json::from_value(desk.json("maps/fit.json")).unwrap();
    assert_eq!(serde_json::to_value(&map).unwrap(), desk.json("maps/map.json"));
    assert_eq!(serde_json::to_value(&fit).unwrap(), desk.json("maps/fit.json"));
    assert_eq!(map.maps.iter().filter_map(|map| map.time_d).collect::<Vec<_>>(), [-2.0, 0.5, 10000.0]);
    assert_eq!(map.field, fit.field);
    assert_eq!(desk.lines("maps/rv.csv"), 1 + fit.summary.profiles);
    assert_eq!(desk.lines("maps/profiles.csv"), 1 + fit.summary.data);
    assert!(desk.read("maps/profiles.csv").lines().next().unwrap().ends_with(",residual,unchanging_model"));
    // the same bytes with another number of threads
    desk.succeed(&["map", CONFIG, "--out", "again", "--times", "0.5,1e4,-2", "--threads", "1"]);
    for file in ["map.json", "profiles.csv", "rv.csv", "fit.json"] {
        assert!(desk.read(&format!("maps/{file}")) == desk.read(&format!("again/{file}")), "{file}");
    }

    let said = desk.succeed(&["plot", "maps"]);
    says(&said, &["maps.svg", "maps_mollweide.svg", "changes.svg", "profiles.svg", "residuals.svg", "rv.svg"]);
    let strip = desk.read("maps/figures/maps.svg");
    let words = ["spot filling factor", "standard deviation of the filling factor"];
    for label in ["−2.00 d", "0.50 d", "10000.00 d"].into_iter().chain(words) {
        assert!(texts(&strip).contains(&label), "{label}: {:?}", texts(&strip));
    }
    // three maps and their mean error; nothing above latitude -30 is hidden at 50 degrees, but below -50 is
    assert_eq!((paths(&strip, "star").len(), paths(&strip, "unseen").len()), (4, 0));
    let flat = desk.read("maps/figures/maps_mollweide.svg");
    assert_eq!((paths(&flat, "star").len(), paths(&flat, "unseen").len()), (4, 4));
    let changes = desk.read("maps/figures/changes.svg");
    assert!(texts(&changes).contains(&"observed − static map") && !changes.contains("NaN"));
    desk.succeed(&["report", "maps"]);
    let page = desk.read("maps/report.html");
    for sentence in
        ["Evolving maps, one per night: spot lifetime", "Spot evolution.", "spot lifetime (d)", " (not constrained)"]
    {
        assert!(page.contains(sentence), "{sentence}");
    }
}

#[test]
fn by_default_there_is_a_map_a_night_and_one_of_a_star_that_does_not_change() {
    let mut config = config();
    config["star"]["inclination_deg"] = json!(20.0);
    config["imaging"]["spot_lifetime_d"] = json!(20.0);
    let desk = Desk::new(config);
    let said = desk.succeed(&["map", CONFIG, "--out", "nights"]);
    // given values have no uncertainty
    says(&said, &["lifetime", " 20.0 d\n"]);
    assert!(said.lines().any(|line| line.starts_with("amplitude") && line.contains(" ± ")), "{said}");
    let field = &desk.json("nights/fit.json")["field"];
    assert_eq!(field["sigma_spot_lifetime_d"], Value::Null);
    let number = |key: &str| field[key].as_f64().unwrap();
    assert!((0.02..0.5).contains(&(number("sigma_spot_amplitude") / number("spot_amplitude"))), "{field}");
    assert!((0.05..3.0).contains(&number("sigma_spot_slope")), "{field}");
    // of the profiles, 0.33 to 0.51 d apart, some are alone in a night
    assert_eq!(desk.json("nights/map.json")["maps"].as_array().unwrap().len(), 5);
    desk.succeed(&["plot", "nights"]);
    // at 20 degrees what is below latitude -20 is never seen
    assert_eq!(paths(&desk.read("nights/figures/maps.svg"), "unseen").len(), 6);

    desk.set("/imaging/spot_lifetime_d", json!("static"));
    let said = desk.succeed(&["map", CONFIG, "--out", "static"]);
    says(&said, &["infinite (static)"]);
    assert!(!said.contains("static spots"), "{said}");
    let map = desk.json("static/map.json");
    assert_eq!((map["maps"].as_array().unwrap().len(), &map["field"]["spot_lifetime_d"]), (1, &Value::Null));
    let said = desk.succeed(&["plot", "static"]);
    assert!(said.contains("maps.svg") && !said.contains("changes.svg"), "{said}");
    desk.succeed(&["report", "static"]);
}

/// However many nights there are, each is drawn with its time, and colours scale with the features of the star.
#[test]
fn every_night_is_drawn() {
    let desk = Desk::new(config());
    desk.succeed(&["map", CONFIG, "--out", "maps", "--times", "0.5,1.5"]);
    let mut map = desk.json("maps/map.json");
    let of_night = |k: u32| {
        let mut night = map["maps"][k as usize % 2].clone();
        night["time_d"] = json!(f64::from(k) + 0.25);
        night
    };
    for nights in [13, 29, 50] {
        let all: Vec<Value> = (0..nights).map(of_night).collect();
        let mut many = map.clone();
        many["maps"] = json!(all);
        desk.write("maps/map.json", &many.to_string());
        desk.succeed(&["plot", "maps", "--out", "out", "--force"]);
        for file in ["out/maps.svg", "out/maps_mollweide.svg"] {
            let svg = desk.read(file);
            assert_eq!(paths(&svg, "star").len(), nights as usize + 1, "{file}");
            for night in 0..nights {
                assert!(texts(&svg).contains(&format!("{night}.25 d").as_str()), "{file}: night {night}");
            }
            assert_eq!(texts(&svg).iter().filter(|text| **text == "mean standard deviation").count(), 1);
        }
        let svg = desk.read("out/maps.svg");
        for label in ["phase 0", "0.25", "0.5", "0.75", "+60°", "+30°", "0°", "rotation"] {
            assert!(texts(&svg).contains(&label), "{label}");
        }
        assert!(paths(&svg, "rotation").len() >= nights as usize);
    }
    // features of 0.3: the scale ends there
    let faint = |x: &Value| json!(if x.as_f64().unwrap() > 0.1 { 0.3 } else { 0.0 });
    for one in map["maps"].as_array_mut().unwrap() {
        one["spot_filling"] = one["spot_filling"].as_array().unwrap().iter().map(faint).collect();
    }
    desk.write("maps/map.json", &map.to_string());
    desk.succeed(&["plot", "maps", "--out", "out", "--force"]);
    let svg = desk.read("out/maps.svg");
    assert!(texts(&svg).contains(&"0.3") && !texts(&svg).contains(&"0.4"), "{:?}", texts(&svg));
}

#[test]
fn what_makes_no_sense_is_one_line() {
    let desk = Desk::new(config());
    for times in ["nan", "1,inf", "2,2", "1e300"] {
        says(&desk.refusal(&["map", CONFIG, "--out", "maps", "--times", times]), &["--times: "]);
    }
    let output = dimcmc(&["map", CONFIG, "--out", "maps", "--times", "1,x"], &desk.path(""));
    assert_eq!(output.status.code(), Some(2));
    desk.set("/imaging/objective", json!("entropy"));
    let said = desk.refusal(&["map", CONFIG, "--out", "maps", "--times", "1"]);
    says(&said, &["--times: static maps have no times", "imaging.objective", "\"marginal-likelihood\""]);
    // a static map is of all times
    desk.succeed(&["map", CONFIG, "--out", "map"]);
    let map: MapFile = serde_json::from_value(desk.json("map/map.json")).unwrap();
    assert_eq!((map.maps.len(), map.maps[0].time_d, map.mean.is_some()), (1, None, true));
    // damaged parts of a file are named, not treated as absent
    let written = desk.json("map/map.json");
    let mut without_maps = written.clone();
    without_maps.as_object_mut().unwrap().remove("maps");
    desk.write("map/map.json", &without_maps.to_string());
    let earlier = "map.json: maps: missing: an earlier version wrote this file; repeat `dimcmc map`";
    says(&desk.refusal(&["plot", "map"]), &[earlier]);
    let mut broken = written;
    broken["spottedness"] = Value::Null;
    desk.write("map/map.json", &broken.to_string());
    says(&desk.refusal(&["plot", "map"]), &["map.json: spottedness: invalid type: null, expected f64"]);
    let mut fit = desk.json("map/fit.json");
    fit["lambda"] = json!("large");
    let read = serde_json::from_value::<FitFile>(fit).unwrap_err().to_string();
    assert!(read.starts_with("lambda: invalid type"), "{read}");

    desk.set("/imaging/objective", json!("marginal-likelihood"));
    let mut bare = config();
    bare["observations"]["simulate"]["spots"] = json!([]);
    desk.write("bare.json", &bare.to_string());
    let output = dimcmc(&["map", "bare.json", "--out", "bare"], &desk.path(""));
    assert_eq!((output.status.code(), text(&output.stdout)), (Some(1), String::new()));
    says(&text(&output.stderr), &["error: bare.json: no map (amplitude-at-bound): the amplitude of the spots falls"]);
    assert!(!desk.path("bare").exists());
}
