//! `survey` as users run it: on results of the program, on samples of known rate, refusals, groups.

use crate::desk::{Desk, dimcmc, says, text};
use crate::shared;
use crate::svg::{paths, texts};
use serde_json::{Value, json};

/// A star of a sample, as its folders show it.
#[derive(Clone, Copy)]
struct Star {
    /// FAP, period (d) and K (km/s) of its highest peak.
    peak: (f64, f64, f64),
    mass_msun: Option<f64>,
    /// K (km/s) that is detected half the time.
    k50_kms: f64,
}

const QUIET: Star = Star { peak: (0.5, 2.0, 0.01), mass_msun: Some(1.0), k50_kms: 0.02 };

/// Periods (d) and K (km/s) injected.
const PERIODS: [f64; 4] = [0.5, 1.0, 10.0, 20.0];
const AMPLITUDES: [f64; 3] = [0.01, 0.02, 2.0];

impl Star {
    fn own(self, name: &str) -> Value {
        let star = json!({ "name": name, "mass_msun": self.mass_msun, "rotation_period_d": 1.0 });
        json!({ "version": "0", "data_sha256": name, "config_sha256": "", "config": { "star": star } })
    }

    fn search(self, desk: &Desk, folder: &str, name: &str) {
        let (probability, period_d, k_kms) = self.peak;
        let finding = match probability {
            p if p < 1e-3 => "detection",
            p if p < 0.01 => "candidate",
            _ => "no-planet-needed",
        };
        let signal = json!({ "period_d": period_d, "sigma_period_d": 0.01, "k_kms": k_kms, "sigma_k_kms": 1e-4 });
        let verdict = json!({
            "finding": finding, "sentence": "", "false_alarm_probability": probability, "signal": signal, "against": []
        });
        write(desk, folder, "periodogram.json", &[json!({ "verdict": verdict }), self.own(name)]);
    }

    /// Recovered from `k50_kms` on at all phases, nowhere below.
    fn limits(self, desk: &Desk, folder: &str, name: &str) {
        let limit = |period_d: f64| {
            json!({
                "period_d": period_d, "porb_over_prot": period_d, "k50_kms": self.k50_kms, "k95_kms": self.k50_kms
            })
        };
        let before = json!({ "period_d": 1.0, "delta_ln_l": 1.0, "false_alarm_probability": 0.5 });
        let file = json!({
            "false_alarm_probability": 0.01, "level": 8.0, "removed": null, "before": before, "k_kms": AMPLITUDES,
            "phases": 4, "limits": PERIODS.map(limit), "agreement": null, "comparisons": [], "warnings": []
        });
        write(desk, folder, "limits.json", &[file, self.own(name)]);
        let mut table = "period_d,porb_over_prot,k_kms,phases,detected,recovered\n".to_owned();
        for period in PERIODS {
            for k in AMPLITUDES {
                let found = if k >= self.k50_kms { 4 } else { 0 };
                table += &format!("{period},{period},{k},4,{found},{found}\n");
            }
        }
        desk.write(&format!("{folder}/limits.csv"), &table);
    }
}

fn write(desk: &Desk, folder: &str, file: &str, parts: &[Value]) {
    std::fs::create_dir_all(desk.path(folder)).unwrap();
    let all = parts.iter().flat_map(|part| part.as_object().unwrap().clone());
    desk.write(&format!("{folder}/{file}"), &Value::Object(all.collect()).to_string());
}

/// Stars named `Star 1` and so on, each with a folder of both results in `stars`.
fn sample(stars: &[Star]) -> Desk {
    let desk = Desk::new(json!(null));
    for (k, star) in stars.iter().enumerate() {
        let (folder, name) = (format!("stars/{:03}", k + 1), format!("Star {}", k + 1));
        star.search(&desk, &folder, &name);
        star.limits(&desk, &folder, &name);
    }
    desk
}

/// The rate of a sample, of all stars and one box.
fn rate(desk: &Desk, options: &[&str]) -> Value {
    desk.succeed(&[&["survey", "stars", "--out", "survey", "--force"], options].concat());
    desk.json("survey/survey.json")["rates"][0].clone()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

#[test]
fn results_of_the_program_are_read() {
    let desk = shared::desk();
    let few = ["--periods", "8", "--amplitudes", "8", "--phases", "4", "--draws", "1000"];
    desk.succeed(&[&["limits", "config.json", "--out", "limits"], &few[..]].concat());
    let printed = desk.succeed(&["survey", "periodogram", "limits", "--box", "0.5:5,0.05:1", "--out", "survey"]);
    says(
        &printed,
        &["Beta & Co", "box 1: P 0.5 to 5 d, K 0.05 to 1 km/s", "written: survey: survey.csv, completeness"],
    );
    let (file, limits) = (desk.json("survey/survey.json"), desk.json("limits/limits.json"));
    let search = desk.json("periodogram/periodogram.json");
    let star = &file["stars"][0];
    assert_eq!(star["finding"], search["verdict"]["finding"]);
    assert_eq!(star["false_alarm_probability"], search["verdict"]["false_alarm_probability"]);
    let completeness = number(&star["completeness"][0]);
    assert!((0.05..0.95).contains(&completeness), "{completeness}");
    // what is injected is in the table, at the ends of the periods and K
    let table = desk.read("survey/completeness.csv");
    let first: Vec<f64> = table.lines().nth(1).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!((first[1] / number(&limits["limits"][0]["period_d"]) - 1.0).abs() < 1e-9);
    assert!((first[2] / number(&limits["k_kms"][0]) - 1.0).abs() < 1e-9);
    // the search that a chain keeps is the same
    let chain = desk.succeed(&["survey", "sample", "limits", "--box", "0.5:5,0.05:1", "--out", "of_chain"]);
    assert_eq!(chain.lines().next(), printed.lines().next());
    let figures = desk.succeed(&["plot", "survey"]);
    says(&figures, &["completeness.svg", "rates.png"]);
}

/// All planets in the box are detected, and there are no spurious ones: a binomial.
#[test]
fn rates_are_those_of_closed_forms() {
    let desk = sample(&[QUIET; 30]);
    let nothing = rate(&desk, &[]);
    assert!((number(&nothing["effective_stars"]) - 30.0).abs() < 1e-9);
    let upper = 1.0 - 0.05f64.powf(1.0 / 31.0);
    assert!((number(&nothing["upper95"]) / upper - 1.0).abs() < 2e-3, "{nothing}");
    assert_eq!(number(&nothing["ci68"][0]), 0.0);
    let planet = Star { peak: (1e-20, 3.0, 0.2), ..QUIET };
    let with = |planets: usize| {
        let stars: Vec<Star> = (0..30).map(|k| if k < planets { planet } else { QUIET }).collect();
        sample(&stars)
    };
    let three = rate(&with(3), &[]);
    assert!((number(&three["mean"]) - 4.0 / 32.0).abs() < 1e-3 && three["upper95"].is_null(), "{}", three["mean"]);
    assert!(three["signals"].as_array().unwrap().iter().all(|signal| number(&signal["reliability"]) > 0.999));
    assert!((number(&rate(&with(3), &["--jeffreys"])["mean"]) - 3.5 / 31.0).abs() < 1e-3);
    // half of a box in ln K is below what the stars show
    let half = rate(&with(3), &["--box", "1:10,0.0004:1"]);
    let expected = (1.0f64 / 0.02).ln() / (1.0f64 / 0.0004).ln();
    let found = number(&half["effective_stars"]) / 30.0;
    assert!((found - expected).abs() < 0.06, "{found} {expected}");
    // by mass: 0.2 km/s in 3 d are 1.42 Jupiter masses around the Sun
    assert_eq!(number(&rate(&with(3), &["--mass-box", "1:10,1:2"])["detections"]), 3.0);
    assert_eq!(number(&rate(&with(3), &["--mass-box", "1:10,2:4"])["detections"]), 0.0);
}

#[test]
fn weak_signals_count_by_their_chance() {
    let of = |probability: f64| {
        let mut stars = [Star { k50_kms: 0.15, ..QUIET }; 20];
        stars[4].peak = (probability, 3.0, 0.2);
        rate(&sample(&stars), &["--box", "1:10,0.05:1"])
    };
    let (weak, strong) = (of(9e-3), of(1e-9));
    let reliability = |rate: &Value| number(&rate["signals"][0]["reliability"]);
    assert_eq!(weak["signals"][0]["name"], "Star 5");
    assert!(reliability(&weak) < 0.9 && reliability(&strong) > 0.999, "{weak} {strong}");
    assert!(number(&weak["median"]) < number(&strong["median"]));
    assert!(number(&weak["false_alarms"]) > 0.01);
}

#[test]
fn stars_without_results_are_named() {
    let desk = sample(&[QUIET; 4]);
    std::fs::remove_file(desk.path("stars/002/limits.json")).unwrap();
    std::fs::remove_file(desk.path("stars/004/limits.json")).unwrap();
    let message = desk.refusal(&["survey", "stars", "--out", "survey"]);
    says(&message, &["no limits of 2 of 4 stars: Star 2, Star 4", "`dimcmc limits CONFIG --out FOLDER`"]);
    std::fs::remove_file(desk.path("stars/001/periodogram.json")).unwrap();
    says(
        &desk.refusal(&["survey", "stars", "--out", "survey"]),
        &["no search of 1 of 4 stars: Star 1", "Star 2, Star 4"],
    );
    // both results of a star in two folders, anywhere
    QUIET.limits(&desk, "others/a", "Star 2");
    QUIET.limits(&desk, "others/b", "Star 4");
    QUIET.search(&desk, "star_1", "Star 1");
    desk.succeed(&["survey", "stars", "others", "star_1", "star_1", "--out", "survey"]);
    says(&desk.refusal(&["survey", "absent", "--out", "x"]), &["absent: no such folder"]);
    std::fs::create_dir(desk.path("empty")).unwrap();
    says(&desk.refusal(&["survey", "empty", "--out", "x"]), &["empty: holds no search and no limits"]);
    QUIET.limits(&desk, "others/c", "Star 4");
    says(
        &desk.refusal(&["survey", "stars", "others", "star_1", "--out", "x"]),
        &["Star 4: others/b, others/c: several results of the same observations"],
    );
}

#[test]
fn results_that_do_not_belong_together_are_refused() {
    let desk = sample(&[QUIET; 2]);
    let other = |file: String| file.replace("\"data_sha256\":\"Star 2\"", "\"data_sha256\":\"other\"");
    desk.edit("stars/002/limits.json", other);
    let message = desk.refusal(&["survey", "stars", "--out", "survey"]);
    says(&message, &["Star 2: stars/002 and stars/002 are of different observations"]);
    let desk = sample(&[Star { mass_msun: None, ..QUIET }, QUIET]);
    let message = desk.refusal(&["survey", "stars", "--mass-box", "1:10,0.3:13", "--out", "survey"]);
    says(&message, &["--mass-box 1:10,0.3:13: needs star.mass_msun in the config of Star 1"]);
    let output = dimcmc(&["survey", "stars", "--box", "1:10", "--out", "survey"], &desk.path(""));
    assert_eq!(output.status.code(), Some(2));
    says(&text(&output.stderr), &["P1:P2,K1:K2 (d, km/s)"]);
}

#[test]
fn groups_and_reliabilities_come_from_a_table() {
    let planet = Star { peak: (1e-20, 3.0, 0.2), ..QUIET };
    let desk = sample(&[planet, planet, QUIET, QUIET, QUIET]);
    desk.write("stars.csv", "age,name,planet\nold,Star 3,\nyoung,Star 1,\nyoung,\"Star 2\",0\nold,Star 4,\n,Star 5,\n");
    let options = ["--table", "stars.csv", "--group", "age", "--reliability", "planet"];
    let printed = desk.succeed(&[&["survey", "stars", "--out", "survey"], &options[..]].concat());
    says(&printed, &["young", "old"]);
    let rates = desk.json("survey/survey.json")["rates"].clone();
    let groups: Vec<&Value> = rates.as_array().unwrap().iter().map(|rate| &rate["group"]).collect();
    assert_eq!(groups, [&json!(null), &json!("young"), &json!("old")]);
    let column = |key: &str| (0..3).map(|k| number(&rates[k][key])).collect::<Vec<_>>();
    assert_eq!((column("stars"), column("detections")), (vec![5.0, 2.0, 2.0], vec![1.0, 1.0, 0.0]));
    desk.succeed(&["plot", "survey"]);
    let svg = desk.read("survey/figures/rates.svg");
    assert_eq!(paths(&svg, "rate").len(), 3);
    assert!(texts(&svg).iter().any(|text| text.starts_with("young, 2 stars")), "{:?}", texts(&svg));
    assert!(texts(&desk.read("survey/figures/completeness.svg")).contains(&"Star 1"));
    desk.write("stars.csv", "name,age\nStar 1,young\nStar 3,old\nStar 5,old\n");
    let refused = |options: &[&str]| desk.refusal(&[&["survey", "stars", "--out", "x"], options].concat());
    says(
        &refused(&["--table", "stars.csv", "--group", "age"]),
        &["stars.csv: no row of Star 2, Star 4 in column name"],
    );
    desk.write("stars.csv", "name,planet\nStar 1,2\nStar 2,\nStar 3,\nStar 4,\nStar 5,\n");
    says(&refused(&["--table", "stars.csv", "--group", "age"]), &["stars.csv: no column age", "name, planet"]);
    says(&refused(&["--table", "stars.csv", "--reliability", "planet"]), &["stars.csv:2: planet: \"2\" is no prob"]);
}

/// Neither a star without a verdict nor one whose planet was known before constrains the rate.
#[test]
fn stars_without_a_blind_verdict_do_not_count() {
    let desk = sample(&[QUIET; 3]);
    desk.edit("stars/002/periodogram.json", |file| file.replace("no-planet-needed", "not-judged"));
    desk.edit("stars/003/periodogram.json", |file| {
        file.replace("\"against\"", "\"known\":{\"significance\":1.0,\"k_upper95_kms\":0.1},\"against\"")
    });
    let printed = desk.succeed(&["survey", "stars", "--out", "survey"]);
    says(&printed, &["warning: Star 2: no verdict", "warning: Star 3: a planet of known ephemeris"]);
    assert_eq!(desk.json("survey/survey.json")["rates"][0]["stars"], 1);
}
